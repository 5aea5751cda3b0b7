"""Goals as people give them: degrees from the middle of the range, or counts, a joint after the other; or x and y."""

import math
import re
from reprlib import repr as shortened
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.task.hand_goals import angles_for
from pneumarm.task.reference import counts_of
from pneumarm.transitions.goals import Goals

_ANGLE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))\s*(deg|°)?")
_LENGTH = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))\s*(mm|cm|m)")
_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


class Goal(NamedTuple):
    """A goal, and how it was given."""

    angle: NDArray[np.float64]
    """Shape (joints,) [counts]."""
    xy: NDArray[np.float64] | None = None
    """Where the hand is to be, shape (2,) [m], see :mod:`pneumarm.arm.hand`; None where angles were given."""


def goal_of(text: str, spec: ArmSpec, goals: Goals | NDArray[np.float64], before: Goal | None = None) -> Goal:
    """Return the goal that ``text`` says: 20deg, 650 counts, 20deg,-5deg for two joints, or x and y 0.2m,-0.3m.

    Args:
        text: as on the command line.
        spec: of the arm.
        goals: that it has been seen to hold, or a range of them (joints, 2) [counts].
        before: the one before it. Where several angles bring the hand there, those nearest to it are taken, of a
            first goal those nearest to the middle.

    Raises:
        UnusableInput: it is none, or the arm has not been seen to reach it.

    """
    parts = [part.strip() for part in text.split(",")]
    lengths = [_LENGTH.fullmatch(part) for part in parts]
    if any(lengths):
        xy = [float(found[1]) * _METRES[found[2]] for found in lengths if found]
        if len(xy) != len(parts):
            raise UnusableInput(f"goal {text!r}: expected x and y, both with a unit, such as 0.20m,-0.30m")
        return goal_at(xy, spec, goals, before, f"goal {text!r}")
    if len(parts) != spec.joints:
        raise UnusableInput(
            f"goal {text!r}: expected {spec.joints} angle(s) with commas between, or x and y of the hand such as "
            f"0.20m,-0.30m, got {len(parts)}"
        )
    angle = np.array([_angle(text, part, spec) for part in parts])
    return Goal(seen(angle, spec, goals, _called(text, parts)))


def goal_at(
    xy: ArrayLike,
    spec: ArmSpec,
    goals: Goals | NDArray[np.float64],
    before: Goal | None = None,
    called: str = "goal",
) -> Goal:
    """Return the goal with the hand at ``xy`` (2,) [m]; see :func:`goal_of`. ``called`` is what messages begin with.

    Raises:
        UnusableInput: it is none, the arm's links are not known, or its hand has not been seen to reach it.

    """
    wanted = np.array(xy, np.float64).reshape(-1)
    if wanted.shape != (2,) or not np.isfinite(wanted).all():
        raise UnusableInput(f"{called}: expected x and y of the hand in metres, such as 0.20, -0.30; got {xy!r}")
    known = Goals.of(goals)
    near = known.middle if before is None else before.angle
    return Goal(angles_for(wanted, spec, known, near, called), wanted)


def goal_in_counts(
    goal: ArrayLike | None, goal_deg: ArrayLike | None, spec: ArmSpec, goals: Goals | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the goal (joints,) [counts] that is given either as ``goal`` [counts] or as ``goal_deg`` [degrees].

    Raises:
        UnusableInput: none or both are given, it is no goal, or the arm has not been seen to reach it.

    """
    if (goal is None) == (goal_deg is None):
        raise UnusableInput("expected one goal: either in counts (goal=650) or in degrees (goal_deg=20)")
    given = goal if goal_deg is None else goal_deg
    try:
        said = np.array(given).reshape(-1)
    except ValueError:  # lists of different lengths
        said = np.empty(0)
    if said.shape != (spec.joints,) or said.dtype.kind not in "iuf" or not np.isfinite(said).all():
        raise UnusableInput(f"a goal needs {spec.joints} finite angle(s), as numbers, got {shortened(given)}")
    unit = "counts (degrees are goal_deg, or goals_deg of move)" if goal_deg is None else "deg"
    found = said.astype(np.float64) if goal_deg is None else counts_of(said, spec)
    return seen(found, spec, goals, f"goal {', '.join(f'{one:g}' for one in said)} {unit}")


def seen(
    goal: NDArray[np.float64], spec: ArmSpec, goals: Goals | NDArray[np.float64], called: str
) -> NDArray[np.float64]:
    """Return ``goal`` (joints,) [counts], which is one of ``goals``, or in a range (joints, 2); else UnusableInput.

    ``called`` is what the message begins with.
    """
    known = Goals.of(goals)
    for j, (low, high) in enumerate(known.range):
        if not low <= goal[j] <= high:
            lowest, highest = spec.degrees([low, high])
            raise UnusableInput(
                f"{called}: goals of joint {j + 1} lie from {lowest:.1f}deg to {highest:.1f}deg ({low:.0f} to "
                f"{high:.0f} counts), where it was often enough to be known; choose an angle in between"
            )
    if not known.contain(goal):
        towards = spec.degrees(0.99 * known.within(goal) + 0.01 * known.middle)
        raise UnusableInput(
            f"{called}: each joint was there often enough to be known, but not all of them together; towards it they "
            f"reach {','.join(f'{one:.1f}deg' for one in towards)}"
        )
    return goal


def _called(text: str, parts: list[str]) -> str:
    """Return what messages call a goal: numbers without a unit are counts, but may have been meant as degrees."""
    if any(part.strip().endswith(("deg", "°")) for part in parts):
        return f"goal {text!r}"
    return f"goal {text!r} in counts (degrees are {','.join(f'{part.strip()}deg' for part in parts)})"


def _angle(text: str, part: str, spec: ArmSpec) -> float:
    found = _ANGLE.fullmatch(part.strip())
    if not found or not math.isfinite(float(found[1])):
        raise UnusableInput(f"goal {text!r}: expected an angle such as 20deg or -5deg, or 650 (counts), got {part!r}")
    value = float(found[1])
    return value if found[2] is None else float(counts_of(value, spec))
