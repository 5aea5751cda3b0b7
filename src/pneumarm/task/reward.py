"""When a goal is reached, what a switch is, and what is paid for an action (thesis sections 4.2.1, 5.1 and 5.4.1).

The rules are the functions at the end of this module. Loops are compiled from them, and Python calls them as they
are: they take a :class:`Reward` or its :class:`RewardParameters` alike.
"""

from dataclasses import astuple, dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.kernels import part
from pneumarm.settings import PositiveFloat, Settings


class RewardParameters(NamedTuple):
    """A :class:`Reward` as kernels take it; the fields are the same."""

    goal: float
    action: float
    switch: float
    angle_tolerance: float
    velocity_tolerance: float


@dataclass(frozen=True)
class Reward(Settings):
    """When a goal is reached (thesis eq. 5.1, 5.2) and what is paid for an action (eq. 4.2, section 5.4.1)."""

    goal: float = 50.0
    """Paid to the action that reaches the goal, instead of ``action`` (thesis: 50)."""
    action: float = -1.0
    """Paid to every other action (thesis: -1)."""
    switch: float = -8.0
    """Paid besides, to an action that differs from the one before it in the episode (thesis: -8)."""
    angle_tolerance: PositiveFloat = 25.0
    """Largest distance from the goal at which it counts as reached [counts of the thesis' sensor, 11.378 a degree]
    (thesis: 25)."""
    velocity_tolerance: PositiveFloat = 1.0
    """Highest speed at which it counts as reached [such counts/ms] (thesis: 1)."""

    def on(self, spec: ArmSpec) -> Self:
        """Return the same reward with tolerances in counts of the arm's own sensor."""
        return replace(
            self,
            angle_tolerance=self.angle_tolerance * spec.angle_unit,
            velocity_tolerance=self.velocity_tolerance * spec.angle_unit,
        )

    @property
    def parameters(self) -> RewardParameters:
        """The same for kernels."""
        return RewardParameters(*map(float, astuple(self)))

    def reached(self, angle: ArrayLike, velocity: ArrayLike, goal: ArrayLike) -> bool:
        """Return whether all joints are at their goals; all arguments (joints,) in [counts], [counts/ms]."""
        joints = np.asarray(angle), np.asarray(velocity), np.asarray(goal)
        return bool(has_reached.py_func(self, *joints).all())

    def of(self, reached: bool, switched: ArrayLike) -> NDArray[np.float64]:
        """Return what each joint is paid for an action (joints,), ``switched`` being whether it was a switch."""
        each: NDArray[np.float64] = paid.py_func(self, reached, np.asarray(switched, np.float64))
        return each


@part(entry=True)
def has_reached(reward, angle, velocity, goal):  # type: ignore[no-untyped-def]
    """Return whether a joint has reached its ``goal``: it is near to it and slow (thesis eq. 5.1, 5.2).

    A movement has when all joints have at a reading after at least one action.
    """
    return (abs(angle - goal) <= reward.angle_tolerance) & (abs(velocity) <= reward.velocity_tolerance)


@part
def is_switch(before, action):  # type: ignore[no-untyped-def]
    """Return whether a joint's ``action`` is a switch after the one ``before`` it, -1 where it is the first."""
    return before >= 0 and before != action


@part(entry=True)
def paid(reward, reached, switched):  # type: ignore[no-untyped-def]
    """Return what is paid for an action; ``switched`` is whether a joint, or how many joints, switched."""
    return (reward.goal if reached else reward.action) + reward.switch * switched
