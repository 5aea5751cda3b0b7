"""Differences within runs, with their intervals: what most claims rest on.

Trials of a run begin with the same weights on the same arm, so the difference of two trials is taken within each run
on each arm; those differences are the sample. Student's t gives the interval of their mean.
"""

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.experiments.design.distributions import t_quantile

Verdict = Literal["holds", "does not hold", "open"]
_HUNDREDS = 100.0


class Interval(NamedTuple):
    """A mean and half its 95 % confidence interval, infinite for a single sample."""

    mean: float
    half: float
    samples: int

    def __str__(self) -> str:
        """Return it for people, hundreds without decimals."""
        half = self.half if math.isfinite(self.half) else 0.0
        digits = 0 if max(abs(self.mean), half) >= _HUNDREDS else 2
        return self._written(f"+.{digits}f")

    def __format__(self, form: str) -> str:
        """Return it for people, with the form of both numbers: ``.2f``, ``+.2f``, ``.1%``; "none" of no samples."""
        if not form:
            return str(self)
        if not self.samples:
            return "none"
        if form.endswith("%"):
            return f"{self.times(100):{form[:-1]}f}\N{NO-BREAK SPACE}%"
        return self._written(form)

    def _written(self, form: str) -> str:
        """Return both numbers in ``form``, on one line, with commas between thousands and a minus, none before 0."""
        sign, places = ("+", form[1:]) if form.startswith("+") else ("", form)
        said = f"{self.mean:{sign}z,{places}}".replace("-", "\N{MINUS SIGN}")
        if math.isfinite(self.half):
            said += f" ± {self.half:,{places}}".replace(" ", "\N{NO-BREAK SPACE}")
        return said

    def times(self, factor: float) -> "Interval":
        """Return the interval of ``factor`` times what is estimated."""
        return Interval(factor * self.mean, abs(factor) * self.half, self.samples)

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half


def interval(samples: ArrayLike, confidence: float = 0.95) -> Interval:
    """Return the mean of ``samples`` (n,), n at least 1, with its interval by Student's t.

    What was chosen among several before it is looked at needs more ``confidence`` (:func:`of_the_best`).
    """
    x = np.asarray(samples, np.float64)
    n = len(x)
    half = t_quantile(confidence, n - 1) * float(x.std(ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return Interval(float(x.mean()), half, n)


def of_the_best(count: int) -> float:
    """Return the confidence that leaves 95 % to an interval of the largest of ``count`` (Bonferroni)."""
    return 1 - 0.05 / count


def above(found: Interval, threshold: float = 0.0) -> Verdict:
    """Return whether what is estimated is above ``threshold``; open while the interval includes it."""
    if found.low > threshold:
        return "holds"
    return "does not hold" if found.high < threshold else "open"


def below(found: Interval, threshold: float = 0.0) -> Verdict:
    """Return whether what is estimated is below ``threshold``; open while the interval includes it."""
    return above(found.times(-1), -threshold)


def within_margin(found: Interval, margin: float) -> Verdict:
    """Return whether what is estimated lies within ``margin`` of 0; open while the interval includes an end."""
    if max(abs(found.low), abs(found.high)) <= margin:
        return "holds"
    return "does not hold" if found.low > margin or found.high < -margin else "open"


def all_hold(verdicts: Iterable[Verdict]) -> Verdict:
    """Return whether something holds of all: it does not where it does not of one, and is open where one is."""
    found = set(verdicts)
    return "does not hold" if "does not hold" in found else "open" if "open" in found else "holds"
