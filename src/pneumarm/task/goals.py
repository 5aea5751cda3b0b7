"""Goals as people give them: degrees from the middle of the range, or counts; a joint after the other."""

import math
import re

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.task.reference import counts_of

_ANGLE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))\s*(deg|°)?")


def goal_of(text: str, spec: ArmSpec, goal_range: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the goal (joints,) [counts] that ``text`` says: 20deg, 650 counts, or 20deg,-5deg for two joints.

    Raises:
        UnusableInput: it is none, or the arm has not been seen to reach it.

    """
    parts = text.split(",")
    if len(parts) != spec.joints:
        raise UnusableInput(f"goal {text!r}: expected {spec.joints} angle(s) with commas between, got {len(parts)}")
    goal = np.array([_angle(text, part, spec) for part in parts])
    return seen(goal, spec, goal_range, f"goal {text!r}")


def goal_in_counts(
    goal: ArrayLike | None, goal_deg: ArrayLike | None, spec: ArmSpec, goal_range: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the goal (joints,) [counts] that is given either as ``goal`` [counts] or as ``goal_deg`` [degrees].

    Raises:
        UnusableInput: none or both are given, it is no goal, or the arm has not been seen to reach it.

    """
    if (goal is None) == (goal_deg is None):
        raise UnusableInput("expected one goal: either in counts (goal=650) or in degrees (goal_deg=20)")
    given = goal if goal_deg is None else counts_of(goal_deg, spec)
    assert given is not None
    found = np.array(given, np.float64).reshape(-1)
    if found.shape != (spec.joints,) or not np.isfinite(found).all():
        raise UnusableInput(
            f"a goal needs {spec.joints} finite angle(s), got {goal if goal_deg is None else goal_deg}"
        )
    return seen(found, spec, goal_range, f"goal {', '.join(f'{one:g}' for one in found)} counts")


def seen(
    goal: NDArray[np.float64], spec: ArmSpec, goal_range: NDArray[np.float64], called: str
) -> NDArray[np.float64]:
    """Return ``goal`` (joints,) [counts], which lies in ``goal_range`` (joints, 2) [counts]; else UnusableInput.

    ``called`` is what the message begins with.
    """
    for j, (low, high) in enumerate(goal_range):
        if not low <= goal[j] <= high:
            lowest, highest = spec.degrees([low, high])
            raise UnusableInput(
                f"{called}: joint {j + 1} has been seen to reach {lowest:.1f}deg to {highest:.1f}deg "
                f"({low:.0f} to {high:.0f} counts); choose an angle in between"
            )
    return goal


def _angle(text: str, part: str, spec: ArmSpec) -> float:
    found = _ANGLE.fullmatch(part.strip())
    if not found or not math.isfinite(float(found[1])):
        raise UnusableInput(f"goal {text!r}: expected an angle such as 20deg or -5deg, or 650 (counts), got {part!r}")
    value = float(found[1])
    return value if found[2] is None else float(counts_of(value, spec))
