"""Goals as people give them: degrees or counts, a joint after the other."""

import math
import re
import sys
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput

_ANGLE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))\s*(deg|°)?")
STANDARD_INPUT = "-"
"""The goal that stands for those on standard input, one a line."""


def read_goals(given: Iterable[str], spec: ArmSpec, goal_range: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Yield the goals (joints,) [counts] in ``given``; those on standard input as they come in.

    All that are given are checked before the first is yielded.

    Raises:
        UnusableInput: one is none, or lies outside ``goal_range`` (joints, 2) [counts].

    """
    texts = list(given)
    if not texts:
        raise UnusableInput("no goal: give one or more, such as 20deg or 650, or - for standard input, one a line")
    known = [None if text == STANDARD_INPUT else goal_of(text, spec, goal_range) for text in texts]

    def goals() -> Iterator[NDArray[np.float64]]:
        for goal in known:
            if goal is not None:
                yield goal
                continue
            for line in sys.stdin:
                if line.strip():
                    yield goal_of(line.strip(), spec, goal_range)

    return goals()


def goal_of(text: str, spec: ArmSpec, goal_range: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the goal (joints,) [counts] that ``text`` says: 20deg, 650 counts, or 20deg,-5deg for two joints.

    Raises:
        UnusableInput: it is none, or the arm has not been seen to reach it.

    """
    parts = text.split(",")
    if len(parts) != spec.joints:
        raise UnusableInput(f"goal {text!r}: expected {spec.joints} angle(s) with commas between, got {len(parts)}")
    goal = np.array([_angle(text, part, spec) for part in parts])
    for j, (low, high) in enumerate(goal_range):
        if not low <= goal[j] <= high:
            lowest, highest = spec.degrees([low, high])
            raise UnusableInput(
                f"goal {text!r}: joint {j + 1} has been seen to reach {lowest:.1f}deg to {highest:.1f}deg "
                f"({low:.0f} to {high:.0f} counts); choose an angle in between"
            )
    return goal


def _angle(text: str, part: str, spec: ArmSpec) -> float:
    found = _ANGLE.fullmatch(part.strip())
    if not found or not math.isfinite(float(found[1])):
        raise UnusableInput(f"goal {text!r}: expected an angle such as 20deg or -5deg, or 650 (counts), got {part!r}")
    value = float(found[1])
    return value if found[2] is None else sum(spec.angle_range) / 2 + value * spec.counts_per_degree
