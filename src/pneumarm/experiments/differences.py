"""Differences within runs, with their intervals: what most claims rest on.

Trials of a run begin with the same weights on the same arm, so the difference of two trials is taken within each run
on each arm; those differences are the sample. Student's t gives the interval of their mean.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.experiments.design.distributions import t_quantile

Verdict = Literal["holds", "does not hold", "open"]


class Interval(NamedTuple):
    """A mean and half its 95 % confidence interval, infinite for a single sample."""

    mean: float
    half: float
    samples: int

    def __str__(self) -> str:
        """Return it for people."""
        return f"{self.mean:+.2f}" + (f" ± {self.half:.2f}" if math.isfinite(self.half) else "")

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half


def interval(samples: ArrayLike) -> Interval:
    """Return the mean of ``samples`` (n,), n at least 1, with its interval by Student's t."""
    x = np.asarray(samples, np.float64)
    n = len(x)
    half = t_quantile(0.95, n - 1) * float(x.std(ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return Interval(float(x.mean()), half, n)


def above(found: Interval, threshold: float = 0.0) -> Verdict:
    """Return whether what is estimated is above ``threshold``; open while the interval includes it."""
    if found.low > threshold:
        return "holds"
    return "does not hold" if found.high < threshold else "open"


def below(found: Interval, threshold: float = 0.0) -> Verdict:
    """Return whether what is estimated is below ``threshold``; open while the interval includes it."""
    return above(Interval(-found.mean, found.half, found.samples), -threshold)
