"""A policy that acts step by step, from Python: on a real arm, or wherever the environment is not ours."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import ACTIONS, CLOSED, VALVES
from pneumarm.errors import PneumarmError
from pneumarm.kernels import kernel
from pneumarm.learning.policy.acting import Mind, decide, lanes
from pneumarm.learning.policy.courses import Courses
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.random import random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.fleet import look, note_still
from pneumarm.task.reward import is_switch

_EMPTY = 0.03  # of the range of pressures: a muscle with less has nothing to let out
_IDLE = 0.35  # s in which valves do nothing, after which that does not go on
_FEWEST = 2 * ACTIONS  # simulated arms: some for each of what may be done
_HURRIES = 2  # times that looking ahead is made faster, at most: turns may be late for other reasons


class PolicyActor:
    """A policy acting greedily, looking ahead where its settings say so; see :class:`~.OnlineLearner` for its use.

    It does not learn. A joint that passes its goal again and again is one that its policy keeps swinging: its valves
    stay closed until it has come to rest, and it goes on from there. A joint that is off its goal while its policy
    has long been venting empty muscles, of which the simulation knows least, is vented no longer: noise hides from
    the policy that this changes nothing. Several joints may do what a plan says, see :mod:`.courses`.
    """

    def __init__(self, mind: Mind, sizes: tuple[int, ...], settings: PolicySettings, simulation: Simulation) -> None:
        self._mind, self._sizes, self._horizon, self._clear = mind, sizes, settings.horizon, settings.clear
        self._most_passes, self._rest = settings.passes, round(settings.rest / simulation.spec.period)
        window, scaling = simulation.window, simulation.scaling
        offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
        lowest, highest = np.moveaxis(simulation.pressure_range, -1, 0)
        self._empty = (lowest + _EMPTY * (highest - lowest) - offset[:, 2:]) / scale[:, 2:]
        self._longest_idle = round(_IDLE / simulation.spec.period)
        self._single = lanes(mind, sizes, random_states(0, 1))
        self._look_ahead_in(settings.lookahead)
        several = window.joints > 1 and settings.lookahead > 0 and settings.nodes > 0
        self._courses = Courses(simulation, settings) if several else None
        self._hurries_left = _HURRIES
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
        self._idle = np.zeros(goal.size, int)
        self._mind.limits.outlet[...] = -np.inf
        self._decided = False
        if self._courses is not None:
            self._courses.begin(goal)

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next state."""
        single = self._single
        if not self._decided:
            decide(self._mind, single, self._lanes, self._samples, self._horizon, self._clear)
            if self._courses is not None:
                self._courses.improve(self._mind, single, self._lanes, self._samples)
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
        self._note_idle()
        self._decided = False

    def hurry(self) -> None:
        """Decide in about half the time from now on, down to a quarter; for one joint it takes a millisecond."""
        if self._courses is not None and self._hurries_left:
            self._hurries_left -= 1
            self._courses.hurry()
            self._look_ahead_in(max(len(self._samples) // 2, min(len(self._samples), _FEWEST)))

    def _look_ahead_in(self, arms: int) -> None:
        """Make room for so many simulated ``arms``, in which it looks ahead."""
        self._lanes = lanes(self._mind, self._sizes, np.zeros((arms, 4), np.uint64))
        self._samples = np.zeros(arms, np.int64)

    def _note_passes(self) -> None:
        """Count the passes of each joint, and let one that swings rest."""
        side = self._sides()
        self._resting = np.maximum(self._resting - 1, 0)
        self._passes = np.where(self._resting > 0, 0, self._passes + (side * self._side < 0))
        self._side = np.where(side == 0, self._side, side)
        if self._most_passes:
            self._resting[self._passes >= self._most_passes] = self._rest

    def _note_idle(self) -> None:
        """Count for how long the valves of each joint off its goal do nothing; after long that is ruled out."""
        pressure = self._single.fleet.x[: 4 * self._idle.size, 0].reshape(-1, 4)[:, 2:]
        valves = VALVES[self._single.actions[0]]
        works = ((valves > 0) | ((valves < 0) & (pressure >= self._empty))).any(axis=1)
        self._idle = np.where(works | (self._sides() == 0), 0, self._idle + 1)
        is_idle = self._idle >= self._longest_idle
        self._mind.limits.outlet[...] = np.where(is_idle[:, None], self._empty, -np.inf)

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
    note_still(mind.limits, arm.x[:, 0], arm.before[0], arm.switched[0], arm.still[0])
