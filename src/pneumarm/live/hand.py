"""References that a person's hand makes: a goal that is dragged, and a curve that is drawn."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.reference import Reference
from pneumarm.task.reference import minimum_jerk, through

LEAD_IN = 1.0
"""Time in which the arm moves from where it is to where a drawn curve begins [s]."""
MOST_POINTS = 600
"""Points of a drawn curve."""
LONGEST = 60.0
"""... and how long it may take [s]."""
_STEP = 0.04  # s between the points of a curve as it is followed
_WINDOW = 5  # of these, over which a curve is smoothed


class Dragged:
    """A goal that somebody moves about: a reference whose future nobody knows."""

    def __init__(self, goal: ArrayLike) -> None:
        self.goal: NDArray[np.float64] = np.array(goal, np.float64)
        """Wanted now, shape (joints,) [counts]; set it at any time."""

    @property
    def reference(self) -> Reference:
        """The goal as a reference; what is asked of its future is what is wanted now."""
        return Reference(lambda time: self.goal, smooth=False, known_ahead=False)


def curve_reference(time: Sequence[float], angle: ArrayLike, begin: ArrayLike) -> Reference:
    """Return the reference that moves from ``begin`` to a drawn curve, follows it, and stays at its end.

    Args:
        time: of the points, rising from 0, shape (n,) [s].
        angle: of the points, shape (n, joints) [counts].
        begin: where the arm is, shape (joints,) [counts].

    """
    start, angles = np.array(begin, np.float64), np.array(angle, np.float64)
    end = LEAD_IN + time[-1]
    grid = np.linspace(0.0, end, max(round(end / _STEP), 2) + 1)
    ways = np.array([minimum_jerk(now / LEAD_IN) for now in grid])[:, None]
    curve = np.stack([np.interp(grid - LEAD_IN, time, column) for column in angles.T], axis=1)
    return through(grid, _smoothed(start + ways * (curve - start)))


def _smoothed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``values`` (n, joints) without the trembling of a finger; both ends stay."""
    window = np.hanning(_WINDOW + 2)[1:-1]
    padded = np.pad(values, ((_WINDOW // 2, _WINDOW // 2), (0, 0)), mode="edge")
    return np.stack([np.convolve(column, window / window.sum(), "valid") for column in padded.T], axis=1)
