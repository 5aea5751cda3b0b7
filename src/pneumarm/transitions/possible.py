"""What rows can be: checked before they are stored, and again when they are read."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.transitions.database import LONGEST_SEQUENCE
from pneumarm.transitions.rows import Recorded, Rows, values_of

_BEYOND = 10  # highest pressures of a muscle that no supply has


def are_possible(rows: Rows, first: NDArray[np.int64], spec: ArmSpec, valves: bool) -> bool:
    """Return whether the rows of whole sequences that begin at the rows ``first`` are possible."""
    begins = np.zeros(len(rows), bool)
    begins[first] = True
    ends = np.append(begins[1:], True)
    rising = begins[1:] | ((np.diff(rows.step) > 0) & (np.diff(rows.time) > 0))
    return bool(
        (rows.step[first] == 0).all()
        and rising.all()
        and np.isfinite(rows.time).all()
        and far_outside(rows.angle, rows.pressure, spec) is None
        and np.isnan(rows.command[ends]).all()
        and _wrong_commands(rows.command[~ends], spec, valves) is None
        and all(np.isfinite(values).all() for values in rows.measured.values())
    )


def _wrong_commands(command: NDArray[np.float64], spec: ArmSpec, valves: bool) -> str | None:
    """Return what commands would have to be where those of this arm cannot have been these."""
    if not valves:
        return None if np.isfinite(command).all() else "finite"
    whole = (command == 0) | (np.abs(command) == 1)
    if not spec.pulses:
        return None if whole.all() else "-1, 0 or +1"
    return None if (whole | (np.abs(command) < 1)).all() else "valves (-1, 0 or +1) or pulses in between"


def far_outside(angle: NDArray[np.float64], pressure: NDArray[np.float64], spec: ArmSpec) -> str | None:
    """Return what is wrong with angles and pressures [counts] that no sensor of this arm can have given.

    Generous, because sensors do go past their nominal ranges, by half a range of the angle, and because a pressure
    sensor towards the valve reads the supply while the inlet is open. What it catches is a wrong unit.
    """
    low, high = spec.angle_range
    margin = (high - low) / 2
    limit = _BEYOND * spec.max_pressure_counts
    # Written so that NaN counts as outside.
    if not ((angle >= low - margin) & (angle <= high + margin)).all():
        return f"an angle is far outside {low:g}..{high:g} counts or no number"
    if not ((pressure >= -limit) & (pressure <= limit)).all():
        return f"a pressure is over ten times the limit of {spec.max_pressure_counts:g} counts or no number"
    return None


def row_values(one: Recorded, spec: ArmSpec, further: Sequence[str], valves: bool) -> NDArray[np.float64]:
    """Return the rows (n, columns) of a sequence, checked; what ``further`` does not name is left out."""
    n, joints = len(one), spec.joints
    shapes = {"angle": (n, joints), "pressure": (n, joints, 2), "command": (n, joints, 2), "step": (n,)}
    for name, shape in shapes.items():
        if getattr(one, name).shape != shape:
            raise UnusableInput(f"a sequence's {name} must have shape {shape}, got {getattr(one, name).shape}")
    if not 2 <= n <= LONGEST_SEQUENCE:
        raise UnusableInput(f"a sequence must have 2 to {LONGEST_SEQUENCE} rows, this has {n}; cut it")
    if one.step[0] != 0 or not (np.diff(one.step) > 0).all():
        raise UnusableInput("a sequence's steps must begin at 0 and rise")
    if not (math.isfinite(one.time[0]) and (np.diff(one.time) > 0).all() and math.isfinite(one.time[-1])):
        raise UnusableInput("a sequence's times must be finite and rise")
    problem = far_outside(one.angle, one.pressure, spec)
    if problem:
        raise UnusableInput(f"{problem}; does the arm's spec have the right counts?")
    wanted = _wrong_commands(one.command[:-1], spec, valves)
    if wanted or not np.isnan(one.command[-1]).all():
        raise UnusableInput(f"a sequence's commands must be {wanted or 'NaN after the last reading'}")
    for name in further:
        said = one.measured.get(name)
        if said is None or said.shape != (n,) or not np.isfinite(said).all():
            raise UnusableInput(f"a sequence of this arm needs {n} finite readings of its sensor {name}")
    return values_of(one, further)
