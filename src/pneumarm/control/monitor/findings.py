"""What a monitor finds, and the rows that it marks."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.transitions.rows import Mark

DISAGREEMENTS = ("changed", "sensor-noise", "worn-potentiometer")
"""Kinds of findings with which readings no longer agree with the simulation, so that it proves less of valves; from
the least to the most special."""
CHANGES = (*DISAGREEMENTS, "leak")
"""Kinds of findings with which valves do as they are told: what is read is what arm and sensors are like now."""
Key = tuple[str, str, int | None, int | None]
"""Kind, detail, joint and muscle of a finding."""


@dataclass(frozen=True)
class Finding:
    """Something that is wrong with an arm."""

    kind: str
    """As the faults of a virtual arm are called; ``low-supply``; ``torn-hose``, a leak with which no muscle can be
    held; ``changed`` where readings no longer agree with the simulation, and neither noise of a sensor nor a worn
    potentiometer is the reason."""
    detail: str
    """What it is in words."""
    joint: int | None
    """Joint from 1; None where it is about the whole arm."""
    muscle: int | None
    """Muscle 1 or 2; None where it is about the joint or the whole arm."""
    since: float
    """When it began, as far as can be told [s]."""
    noticed: float
    """When it was found [s]."""
    until: float | None = None
    """When it was over [s]; None while it is not."""

    @property
    def spoils(self) -> bool:
        """Whether nothing may be learned from what was read meanwhile.

        An arm that has changed, or leaks, is still an arm: what it does then is what there is to learn.
        """
        return self.kind not in CHANGES

    def __str__(self) -> str:
        place = "" if self.joint is None else f"joint {self.joint}"
        place += "" if self.muscle is None else f", muscle {self.muscle}"
        ended = "" if self.until is None else f" until {self.until:.1f} s"
        kind = self.kind.replace("-", " ")
        return f"{kind}{': ' + place if place else ''} ({self.detail}) since {self.since:.1f} s{ended}"

    def overlaps(self, begin: float, end: float) -> bool:
        """Whether it was there at some time from ``begin`` to ``end`` [s]."""
        return self.since <= end and (self.until is None or self.until >= begin)


def marks_of(findings: Iterable[Finding], time: NDArray[np.float64], step: NDArray[np.int64]) -> tuple[Mark, ...]:
    """Return the marks that ``findings`` make on a sequence with readings at ``time`` (n,) [s] and ``step`` (n,)."""
    marks = []
    for one in findings:
        if one.spoils and one.overlaps(float(time[0]), float(time[-1])):
            inside = np.flatnonzero((time >= one.since) & (time <= (math.inf if one.until is None else one.until)))
            if len(inside):
                marks.append(Mark(int(step[inside[0]]), int(step[inside[-1]]), str(replace(one, until=None))))
    return tuple(marks)
