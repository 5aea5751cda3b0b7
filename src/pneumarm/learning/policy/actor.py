"""A policy that acts step by step, from Python: on a real arm, or wherever the environment is not ours."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.errors import PneumarmError
from pneumarm.learning.policy.acting import Mind, decide_ahead, lanes
from pneumarm.learning.policy.courses import Courses
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.learning.policy.vain import begin, follow, take_up, vain
from pneumarm.random import random_states
from pneumarm.simulation.simulation import Simulation

_FEWEST = 2 * ACTIONS  # simulated arms: some for each of what may be done
_HURRIES = 2  # times that looking ahead is made faster, at most: turns may be late for other reasons


class PolicyActor:
    """A policy acting greedily, looking ahead where its settings say so; see :class:`~.OnlineLearner` for its use.

    It does not learn. What it does in vain it stops doing, see :mod:`.vain`; several joints do what a plan says where
    there is a good one, see :mod:`.courses`.
    """

    def __init__(self, mind: Mind, sizes: tuple[int, ...], settings: PolicySettings, simulation: Simulation) -> None:
        self._mind, self._sizes, self._horizon, self._clear = mind, sizes, settings.horizon, settings.clear
        self._vain = vain(simulation, settings)
        self._single = lanes(mind, sizes, random_states(0, 1))
        self._look_ahead_in(settings.lookahead)
        several = simulation.window.joints > 1 and settings.lookahead > 0 and settings.nodes > 0
        self._courses = Courses(simulation, settings) if several else None
        self._hurries_left = _HURRIES
        self._decided = False
        self._state_size = mind.inputs.layout.command

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        goal = np.array(goal, np.float64).reshape(self._vain.side.size)
        begin(self._mind, self._single, self._vain, self._checked(state), goal)
        self._decided = False
        if self._courses is not None:
            self._courses.begin(goal)

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next state."""
        single = self._single
        if not self._decided:
            if self._courses is None or not self._courses.plan(self._mind, single):
                decide_ahead(self._mind, single, self._lanes, self._samples, self._horizon, self._clear)
                if self._courses is not None:
                    self._courses.improve(self._mind, single, self._lanes, self._samples)
            take_up(single, self._vain)
            self._decided = True
        return single.actions[0].copy()

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in the scaled ``next_state`` (state_size,), to which the actions of :meth:`act` led."""
        if not self._decided:
            raise PneumarmError("begin an episode and act before going on")
        follow(self._mind, self._single, self._vain, self._checked(next_state))
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

    def _checked(self, state: ArrayLike) -> NDArray[np.float32]:
        checked = np.asarray(state, np.float32)
        if checked.shape != (self._state_size,):
            raise PneumarmError(f"a state must have the shape ({self._state_size},), got {checked.shape}")
        return checked
