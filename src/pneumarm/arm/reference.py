"""A reference: where a joint is wanted to be at every moment. A constant goal is the simplest."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_HALF = 0.015
"""Time between the points that velocities and accelerations are derived from [s]."""


class ReferencePoint(NamedTuple):
    """What a reference asks for at a moment, each of shape (joints,)."""

    angle: NDArray[np.float64]
    """[counts]"""
    velocity: NDArray[np.float64]
    """[counts/s]"""
    acceleration: NDArray[np.float64]
    """[counts/s2]"""


@dataclass(frozen=True)
class Reference:
    """Angles wanted as a function of the time since the reference began."""

    at: Callable[[float], NDArray[np.float64]]
    """Gives the angles (joints,) [counts] at a time [s]."""
    smooth: bool = True
    """Whether it can be followed as it is; one that jumps cannot, and whoever follows it plans a way of its own."""
    known_ahead: bool = True
    """Whether a controller may look at times that have not come yet."""
    duration: float | None = None
    """When it ends [s]; None for one that goes on."""
    stays: bool = False
    """Whether it asks for the same at all times."""

    def point(self, time: float, ahead: float = 0.0) -> ReferencePoint:
        """Return what is asked for ``ahead`` [s] of ``time``, extrapolated where the future is not known."""
        if self.known_ahead:
            middle = time + ahead
            before, now, after = self.at(middle - _HALF), self.at(middle), self.at(middle + _HALF)
            return ReferencePoint(now, (after - before) / (2 * _HALF), (after - 2 * now + before) / _HALF**2)
        first, second, now = self.at(time - 2 * _HALF), self.at(time - _HALF), self.at(time)
        acceleration = (now - 2 * second + first) / _HALF**2
        velocity = (3 * now - 4 * second + first) / (2 * _HALF)
        angle = now + ahead * (velocity + ahead * acceleration / 2)
        return ReferencePoint(angle, velocity + ahead * acceleration, acceleration)


def constant(goal: ArrayLike) -> Reference:
    """Return the reference that stays at ``goal`` (joints,) [counts]; it is reached from elsewhere, so it jumps."""
    angles = np.array(goal, np.float64).reshape(-1)
    return Reference(lambda time: angles, smooth=False, stays=True)
