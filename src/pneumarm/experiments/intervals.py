"""Means over agents and arms with their intervals, and what these say of a claim."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.experiments.design.distributions import t_quantile
from pneumarm.experiments.experiment import Rows

Array = NDArray[np.float64]
Verdict = Literal["holds", "does not hold", "open"]


class Interval(NamedTuple):
    """A mean and half the width of its 95 % interval, infinite where there is a single sample."""

    mean: float
    half: float

    def __str__(self) -> str:
        digits = 0 if abs(self.mean) >= 1000 else 1 if abs(self.mean) >= 100 else 2
        return f"{self.mean:.{digits}f}" + (f" ± {self.half:.{digits}f}" if math.isfinite(self.half) else "")

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half


def interval(values: ArrayLike) -> Interval:
    """Return the mean of ``values`` (arms, runs), which may hold NaN, with its interval by Student's t.

    Runs on one arm are no independent samples of all arms. So the samples are the means of the arms, where there
    are several; else the runs.
    """
    table = np.atleast_2d(np.asarray(values, np.float64))
    known = table[~np.isnan(table).all(axis=1)]
    if known.size == 0:
        return Interval(math.nan, math.inf)
    samples = np.nanmean(known, axis=1) if len(known) > 1 else known[0][~np.isnan(known[0])]
    n = len(samples)
    half = t_quantile(0.95, n - 1) * float(samples.std(ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return Interval(float(samples.mean()), half)


def by_arm(rows: Rows, figure: str, trial: int) -> Array:
    """Return ``figure`` of ``trial``, shape (arms, runs)."""
    return np.stack([rows.table(figure, [trial], arm)[0] for arm in rows.arms])


def curve(rows: Rows, figures: Sequence[str], trial: int) -> list[Interval]:
    """Return the interval of each of ``figures`` of ``trial``."""
    return [interval(by_arm(rows, figure, trial)) for figure in figures]


def above(found: Interval, least: float = 0.0) -> Verdict:
    """Return whether it holds that what was ``found`` the interval of is more than ``least``."""
    if found.low > least:
        return "holds"
    return "does not hold" if found.high < least else "open"


def below(found: Interval, most: float = 0.0) -> Verdict:
    """Return whether it holds that what was ``found`` the interval of is less than ``most``."""
    if found.high < most:
        return "holds"
    return "does not hold" if found.low > most else "open"
