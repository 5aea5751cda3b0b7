"""An evolved network and its file, and the network acting step by step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.learning.evolution.acting import (
    arms_of,
    begin_movement,
    begin_together,
    choose_once,
    input_count,
    move_together,
    put_state,
    world,
)
from pneumarm.learning.evolution.settings import EvolutionSettings
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.random import random_state, random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.movements import NOISE, Movements, movements

KIND = "pneumarm.learning.evolution:ESP"
_TOGETHER = 256


@dataclass(frozen=True, repr=False)
class EvolvedAgent(NetworkAgent):
    """A recurrent network, the simulation that it was evolved in, and how."""

    kind = KIND
    settings_type = EvolutionSettings

    settings: EvolutionSettings

    @property
    def sizes(self) -> tuple[int, ...]:
        """Inputs and units of the network."""
        return input_count(self.window, self.settings), self.settings.hidden

    @property
    def size(self) -> int:
        """Number of its weights."""
        inputs, units = self.sizes
        return units * (inputs + units)

    @property
    def network(self) -> NDArray[np.float32]:
        """The network, shape (units, inputs + units), see :mod:`.recurrent`."""
        return self.policy.reshape(self.settings.hidden, -1)

    def actor(self) -> "EvolvedActor":
        """Return it acting; it does not learn while it moves an arm."""
        return EvolvedActor(self)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let it move in ``simulation``."""
        if episodes < 1:
            raise UnusableInput(f"a test needs at least one episode, got {episodes}")
        there, random = world(simulation, begin, self.settings), random_state(seed)
        arms = arms_of(there, 1, self.settings.hidden, min(episodes, _TOGETHER))
        arms.fleet.random[:] = random_states((*seed, NOISE), len(arms.alive))
        record = movements(episodes, simulation.window.joints)
        for first in range(0, episodes, _TOGETHER):
            count = min(_TOGETHER, episodes - first)
            begin_together(there, arms, random, record, first, count)
            move_together(there, self.network, arms, record, first, count)
        return record


class EvolvedActor:
    """An evolved network acting, see :class:`~pneumarm.learning.OnlineLearner` for its use; it does not learn."""

    def __init__(self, agent: EvolvedAgent) -> None:
        self._world, self._network = world(agent.simulation, None, agent.settings), agent.network
        self._arms = arms_of(self._world, 1, agent.settings.hidden, 1)
        self._size, self._joints = agent.window.state_size, agent.window.joints
        self._chosen: NDArray[np.int64] | None = None

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        begin_movement(
            self._world, self._arms, self._checked(state), np.array(goal, np.float64).reshape(self._joints)
        )
        self._choose()

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next state."""
        if self._chosen is None:
            raise PneumarmError("begin an episode before acting")
        return self._chosen.copy()

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in the scaled ``next_state`` (state_size,), to which the actions of :meth:`act` led."""
        self.act()
        put_state(self._arms, self._checked(next_state))
        self._choose()

    def _choose(self) -> None:
        choose_once(self._world, self._network, self._arms)
        self._chosen = self._arms.actions[0]

    def _checked(self, state: ArrayLike) -> NDArray[np.float32]:
        checked = np.asarray(state, np.float32)
        if checked.shape != (self._size,):
            raise PneumarmError(f"a state must have the shape ({self._size},), got {checked.shape}")
        return checked
