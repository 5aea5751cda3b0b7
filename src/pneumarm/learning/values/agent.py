"""An agent that has learned values, its file, and the agent acting and learning step by step."""

import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self, cast

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.agents import SimulationAgent
from pneumarm.learning.online.agent import OnlineLearner
from pneumarm.learning.values.actor_critic import ActorCriticSettings
from pneumarm.learning.values.dynamic_programming import IterationSettings
from pneumarm.learning.values.learner import LearnedValues, begin_acting, learn_and_act, value_memory, weigh
from pneumarm.learning.values.loop import test_episodes
from pneumarm.learning.values.monte_carlo import MonteCarloSettings
from pneumarm.learning.values.policies import GREEDY
from pneumarm.learning.values.q_lambda import QSettings
from pneumarm.learning.values.sarsa import SarsaSettings
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.learning.values.td import TdSettings
from pneumarm.learning.values.weights import learner_of, weight_count
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, environment, episode
from pneumarm.task.movements import NOISE, Movements, movements
from pneumarm.transitions.goals import Goals

KIND = "pneumarm values"
SETTINGS: dict[str, type[ValueSettings]] = {
    "td": TdSettings,
    "monte-carlo": MonteCarloSettings,
    "sarsa-lambda": SarsaSettings,
    "q-lambda": QSettings,
    "actor-critic": ActorCriticSettings,
    "dynamic-programming": IterationSettings,
}
"""Settings by rule."""
_WEIGHTS = "learned"


@dataclass(frozen=True, repr=False)
class ValueAgent(SimulationAgent):
    """Values, the simulation that they were learned in, and how."""

    learned: NDArray[np.float32]
    """All weights, see :mod:`.weights`, shape (n,)."""
    settings: ValueSettings

    @property
    def goals(self) -> Goals:
        """Goals that it has learned."""
        return self.settings.goals_in(self.simulation)

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


def run_test(env: Environment, learner: LearnedValues, episodes: int, seed: tuple[int, ...]) -> Movements:
    """Test ``learner`` in ``env``, greedily; begin states and goals are drawn by ``seed``, and so is the noise."""
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one = episode(env, random_state((*seed, NOISE)))
    record = movements(episodes, one.goal.size)
    test_episodes(env, learner, one, value_memory(learner, one.state.x.size, 0), random_state(seed), record)
    return record


class ValueActor(OnlineLearner):
    """A :class:`ValueAgent` acting step by step, greedily, or learning if ``learning_rate`` is not 0."""

    _agent: Any
    """The :class:`ValueAgent`."""

    def __init__(self, agent: ValueAgent, learning_rate: float = 0.0, seed: int = 0) -> None:
        exploration = agent.settings.exploration if learning_rate else None
        super().__init__(cast("Any", agent), learning_rate, exploration, seed)

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        self._workspace.next_actions[:] = -1
        super().begin(state, goal)

    def values(self) -> NDArray[np.float32]:
        """Return what each action is worth in the current state, or an actor's preferences, shape (joints, 9)."""
        found = np.zeros((self._agent.window.joints, self._workspace.values.size), np.float32)
        for joint, row in enumerate(found):
            weigh(self._learner, joint, self._x, self._workspace.chosen, self._workspace.z, row)
        return found

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the weights as they are now."""
        return self._learned.copy()

    @property
    def agent(self) -> ValueAgent:  # type: ignore[override]
        """The agent with the weights as they are now."""
        return self._agent.with_weights(self.weights())

    def get_state(self) -> bytes:
        """Return everything that the future depends on, besides what the learner was made with."""
        return zlib.compress(b"".join(array.tobytes() for array in self._arrays().values()), 1)

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit.

        Raises:
            UnusableInput: it is none, or one of a learner of another kind.

        """
        arrays, begin = self._arrays().values(), 0
        try:
            saved = zlib.decompress(state)
        except zlib.error as error:
            raise UnusableInput(f"expected the state of a learner like this one, got another ({error})") from error
        if len(saved) != sum(array.nbytes for array in arrays):
            raise UnusableInput("expected the state of a learner like this one, got one of another size")
        for array in arrays:
            array[...] = np.frombuffer(saved, array.dtype, array.size, begin).reshape(array.shape)
            begin += array.nbytes

    def _made(self) -> tuple[Any, Any]:
        settings, self._learned = self._agent.settings, self._agent.weights()
        made = learner_of(self._agent.simulation, settings, self._learned, self.learning_rate)
        made = made if self.learning_rate else made._replace(policy=GREEDY)
        return made, value_memory(made, self._x.size, settings.cutoff)

    def _begin_acting(self) -> None:
        begin_acting(self._learner, self.schedule, self._x, self._workspace, self._random)

    def _learn_and_act(self, seen: tuple[Any, ...], is_over: bool) -> None:
        paid, _, state = seen
        learn_and_act(self._learner, self.schedule, self._x, self._workspace, self._random, (paid, state), is_over)

    def _arrays(self) -> dict[str, NDArray[np.generic]]:
        memory = self._workspace
        found = {"learned": self._learned, "random": self._random, "x": self._x, **memory.path._asdict()}
        for name in ("last", "chosen", "next_actions", "next_values", "cut"):
            found[name] = getattr(memory, name)
        for kind, function in (("values", self._learner.values), ("actor", self._learner.actor)):
            for name in ("traces", "listed", "entries", "traced"):
                found[f"{kind} {name}"] = getattr(function, name)
        return found
