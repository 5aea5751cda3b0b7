"""Estimates over arms, and verdicts on what was claimed before they were known.

**The arm is the sampling unit.** Runs on an arm share its recording and its fit, so each arm gives one number: the
mean of its runs, and beside it their median, which no single run that diverges decides. Student's t over arms gives
the intervals. A single arm gives none that speaks of other arms.

**A claim states beforehand** (:class:`Criterion`) between which bounds its figure lies and which size matters. It
holds where the whole 95 % interval lies between them: two one-sided tests at 2.5 % each, for a margin as for a
direction. It does not hold where the whole interval lies outside; for a direction (a bound of 0) also where it shows
that the size that matters is not reached. Where mean and median, several figures, or direction and size disagree it
holds in part. Else the design cannot decide it, and the spread found says how many arms could.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from pneumarm.experiments.design.distributions import t_quantile, t_tail
from pneumarm.statistics import Z

Verdict = Literal["holds", "in part", "does not hold", "cannot be decided"]
VERDICTS: tuple[Verdict, ...] = ("holds", "in part", "does not hold", "cannot be decided")
OPEN: Verdict = "cannot be decided"
CONFIDENCE, POWER = 0.95, 0.95
FEWEST_ARMS = 5
"""Fewest arms that are ever advised: the spread between fewer is hardly known."""
_HUNDREDS = 100.0


class Interval(NamedTuple):
    """A mean and half its 95 % confidence interval, infinite for a single sample."""

    mean: float
    half: float
    samples: int
    arms: int = 0
    """Arms that it speaks of; 0 for what is not of arms, such as the thesis' tables."""
    median: "Interval | None" = None
    """The same from the medians of each arm's runs; None of shares, which have none."""
    limited: bool = False
    """Whether most rows lie at one end of all: a floor or a ceiling, under which no effect can be seen."""

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
        median = self.median and self.median.times(factor)
        return self._replace(mean=factor * self.mean, half=abs(factor) * self.half, median=median)

    def figures(self) -> dict[str, float]:
        """Return it for programs."""
        return {"mean": self.mean, "half": self.half, "samples": self.samples}

    @property
    def flat(self) -> bool:
        """Whether no effect can be seen, because most rows are alike."""
        return self.limited or self.mean == self.half == 0

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half

    @property
    def error(self) -> float:
        """Standard error of the mean."""
        return self.half / t_quantile(CONFIDENCE, self.samples - 1) if self.samples > 1 else math.inf


def interval(samples: ArrayLike, arms: int = 0, confidence: float = CONFIDENCE) -> Interval:
    """Return the mean of ``samples`` (n,), n at least 1, with its interval by Student's t.

    What was chosen among several before it is looked at needs more ``confidence`` (:func:`of_the_best`).
    """
    x = np.asarray(samples, np.float64)
    n = len(x)
    half = t_quantile(confidence, n - 1) * float(x.std(ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return Interval(float(x.mean()), half, n, arms)


def of_the_best(count: int) -> float:
    """Return the confidence that leaves 95 % to an interval of the largest of ``count`` (Bonferroni)."""
    return 1 - (1 - CONFIDENCE) / count


class Judgement(NamedTuple):
    """A verdict and what it rests on."""

    verdict: Verdict
    why: str = ""
    """Which part holds, or why the design cannot decide."""
    arms: int = 0
    """Arms that would decide it, where the design cannot and arms are what it lacks."""
    p: float = 1.0
    """Chance of such means at the bound they are compared with; 1 where nothing is decided."""


class Criterion(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a claim states before its rows are computed: its figures, their bounds, the size that matters."""

    figure: str | tuple[str, ...] = "found"
    """Names of what is estimated; of several all must lie between the bounds."""
    above: float | None = None
    """Lower bound. 0 is a direction: more, by the size that matters; with ``below`` it is a margin."""
    below: float | None = None
    """Upper bound, likewise."""
    matters: float
    """Size that matters: the distance from a bound that the design is to tell."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its figures."""
        return (self.figure,) if isinstance(self.figure, str) else self.figure

    @property
    def bounds(self) -> tuple[float, float]:
        """Between which it holds."""
        return (-math.inf if self.above is None else self.above, math.inf if self.below is None else self.below)

    @property
    def refuting(self) -> tuple[float, float]:
        """Outside which it does not hold: the bounds, or for a direction the size that matters."""
        low, high = self.bounds
        return (self.matters if low == 0 else low, -self.matters if high == 0 else high)

    def stated(self) -> str:
        """Return in words what was stated."""
        (low, high), (least, most) = self.bounds, self.refuting
        ends = [(f"above {low:g}", f"below {least:g}")] if math.isfinite(low) else []
        ends += [(f"below {high:g}", f"above {most:g}")] if math.isfinite(high) else []
        holds, refuted = zip(*ends, strict=True)
        said = f"holds {' and '.join(holds)}, refuted {' or '.join(refuted)}; {self.matters:g} matters"
        return said.replace("-", "\N{MINUS SIGN}")

    def parts(self, found: Mapping[str, Any]) -> dict[str, Interval]:
        """Return what it is judged by, of what was ``found``; a figure may be several intervals by name."""
        parts: dict[str, Interval] = {}
        for name in self.names:
            parts |= found[name] if isinstance(found[name], Mapping) else {name: found[name]}
        return parts

    def judge(self, found: Mapping[str, Any]) -> Judgement:
        """Return the verdict that what was ``found`` allows."""
        parts = self.parts(found)
        if not all(one.samples for one in parts.values()):
            return Judgement(OPEN, f"no rows have this figure; {FEWEST_ARMS} arms at least that have it are needed")
        if any(one.arms < 2 or not math.isfinite(one.half) for one in parts.values()):
            return Judgement(OPEN, self._of_one_arm(parts), FEWEST_ARMS)
        means = {name: self._region(one) for name, one in parts.items()}
        both = {name: self._with_median(means[name], one) for name, one in parts.items()}
        verdict = together(both.values())
        why = [] if len(parts) == 1 else [f"{name}: {one}" for name, one in both.items()]
        for name, one in parts.items():
            why += self._reasons(means[name], one)
        if verdict != OPEN:
            return Judgement(verdict, "; ".join(dict.fromkeys(why)), p=self._p(verdict, parts.values()))
        undecided = [one for name, one in parts.items() if both[name] == OPEN]
        if any(one.flat for one in undecided):
            return Judgement(OPEN, "; ".join(dict.fromkeys(why)))
        arms = max(self.arms_needed(one) for one in undecided)
        why.append(f"the 95 % interval of {undecided[0].arms} arms allows both; {arms:,} arms would tell them apart")
        return Judgement(OPEN, "; ".join(dict.fromkeys(why)), arms)

    def arms_needed(self, pilot: Interval) -> int:
        """Return how many arms decide it with 95 % power at the size that matters, by the spread of a ``pilot``.

        The quantiles of both errors are Student's with the freedom of the pilot, whose spread is a guess too (Julious
        and Owen, Pharm. Stat. 5, 2006). The power is that of mean and median, and of both bounds, together.
        """
        least = max(FEWEST_ARMS, 1 + pilot.arms)
        if pilot.median is None and pilot.mean in (0, 1):  # a share of all or none, whose spread says nothing
            return max(least, math.ceil(Z**2 * (1 / self.matters - 1)))
        spread = max(one.error * math.sqrt(one.samples) for one in (pilot, pilot.median or pilot))
        ends = (1 + (pilot.median is not None)) * (2 - (None in (self.above, self.below)))
        chances = (CONFIDENCE, 1 - 2 * (1 - POWER) / ends)
        width = sum(t_quantile(chance, pilot.samples - 1) for chance in chances) * spread / self.matters
        return max(least, math.ceil(width * width))

    def _region(self, one: Interval) -> Verdict:
        (low, high), (least, most) = self.bounds, self.refuting
        inside, outside = one.low > low and one.high < high, one.high < least or one.low > most
        if outside and not inside and 0 in (low, high) and one.flat:
            return OPEN
        return ("in part" if inside else "does not hold") if outside else "holds" if inside else OPEN

    def _with_median(self, of_mean: Verdict, one: Interval) -> Verdict:
        return of_mean if one.median is None else together([of_mean, self._region(one.median)])

    def _reasons(self, of_mean: Verdict, one: Interval) -> Iterator[str]:
        if of_mean == OPEN and one.flat:
            yield (
                "most rows end at the same floor or ceiling, which hides an effect on however many arms; what would "
                f"decide it is a figure without such an end, on {FEWEST_ARMS} arms at least"
            )
        if of_mean == "in part":
            yield f"it does, but by less than matters ({self.matters:g})"
        if one.median is not None and (of_median := self._region(one.median)) != of_mean:
            yield f"by the mean it {_VERB[of_mean]}, by the median ({one.median}) it {_VERB[of_median]}"

    def _of_one_arm(self, parts: Mapping[str, Interval]) -> str:
        inside = [self.bounds[0] < one.mean < self.bounds[1] for one in parts.values()]
        seen = "as claimed" if all(inside) else "not as claimed"
        return f"one arm, of which alone this speaks (there it is {seen}); {FEWEST_ARMS} arms at least are needed"

    def _p(self, verdict: Verdict, parts: Iterable[Interval]) -> float:
        """Return the one-sided chance of the means at the bound, the largest of all figures."""
        if verdict not in ("holds", "does not hold"):
            return 1.0
        found = []
        for one in parts:
            low, high = self.bounds if verdict == "holds" else self.refuting
            inside, outside = min(one.mean - low, high - one.mean), max(low - one.mean, one.mean - high)
            away = inside if verdict == "holds" else outside
            found.append(t_tail(away / one.error, one.samples - 1) if one.error > 0 else 0.0)
        return max(found)


_VERB = {"holds": "holds", "in part": "holds in part", "does not hold": "does not", OPEN: "cannot be decided"}


def together(verdicts: Iterable[Verdict]) -> Verdict:
    """Return what several verdicts say of the whole: theirs where they agree, in part where one holds at least."""
    found = set(verdicts)
    return found.pop() if len(found) == 1 else "in part" if found & {"holds", "in part"} else OPEN


def counted(verdicts: Sequence[str], what: str) -> str:
    """Return in words how many of ``what`` have each verdict, such as "2 claims: 1 holds, 1 cannot be decided"."""
    named = ", ".join(f"{verdicts.count(v)} {_PLURAL.get(v, v)}" for v in dict.fromkeys((*VERDICTS, *verdicts))
                      if v in verdicts)  # fmt: skip
    return f"{len(verdicts)} {what}{'s' * (len(verdicts) != 1)}: {named}"


_PLURAL = {
    "holds": "held up",
    "in part": "held in part",
    "does not hold": "refuted",
    OPEN: "undecided by this design",
}


def holm(chances: Sequence[float], error: float = (1 - CONFIDENCE) / 2) -> list[bool]:
    """Return which of several decided claims stand when they are all to stand together (Holm's correction)."""
    order = np.argsort(chances, kind="stable")
    stands, found = True, [False] * len(chances)
    for place, which in enumerate(order):
        stands = stands and chances[which] <= error / (len(chances) - place)
        found[which] = stands
    return found
