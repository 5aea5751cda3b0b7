"""A movement on an arm counted action by action, as compiled loops count one in simulation."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import Command
from pneumarm.task.reward import paid
from pneumarm.task.settings import TaskSettings


class Tally:
    """Actions, switches and reward of a movement of the arm that ``spec`` tells of, as ``task`` counts them.

    What counts are the valves as applied, whatever was asked for.
    """

    def __init__(self, task: TaskSettings, spec: ArmSpec) -> None:
        self.task, self._reward = task, task.reward.on(spec)
        self.actions = 0
        self.switches = np.zeros(spec.joints, np.int64)
        """Shape (joints,)."""
        self.reward = 0.0
        """Sum of what was paid, all joints together."""
        self.paid = 0.0
        """What was paid for the last action, all joints together."""
        self.reached = False
        """Whether the last action has reached the goal."""
        self._last: Command | None = None

    @property
    def over(self) -> bool:
        """Whether the movement has ended: its goal is reached, or it is cut off."""
        return self.reached or self.actions >= self.task.cutoff

    def count(self, applied: Command, angle: ArrayLike, velocity: ArrayLike, goal: ArrayLike) -> NDArray[np.float64]:
        """Count an action and return what each joint is paid for it (joints,).

        Args:
            applied: its valves, or pulses, shape (joints, 2).
            angle: after it, shape (joints,) [counts].
            velocity: after it, shape (joints,) [counts/ms].
            goal: at that time, shape (joints,) [counts].

        """
        reward = self._reward
        # As task/reward.py::is_switch, which knows actions: an arm may be given pulses as well.
        switched = (applied != (applied if self._last is None else self._last)).any(axis=1)
        self._last = applied
        self.actions += 1
        self.switches += switched
        self.reached = reward.reached(angle, velocity, goal)
        self.paid = float(paid.py_func(reward, self.reached, int(switched.sum())))
        self.reward += self.paid
        return reward.of(self.reached, switched)
