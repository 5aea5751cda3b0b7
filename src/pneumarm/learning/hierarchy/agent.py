"""A trained hierarchy and its file, which holds its simulation, too."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.agents import SimulationAgent
from pneumarm.learning.hierarchy.loop import begin_levels, go_on, hierarchy, level_memory, test_levels, upper_shape
from pneumarm.learning.hierarchy.settings import HierarchySettings
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.values import network_shapes, pack
from pneumarm.random import random_state
from pneumarm.simulation.layout import layout_of
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment, episode
from pneumarm.task.movements import NOISE, Movements, movements
from pneumarm.transitions.goals import Goals

KIND = "pneumarm.learning.hierarchy:HIERARCHY"
GREEDY = Schedule(np.inf, 0.0, 1.0, 0.0)
"""No exploration."""


@dataclass(frozen=True, repr=False)
class HierarchicalAgent(SimulationAgent):
    """Both levels, the simulation that they were trained in, and how."""

    upper: NDArray[np.float32]
    """Weights, see :func:`~.loop.upper_shape`."""
    lower: NDArray[np.float32]
    """Weights, see :class:`~pneumarm.learning.online.values.ActionValues`."""
    settings: HierarchySettings

    @property
    def goals(self) -> Goals:
        """Goals that it has learned."""
        return self.settings.goals_in(self.simulation)

    def actor(self) -> "HierarchicalActor":
        """Return it acting greedily; it does not learn while it moves an arm."""
        return HierarchicalActor(self)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let it move greedily in ``simulation``."""
        if episodes < 1:
            raise UnusableInput(f"a test needs at least one episode, got {episodes}")
        env = environment(simulation, begin, self.settings)
        one = episode(env, random_state((*seed, NOISE)))
        record = movements(episodes, one.goal.size)
        levels = hierarchy((self.upper, self.lower), self.spec, self.window, self.scaling, self.settings, 0.0)
        randoms = random_state(seed), random_state(0)
        test_levels(env, levels, GREEDY, one, level_memory(levels), randoms, record)
        return record

    def save(self, path: Path) -> None:
        """Write the agent to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        header, arrays = self.simulation.parts()
        settings = {"simulation": header, "settings": msgspec.to_builtins(self.settings)}
        write_arrays(path, KIND, settings, arrays | {"upper_agent": self.upper, "lower_agents": self.lower})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent in ``path``.

        Raises:
            UnusableInput: ``path`` is no such agent, is damaged, or does not fit together.

        """
        read, arrays = read_arrays(path, KIND)
        try:
            settings = msgspec.convert(read["settings"], HierarchySettings)
            upper, lower = arrays.pop("upper_agent"), arrays.pop("lower_agents")
            simulation = Simulation.of_parts(read["simulation"], arrays)
        except (msgspec.ValidationError, UnusableInput, ValueError, KeyError, TypeError) as error:
            raise UnusableInput(f"{path}: is no usable agent ({error}); train it again") from error
        window = simulation.window
        expected = upper_shape(window, settings), pack(network_shapes(window, settings.hidden), window).shape
        if (upper.shape, lower.shape) != expected or {upper.dtype, lower.dtype} != {np.dtype(np.float32)}:
            raise UnusableInput(
                f"{path}: expected weights of the shapes {expected} and type float32, got {upper.shape} and "
                f"{lower.shape} of {upper.dtype} and {lower.dtype}"
            )
        return cls(simulation, upper, lower, settings)


class HierarchicalActor:
    """A hierarchy acting greedily, see :class:`~pneumarm.learning.OnlineLearner` for its use; it does not learn."""

    def __init__(self, agent: HierarchicalAgent) -> None:
        window = agent.window
        self._levels = hierarchy((agent.upper, agent.lower), agent.spec, window, agent.scaling, agent.settings, 0.0)
        self._memory, self._random, self._size = level_memory(self._levels), random_state(0), window.state_size
        self._x = np.zeros(layout_of(window).size, np.float32)
        self._x[layout_of(window).one] = 1

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        self._x[: self._size] = self._checked(state)
        goal = np.asarray(goal, np.float64).reshape(len(self._levels.unit))
        begin_levels(self._levels, GREEDY, self._memory, self._x, goal, self._random)

    @property
    def subgoal(self) -> NDArray[np.float64]:
        """What joints are heading for, shape (joints,) [counts]."""
        return self._memory.aim.copy()

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next state."""
        if self._memory.low.next_actions[0] < 0:
            raise PneumarmError("begin an episode before acting")
        return self._memory.low.next_actions.copy()

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in the scaled ``next_state`` (state_size,), to which the actions of :meth:`act` led."""
        self.act()
        self._x[: self._size] = self._checked(next_state)
        go_on(self._levels, GREEDY, self._memory, self._x, self._random, False)

    def _checked(self, state: ArrayLike) -> NDArray[np.float32]:
        checked = np.asarray(state, np.float32)
        if checked.shape != (self._size,):
            raise PneumarmError(f"a state must have the shape ({self._size},), got {checked.shape}")
        return checked
