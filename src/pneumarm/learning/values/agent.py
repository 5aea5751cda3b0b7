"""An agent that has learned values, its file, and the agent acting and learning step by step."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.agents import SimulationAgent
from pneumarm.learning.online.loop import Schedule
from pneumarm.learning.values.actor_critic import ActorCriticSettings
from pneumarm.learning.values.dynamic_programming import PlanSettings
from pneumarm.learning.values.learner import ValueLearner, begin_acting, learn_and_act, value_memory, weigh
from pneumarm.learning.values.loop import test_episodes
from pneumarm.learning.values.monte_carlo import MonteCarloSettings
from pneumarm.learning.values.policies import GREEDY
from pneumarm.learning.values.q_lambda import QSettings
from pneumarm.learning.values.sarsa import SarsaSettings
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.learning.values.td import TdSettings
from pneumarm.learning.values.weights import learner_of, weight_count
from pneumarm.random import random_state
from pneumarm.simulation.layout import layout_of
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, environment, episode
from pneumarm.task.movements import NOISE, Movements, movements
from pneumarm.task.tracker import scaled_goal

KIND = "pneumarm values"
SETTINGS: dict[str, type[ValueSettings]] = {
    "td": TdSettings,
    "monte-carlo": MonteCarloSettings,
    "sarsa-lambda": SarsaSettings,
    "q-lambda": QSettings,
    "actor-critic": ActorCriticSettings,
    "dynamic-programming": PlanSettings,
}
"""Settings by rule."""
_WEIGHTS = "learned"


@dataclass(frozen=True, repr=False)
class ValueAgent(SimulationAgent):
    """Values, the simulation that they were learned in, and how."""

    learned: NDArray[np.float32]
    """All weights, see :mod:`.weights`, shape (n,)."""
    settings: ValueSettings

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of all weights."""
        return self.learned.copy()

    def with_weights(self, weights: NDArray[np.float32]) -> Self:
        """Return the agent with other ``weights``, as of :meth:`weights`."""
        return replace(self, learned=weights)

    def actor(self) -> "ValueActor":
        """Return the agent acting step by step, greedily."""
        return ValueActor(self)

    def learner(self, learning_rate: float, seed: int = 0) -> "ValueActor":
        """Return the agent acting and learning step by step, exploring as at the end of its training."""
        return ValueActor(self, learning_rate, seed)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let the agent move greedily in ``simulation``."""
        learner = learner_of(self.simulation, self.settings, self.weights(), 0.0)
        return run_test(environment(simulation, begin, self.settings), learner, episodes, seed)

    def save(self, path: Path) -> None:
        """Write the agent to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        header, arrays = self.simulation.parts()
        settings = {"simulation": header, "settings": msgspec.to_builtins(self.settings)}
        write_arrays(path, KIND, settings, arrays | {_WEIGHTS: self.learned})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent in ``path``.

        Raises:
            UnusableInput: ``path`` is no such agent, is damaged, or does not fit together.

        """
        read, arrays = read_arrays(path, KIND)
        try:
            settings = msgspec.convert(read["settings"], SETTINGS[read["settings"]["rule"]])
            learned = arrays.pop(_WEIGHTS)
            simulation = Simulation.of_parts(read["simulation"], arrays)
        except (msgspec.ValidationError, UnusableInput, ValueError, KeyError, TypeError) as error:
            raise UnusableInput(f"{path}: is no usable agent ({error}); train it again") from error
        count = weight_count(simulation, settings)
        if learned.shape != (count,) or learned.dtype != np.float32:
            raise UnusableInput(
                f"{path}: expected {count} weights of type float32, got {learned.shape} of {learned.dtype}"
            )
        return cls(simulation, learned, settings)


def run_test(env: Environment, learner: ValueLearner, episodes: int, seed: tuple[int, ...]) -> Movements:
    """Test ``learner`` in ``env``, greedily; begin states and goals are drawn by ``seed``, and so is the noise."""
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one = episode(env, random_state((*seed, NOISE)))
    record = movements(episodes, one.goal.size)
    test_episodes(env, learner, one, value_memory(learner, one.state.x.size, 0), random_state(seed), record)
    return record


class ValueActor:
    """A :class:`ValueAgent` acting step by step, and learning if ``learning_rate`` is not 0.

    It is used as :class:`~pneumarm.learning.OnlineLearner` is. With a learning rate of 0 it is greedy.
    """

    def __init__(self, agent: ValueAgent, learning_rate: float = 0.0, seed: int = 0) -> None:
        if not 0 <= learning_rate < np.inf:
            raise UnusableInput(f"the learning rate must be 0 or more, got {learning_rate!r}")
        self._agent, self._layout, self._learned = agent, layout_of(agent.window), agent.weights()
        self._learner = learner_of(agent.simulation, agent.settings, self._learned, learning_rate)
        if not learning_rate:
            self._learner = self._learner._replace(policy=GREEDY)
        last = agent.settings.exploration
        self._schedule = Schedule(np.inf, float(last.epsilon), float(last.temperature), 0.0)
        self._memory = value_memory(self._learner, self._layout.size, agent.settings.cutoff)
        self._random = random_state(seed)
        self._x, self._next = np.zeros((2, self._layout.size), np.float32)
        self._x[self._layout.one] = 1

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        goal = np.asarray(goal, np.float64).reshape(self._agent.window.joints)
        self._x[self._layout.goal : self._layout.one] = scaled_goal(goal, self._agent.scaling)
        self._memory.next_chosen[:] = -1
        self.follow(state)

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next one."""
        if self._memory.next_chosen[0] < 0:
            raise PneumarmError("begin an episode before acting")
        return self._memory.next_chosen.copy()

    def values(self) -> NDArray[np.float32]:
        """Return what each action is worth in the current state, or an actor's preferences, shape (joints, 9)."""
        found = np.zeros((self._agent.window.joints, self._memory.values.size), np.float32)
        for joint, row in enumerate(found):
            weigh(self._learner, joint, self._x, self._memory.chosen, self._memory.z, row)
        return found

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state``, to which the actions of :meth:`act` led, without learning from it."""
        self._x[: self._layout.command] = self._checked(next_state)
        begin_acting(self._learner, self._schedule, self._x, self._memory, self._random)

    def observe(self, reward: ArrayLike, next_state: ArrayLike, terminal: bool) -> None:
        """Learn from what the actions of :meth:`act` led to.

        ``reward`` is a number or one a joint (joints,), ``next_state`` (state_size,) scaled, and ``terminal`` says
        whether the goals are reached: the value of a terminal state is 0, a cut-off is not terminal.
        """
        self.act()
        paid = np.broadcast_to(np.asarray(reward, np.float64), self._memory.paid.shape).copy()
        self._next[:] = self._x
        self._next[: self._layout.command] = self._checked(next_state)
        seen = paid, self._next
        learn_and_act(self._learner, self._schedule, self._x, self._memory, self._random, seen, bool(terminal))

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the weights as they are now."""
        return self._learned.copy()

    @property
    def agent(self) -> ValueAgent:
        """The agent with the weights as they are now."""
        return self._agent.with_weights(self.weights())

    def get_state(self) -> bytes:
        """Return everything that the future depends on, besides what the learner was made with."""
        return zlib.compress(b"".join(array.tobytes() for array in self._arrays()), 1)

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit.

        Raises:
            UnusableInput: it is none, or one of a learner of another kind.

        """
        arrays = list(self._arrays())
        try:
            saved = zlib.decompress(state)
        except zlib.error as error:
            raise UnusableInput(f"expected the state of a learner like this one, got another ({error})") from error
        if len(saved) != sum(array.nbytes for array in arrays):
            raise UnusableInput("expected the state of a learner like this one, got one of another size")
        begin = 0
        for array in arrays:
            array[...] = np.frombuffer(saved, array.dtype, array.size, begin).reshape(array.shape)
            begin += array.nbytes

    def _arrays(self) -> Iterator[NDArray[Any]]:
        yield from (self._learned, self._random, self._x)
        for function in (self._learner.values, self._learner.actor):
            yield from (function.traces, function.listed, function.entries, function.traced)
        memory = self._memory
        yield from (memory.last, memory.chosen, memory.next_chosen, memory.next_values, memory.cut, *memory.path)

    def _checked(self, state: ArrayLike) -> NDArray[np.float32]:
        checked = np.asarray(state, np.float32)
        if checked.shape != (self._layout.command,):
            raise PneumarmError(f"a state must have the shape ({self._layout.command},), got {checked.shape}")
        return checked
