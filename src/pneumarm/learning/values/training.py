"""Training: episodes with the thesis' shaping (section 4.3.2), or rounds of dynamic programming."""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.training import ShapedLearner, apart
from pneumarm.learning.training import Learner, Training, identity_of, train_side_by_side
from pneumarm.learning.values.agent import ValueAgent, run_test
from pneumarm.learning.values.dynamic_programming import IterationSettings, note_states, part_of, sweep, transitions
from pneumarm.learning.values.learner import value_memory
from pneumarm.learning.values.loop import train_episodes
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.learning.values.weights import first_weights, learner_of
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, Episode, environment, episode
from pneumarm.task.movements import Movements

_TRAINING, _VALIDATION = 1, 2  # streams of random numbers
_MOST_SWEEPS = 1000


def train_values(
    simulation: Simulation, begin_states: BeginStates, settings: ValueSettings, seed: int = 0, **how: Any
) -> Training[ValueAgent]:
    """Train agents and return the best; ``how`` as of :func:`~pneumarm.learning.training.train_side_by_side`.

    Training of one ends as that of the thesis' agents does, see :func:`~.online.training.train_online`.
    """
    env = environment(simulation, begin_states, settings)

    def make(number: int) -> Learner[ValueAgent]:
        if isinstance(settings, IterationSettings):
            return ValueIteration(env, simulation, settings, seed)
        return ValueTrainee(env, simulation, settings, seed, number)

    return train_side_by_side(
        make, settings.agents, settings.validation_episodes, identity_of(env, settings, seed), **how
    )


class Tested:
    """How both kinds of learners are tested, and what comes of them."""

    _env: Environment
    _simulation: Simulation
    _settings: Any
    _seed: int
    _weights: NDArray[np.float32]

    def validate(self, episodes: int) -> Movements:
        """Return greedy movements."""
        learner = learner_of(self._simulation, self._settings, self._weights.copy(), 0.0)
        return run_test(self._env, learner, episodes, (self._seed, _VALIDATION))

    def agent(self) -> ValueAgent:
        """Return the agent as it is now."""
        return ValueAgent(self._simulation, self._weights.copy(), self._settings)


class ValueTrainee(Tested, ShapedLearner[ValueAgent, ValueSettings]):
    """Values of any rule, learned in episodes that begin ever farther from their goals."""

    def _drawn(self, random: np.random.Generator) -> NDArray[np.float32]:
        return first_weights(self._simulation, self._settings, random)

    def _run(self, schedule: Schedule, one: Episode, count: int) -> tuple[float, int, int]:
        rate = self._settings.learning_rate * self.rate_share
        learner = learner_of(self._simulation, self._settings, self._weights, rate)
        memory = apart(value_memory(learner, one.state.x.size, self._settings.cutoff))
        memory.retry.performance[:] = self._joints[1]
        found: tuple[float, int, int] = train_episodes(
            self._env, learner, schedule, one, memory, count, float(self._shaping[1])
        )
        self._joints[1] = memory.retry.performance
        return found


class ValueIteration(Tested, Learner[ValueAgent]):
    """Dynamic programming, round after round."""

    columns = ("episodes", "states", "cells", "sweeps", "change")

    def __init__(self, env: Environment, simulation: Simulation, settings: IterationSettings, seed: int) -> None:
        super().__init__()
        self._env, self._simulation, self._settings, self._seed = env, simulation, settings, seed
        self._weights = first_weights(simulation, settings, np.random.default_rng(0))
        self._random = random_state((seed, _TRAINING))
        self._counts = np.zeros(3, np.int64)
        """Rounds, episodes and states."""
        joints = simulation.window.joints
        choices = learner_of(simulation, settings, self._weights).possible.size
        self._noted = [transitions(settings.rounds * settings.states, choices) for _ in range(joints)]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        noted = {f"{name} {j}": array for j, one in enumerate(self._noted) for name, array in one._asdict().items()}
        return {"weights": self._weights, "random": self._random, "counts": self._counts, **noted}

    @property
    def ended(self) -> bool:
        """Whether all rounds are over."""
        return bool(self._counts[0] >= self._settings.rounds)

    @property
    def share(self) -> float:
        """Share of the rounds that are over."""
        return float(self._counts[0] / self._settings.rounds)

    @property
    def episodes(self) -> int:
        """Episodes in which states were noted."""
        return int(self._counts[1])

    @property
    def steps(self) -> int:
        """Steps of the simulation: one for each action in each state."""
        return int(self._counts[2] * self._noted[0].reward.shape[1])

    def warm_up(self) -> None:
        """Note a state, and update all values."""
        self._note(0, 1)
        self._sweep(0, 1, 1)

    def learn_on(self) -> None:
        """Note states, and find values."""
        began, settings = time.thread_time(), self._settings
        first, count = int(self._counts[0]) * settings.states, settings.states
        sweeps, change = 0, 0.0
        for joint in range(len(self._noted)):
            self._counts[1] += self._note(joint, count, first)
        for joint in range(len(self._noted)):
            made, left = self._sweep(joint, first + count, _MOST_SWEEPS)
            sweeps, change = max(sweeps, made), max(change, left)
        self._counts[0] += 1
        self._counts[2] += count * len(self._noted)
        cells = np.unique(self._noted[0].cell[: first + count]).size
        row = (self.episodes, self._counts[2], cells, sweeps, change)
        self.add_row(row, time.thread_time() - began)

    def _note(self, joint: int, count: int, first: int = 0) -> int:
        """Note ``count`` states of ``joint`` as those from ``first`` on; return in how many episodes."""
        learner = learner_of(self._simulation, self._settings, self._weights, 0.0)
        one = episode(self._env, self._random)
        share = self._settings.random_share if self._counts[0] else 1.0
        memory = value_memory(learner, one.state.x.size, 0)
        noted = part_of(self._noted[joint], first, first + count)
        return int(note_states(self._env, learner, one, memory, share, joint, noted))

    def _sweep(self, joint: int, count: int, most: int) -> tuple[int, float]:
        """Update values of ``joint`` by the first ``count`` states until they stay; return sweeps and last change."""
        settings = self._settings
        values = learner_of(self._simulation, settings, self._weights).values.weights[joint]
        noted = part_of(self._noted[joint], 0, count)
        workspace, change, made = np.zeros((3, *values.shape)), np.inf, 0
        while made < most and change > settings.tolerance:
            change = float(sweep(noted, float(settings.discount), float(settings.reward.switch), values, workspace))
            made += 1
        return made, change
