"""A policy that acts step by step, from Python: on a real arm, or wherever the environment is not ours."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import CLOSED
from pneumarm.errors import PneumarmError
from pneumarm.kernels import kernel
from pneumarm.learning.policy.acting import Mind, decide, lanes
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.random import random_states
from pneumarm.task.fleet import look, note_still
from pneumarm.task.reward import is_switch


class PolicyActor:
    """A policy acting greedily, looking ahead where its settings say so; see :class:`~.OnlineLearner` for its use.

    It does not learn. A joint that passes its goal again and again is one that its policy keeps swinging: its valves
    stay closed until it has come to rest, and it goes on from there.
    """

    def __init__(self, mind: Mind, sizes: tuple[int, ...], settings: PolicySettings, period: float) -> None:
        self._mind, self._horizon, self._clear = mind, settings.horizon, settings.clear
        self._most_passes, self._rest = settings.passes, round(settings.rest / period)
        self._single = lanes(mind, sizes, random_states(0, 1))
        self._lanes = lanes(mind, sizes, np.zeros((settings.lookahead, 4), np.uint64))
        self._samples = np.zeros(settings.lookahead, np.int64)
        self._decided = False
        self._state_size = mind.inputs.state_size

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        arm, task = self._single.fleet, self._mind.environment.task
        goal = np.asarray(goal, np.float64).reshape(arm.goal.shape[1])
        arm.goal[0] = goal
        arm.x[task.goal_place : task.goal_place + goal.size, 0] = (goal - task.unit[:, 0]) / task.unit[:, 1]
        arm.actions[...] = -1
        arm.still[...] = 0
        arm.x[: self._state_size, 0] = self._checked(state)
        self._side, self._passes, self._resting = self._sides(), np.zeros(goal.size, int), np.zeros(goal.size, int)
        self._decided = False

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next state."""
        single = self._single
        if not self._decided:
            decide(self._mind, single, self._lanes, self._samples, self._horizon, self._clear)
            single.actions[0, self._resting > 0] = CLOSED
            arm = single.fleet
            for joint, action in enumerate(single.actions[0]):
                arm.switched[0, joint] = is_switch.py_func(arm.actions[0, joint], action)
            arm.actions[...] = single.actions
            self._decided = True
        return single.actions[0].copy()

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in the scaled ``next_state`` (state_size,), to which the actions of :meth:`act` led."""
        if not self._decided:
            raise PneumarmError("begin an episode and act before going on")
        _follow(self._mind, self._single, self._checked(next_state))
        self._note_passes()
        self._decided = False

    def _note_passes(self) -> None:
        """Count the passes of each joint, and let one that swings rest."""
        side = self._sides()
        self._resting = np.maximum(self._resting - 1, 0)
        self._passes = np.where(self._resting > 0, 0, self._passes + (side * self._side < 0))
        self._side = np.where(side == 0, self._side, side)
        if self._most_passes:
            self._resting[self._passes >= self._most_passes] = self._rest

    def _sides(self) -> NDArray[np.int64]:
        """Return on which side of its goal each joint is, shape (joints,): -1, 1, or 0 within the tolerance."""
        x, limits = self._single.fleet.x[:, 0], self._mind.limits
        goal = limits.goal_place + np.arange(limits.tolerance.size)
        beyond = x[4 * np.arange(limits.tolerance.size)] - x[goal]
        return np.where(np.abs(beyond) > limits.tolerance, np.sign(beyond), 0).astype(np.int64)

    def _checked(self, state: ArrayLike) -> NDArray[np.float32]:
        checked = np.asarray(state, np.float32)
        if checked.shape != (self._state_size,):
            raise PneumarmError(f"a state must have the shape ({self._state_size},), got {checked.shape}")
        return checked


@kernel
def _follow(mind, single, state):  # type: ignore[no-untyped-def]
    arm = single.fleet
    look(arm.x[:, 0], arm.before[0])
    for i in range(state.shape[0]):
        arm.x[i, 0] = state[i]
    note_still(mind.limits, arm.x[:, 0], arm.before[0], arm.actions[0], arm.switched[0], arm.still[0])
