"""Rows whose readings no sound sensor gives: marked when they are stored, so that nothing is learned from them.

What is behind them, a loose wire, a sensor that is broken or one that wraps, is not told apart here.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.transitions.rows import Mark, Recorded

_PRESSURES = -0.2, 2.0
"""Of ``max_pressure``, beyond which single readings of a closed muscle are none: sensors drift about 0, and a joint
that moves compresses closed muscles, by a tenth or two."""
_LEAP = 0.8
"""Of the range of the angle; in a period virtual arms move by a sixth of it at most."""
_ACTED = 0.1
"""Of the times in which a muscle is filled and emptied: after so much of both no sound pressure is still the same. On
virtual arms equal readings span less than half as much."""
_OUTSIDE, _ONE = "reads outside the range of the sensor", "reads one constant while valves act"

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]


def with_doubtful_marked(recorded: Recorded, spec: ArmSpec, valves: bool) -> Recorded:
    """Return a sequence with marks on its doubtful rows; ``valves`` says whether its commands are those of valves."""
    found = [mark for mark in _doubtful(recorded, spec, valves) if mark not in recorded.marks]
    return replace(recorded, marks=(*recorded.marks, *found)) if found else recorded


def _doubtful(one: Recorded, spec: ArmSpec, valves: bool) -> Iterator[Mark]:
    for j in range(spec.joints):
        angle, muscles = one.angle[:, j], range(spec.muscles)
        acts = [_acts(one, j, m, spec, valves) for m in muscles]
        name = "the angle" + (f" of joint {j + 1}" if spec.joints > 1 else "")
        low, high = spec.angle_range
        outside = (angle < low) | (angle > high)
        leaps = (np.abs(np.diff(angle)) > _LEAP * (high - low)) & (np.diff(one.step) == 1)
        leaps &= ~(outside[1:] | outside[:-1])
        outside |= np.append(leaps, False) | np.insert(leaps, 0, False)
        yield from _marks(one, outside, f"{name} {_OUTSIDE}, or leaps across it")
        difference = one.pressure[:, j, 0] - one.pressure[:, j, 1] if spec.muscles > 1 else None
        yield from _marks(one, _constant(angle, acts, difference), f"{name} {_ONE}")
        for m in muscles if spec.pressure_sensors else ():
            pressure = one.pressure[:, j, m]
            name = f"pressure {m + 1}" + (f" of joint {j + 1}" if spec.joints > 1 else "")
            low, high = (share * spec.max_pressure_counts for share in _PRESSURES)
            # A sensor towards the valve reads the supply while the inlet is open; what lasts may be a wrong limit.
            opened = np.insert(one.command[:-1, j, m] > 0, 0, True) if valves else np.zeros(len(one), np.bool_)
            outside = (pressure < low) | ((pressure > high) & ~opened)
            around = np.convolve(outside, [1, 0, 1])[1:-1] > 0
            outside &= ~around
            yield from _marks(one, outside, f"{name} {_OUTSIDE}")
            yield from _marks(one, _constant(pressure, [acts[m]]), f"{name} {_ONE}")


def _acts(one: Recorded, joint: int, muscle: int, spec: ArmSpec, valves: bool) -> _Floats:
    """Return for how many times a muscle has been filled and emptied up to each row, shape (n, 2).

    Continuous commands, of whatever unit, count a little: as inlets above the middle of all, as outlets below it.
    """
    command = np.nan_to_num(one.command[:, joint, muscle])
    if not valves:
        command = _ACTED * np.sign(command - (command[:-1].max() + command[:-1].min()) / 2)
    passed = np.diff(one.time, append=one.time[-1])
    each = np.stack([np.maximum(command, 0), np.maximum(-command, 0)], axis=1) * passed[:, None] / spec.fill_times
    return np.cumsum(np.insert(each[:-1], 0, 0.0, axis=0), axis=0)


def _constant(values: _Floats, acts: list[_Floats], difference: _Floats | None = None) -> _Flags:
    """Return the rows (n,) of stretches of equal values, in which all muscles were filled and emptied.

    Where a ``difference`` of pressures is given, each muscle of the two was the fuller one, too: a joint that is
    pushed against its end stop stands still.
    """
    first = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    last = np.append(first[1:], len(values)) - 1
    found = np.all([(one[last] - one[first] >= _ACTED).all(axis=1) for one in acts], axis=0)
    if difference is not None:
        found &= (np.minimum.reduceat(difference, first) < 0) & (np.maximum.reduceat(difference, first) > 0)
    return np.repeat(found, last - first + 1)


def _marks(one: Recorded, found: _Flags, reason: str) -> Iterator[Mark]:
    edges = np.flatnonzero(np.diff(found, prepend=False, append=False))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        yield Mark(int(one.step[begin]), int(one.step[end - 1]), reason)
