"""How long the muscles of an arm take to fill and to empty, found out before it is made to move about.

An arm with small valves that is inflated for as long as the thesis' is never seen at high pressures, nor at the
angles that need them. So all muscles are filled piece by piece first, and then emptied. Pressures are read after each
piece, with closed valves: while air flows, a sensor near the valve reads what drives it and not the muscle. Pieces
grow, so that an arm of any size takes a few seconds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.guard import GuardedArm

Levels = NDArray[np.float64]

_FIRST, _GROWTH = 0.1, 1.2  # length of the first piece [s] and of each over the one before
_LONGEST = 8.0  # s that a valve is open in all at most
_PAUSE = 0.2  # s in which hose and sensor follow
_OVER = 0.03  # share of the way so far; where a piece adds less, the end is reached
_WAY = 0.9  # share of the way whose time is told: the last of it takes an arm's supply forever


class FillTimes(NamedTuple):
    """Times in which all muscles of an arm go nine tenths of the way [s]."""

    filling: float
    """From empty up to the highest pressure, that of the limit or of the supply."""
    emptying: float
    """From there down to empty."""


_USUAL = FillTimes(0.9, 0.35)


def find_fill_times(arm: GuardedArm) -> FillTimes:
    """Fill and empty all muscles of ``arm`` and return how long each took; the arm is busy for 5 to 25 s.

    Where no pressure changes, those of an arm like the thesis' are returned: who watches the arm will tell.
    """
    arm.make_ready()
    _passage(arm, -1)
    filling, emptying = _passage(arm, 1), _passage(arm, -1)
    return FillTimes(filling, emptying) if filling and emptying else _USUAL


def _passage(arm: GuardedArm, valve: int) -> float:
    """Open all valves to one side until pressures change no more; return how long until the slowest muscle was there.

    That is 0 where none changed.
    """
    opened = np.full(arm.applied.shape, valve, np.int8)
    times, levels, piece = [0.0], [_level(arm)], _FIRST
    while times[-1] < _LONGEST:
        arm.set_valves(opened)
        arm.wait(piece)
        times.append(times[-1] + piece)
        levels.append(_level(arm))
        way = np.abs(levels[-1] - levels[0]).max()
        if np.abs(levels[-1] - levels[-2]).max() < _OVER * way:
            break
        piece *= _GROWTH
    gone = np.abs(np.array(levels) - levels[0])
    if not gone.any():
        return 0.0
    whole = gone[:, gone[-1] >= gone[-1].max() / 2].T  # one that hardly moves has a fault, which others find
    return float(max(np.interp(_WAY * one[-1], np.maximum.accumulate(one), times) for one in whole))


def _level(arm: GuardedArm) -> Levels:
    """Close all valves, wait, and return the pressures, flat [counts]."""
    arm.set_valves(np.zeros(arm.applied.shape, np.int8))
    arm.wait(_PAUSE)
    return arm.read().pressure.ravel()
