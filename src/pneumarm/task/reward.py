"""When a goal is reached, and what is paid for an action (thesis sections 4.2.1, 5.1 and 5.4.1)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.settings import Settings, Valid


@dataclass(frozen=True)
class Reward(Settings):
    """When a goal is reached (thesis eq. 5.1, 5.2) and what is paid for an action (eq. 4.2, section 5.4.1)."""

    goal: float = 50.0
    """Paid to the action that reaches the goal, instead of ``action`` (thesis: 50)."""
    action: float = -1.0
    """Paid to every other action (thesis: -1)."""
    switch: float = -8.0
    """Paid besides, to an action that differs from the one before it in the episode (thesis: -8)."""
    angle_tolerance: float = 25.0
    """Largest distance from the goal at which it counts as reached [counts] (thesis: 25)."""
    velocity_tolerance: float = 1.0
    """Highest speed at which it counts as reached [counts/ms] (thesis: 1)."""

    def _valid(self) -> Valid:
        return {
            "goal": math.isfinite(self.goal),
            "action": math.isfinite(self.action),
            "switch": math.isfinite(self.switch),
            "angle_tolerance": 0 < self.angle_tolerance < math.inf,
            "velocity_tolerance": 0 < self.velocity_tolerance < math.inf,
        }

    def reached(self, angle: ArrayLike, velocity: ArrayLike, goal: ArrayLike) -> bool:
        """Return whether all joints are at their goals; all arguments (joints,) in [counts], [counts/ms]."""
        distance = np.abs(np.asarray(angle, np.float64) - np.asarray(goal, np.float64))
        slow = np.abs(np.asarray(velocity, np.float64)) <= self.velocity_tolerance
        return bool((distance <= self.angle_tolerance).all() and slow.all())

    def of(self, reached: bool, switched: ArrayLike) -> NDArray[np.float64]:
        """Return what each joint is paid for an action (joints,), ``switched`` being whether it was a switch."""
        return (self.goal if reached else self.action) + self.switch * np.asarray(switched, np.float64)
