"""The training phase of the thesis' agents (sections 5.2, 5.4.2), episode after episode.

Between two adjustments of the deviation a learner's whole state is a few arrays. No episode is running then, so the
state window, the noise and the traces, all set at the start of every episode, need not be kept.
"""

import time
from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.online.agent import Agent
from pneumarm.learning.online.loop import loop_workspace, train_episodes
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.online.shaping import adjusted, initial_deviation, stage
from pneumarm.learning.online.testing import run_test
from pneumarm.learning.online.values import draw_networks, learner, pack, unpack
from pneumarm.learning.training import Learner, Progress, Training, identity_of, train_side_by_side
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, Episode, environment, episode
from pneumarm.task.movements import Movements

_WEIGHTS, _TRAINING, _VALIDATION = 0, 1, 2  # streams of random numbers
_CACHE_LINE = 128  # bytes; processors that fetch lines in pairs need two of 64
_CHUNK_WITHOUT_SHAPING = 500  # episodes
CURVES = ("episodes", "deviation", "criterion", "performance", "epsilon", "temperature")
"""Columns of the training curves."""


def train_online(
    simulation: Simulation,
    begin_states: BeginStates,
    settings: TrainSettings | None = None,
    seed: int = 0,
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Training[Agent]:
    """Train ``settings.agents`` agents in ``simulation`` and return the best, see :func:`train_side_by_side`.

    Training of an agent ends when its deviation is the whole range of angles and its performance meets the
    criterion (section 5.2), or after ``settings.max_episodes`` (difference from the thesis, where some seed might
    train for ever); where ``settings.stops`` is false, only then.

    Raises:
        UnusableInput: begin states and simulation do not fit, or the checkpoint is of another training.

    """
    settings = settings or TrainSettings()
    env = environment(simulation, begin_states, settings)
    return train_side_by_side(
        lambda number: OnlineTrainee(env, simulation, settings, seed, number),
        settings.agents,
        settings.validation_episodes,
        identity_of(env, settings, seed),
        progress=progress,
        checkpoint=checkpoint,
        threads=threads,
    )


AgentT = TypeVar("AgentT")
SettingsT = TypeVar("SettingsT", bound=TrainSettings)


class ShapedLearner(Learner[AgentT], Generic[AgentT, SettingsT]):
    """Who learns in episodes that begin ever farther from their goals (section 4.3.2).

    Its curve has a row every 500 episodes, or as often as shaping adjusts the deviation [counts]; that is told as it
    was until then.
    """

    columns = CURVES

    def __init__(self, env: Environment, simulation: Simulation, settings: SettingsT, seed: int, number: int) -> None:
        super().__init__()
        self._env, self._simulation, self._settings, self._seed = env, simulation, settings, seed
        self._weights = self._drawn(np.random.default_rng([seed, _WEIGHTS, number]))
        self._random = random_state((seed, _TRAINING, number))
        self._first = initial_deviation(settings, simulation.spec)
        self._shaping = np.array([self._first, 0.0])
        """Deviation and performance."""
        self._counts = np.zeros(3, np.int64)
        """Episodes, steps, and whether it met the criterion."""
        joints = simulation.window.joints
        self._joints = np.stack([np.full(joints, self._first), np.zeros(joints)])
        """Deviation and performance of each joint."""
        shares = np.ones(joints)
        self._env = env._replace(begin=env.begin._replace(shares=shares))

    def _drawn(self, random: np.random.Generator) -> NDArray[np.float32]:
        """Return the weights that learning begins with: those of the thesis' networks."""
        window, muscles = self._simulation.window, self._simulation.spec.muscles
        return pack(draw_networks(window, self._settings, random, muscles), window)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        return {
            "weights": self._weights,
            "random": self._random,
            "shaping": self._shaping,
            "counts": self._counts,
            "joints": self._joints,
        }

    @property
    def met(self) -> bool:  # type: ignore[override]
        """Whether it met the criterion at the whole deviation."""
        return bool(self._counts[2])

    @property
    def ended(self) -> bool:
        """Whether it met the criterion, where that ends it, or made as many episodes as it may."""
        return (self.met and self._settings.stops) or self.episodes >= self._settings.max_episodes

    @property
    def share(self) -> float:
        """How far it is, by the logarithm of the deviation."""
        low, high = self._simulation.spec.angle_range
        made = self.episodes / self._settings.max_episodes
        if self._first >= high - low:
            return made
        grown = np.log(self._shaping[0] / self._first) / np.log((high - low) / self._first)
        return max(made, 0.95 * float(grown))

    @property
    def episodes(self) -> int:
        """Training episodes so far."""
        return int(self._counts[0])

    @property
    def rate_share(self) -> float:
        """The learning rate now, as a share of that at the beginning: 1/(1 + k/halving) after k episodes."""
        halving = self._settings.help.halving
        return halving / (halving + self.episodes) if halving else 1.0

    @property
    def steps(self) -> int:
        """Learning steps so far."""
        return int(self._counts[1])

    def warm_up(self) -> None:
        """Begin to learn."""
        self._learn(0)

    def learn_on(self) -> None:
        """Learn until the deviation is adjusted."""
        settings, deviation = self._settings, float(self._shaping[0])
        most = settings.shaping.episodes if settings.shaping else _CHUNK_WITHOUT_SHAPING
        now, performance, spent = self._learn(min(most, settings.max_episodes - self.episodes))
        self._shaping[1] = performance
        self._counts[2] |= now.whole and performance >= now.criterion
        row = (self.episodes, deviation, now.criterion, performance, *now.schedule[1:3])
        self._shaping[0] = adjusted(deviation, performance, settings, self._simulation.spec)
        if settings.shaping and settings.shaping.each:
            for joint, (own, is_there) in enumerate(self._joints.T):
                self._joints[0, joint] = adjusted(own, is_there, settings, self._simulation.spec)
            self._shaping[0] = self._joints[0].max()
        self.add_row(row, spent)

    def _learn(self, count: int) -> tuple[Any, float, float]:
        """Learn from ``count`` episodes; return the stage of shaping, the performance and the processor time."""
        now = stage(float(self._shaping[0]), self._settings, self._simulation.spec)
        self._env.begin.shares[:] = self._joints[0] / self._joints[0].max()
        # What threads write must not lie on a cache line together, or each slows the other down.
        one = apart(episode(self._env, self._random))
        began = time.thread_time()
        performance, steps, count = self._run(now.schedule, one, count)
        spent = time.thread_time() - began
        self._random[:] = one.state.random
        self._counts[:2] += count, steps
        return now, performance, spent

    @abstractmethod
    def _run(self, schedule: Schedule, one: Episode, count: int) -> tuple[float, int, int]:
        """Learn from at most ``count`` episodes; return performance, steps and episodes."""


class OnlineTrainee(ShapedLearner[Agent, TrainSettings]):
    """The thesis' networks."""

    def _run(self, schedule: Schedule, one: Episode, count: int) -> tuple[float, int, int]:
        rate = self._settings.learning_rate * self.rate_share
        worker = apart(learner(self._weights, self._settings, rate))
        remembered = apart(loop_workspace(worker, one.goal.size))
        remembered.retry.performance[:] = self._joints[1]
        found: tuple[float, int, int] = train_episodes(
            self._env, worker, schedule, one, remembered, count, float(self._shaping[1])
        )
        self._weights[:] = worker.weights
        self._joints[1] = remembered.retry.performance
        return found

    def validate(self, episodes: int) -> Movements:
        """Return greedy movements."""
        return run_test(self._env, self._weights, self._settings, episodes, (self._seed, _VALIDATION))

    def agent(self) -> Agent:
        """Return the agent as it is now."""
        simulation, settings = self._simulation, self._settings
        return Agent(
            spec=simulation.spec,
            window=simulation.window,
            scaling=simulation.scaling,
            goal_range=settings.goals_in(simulation).range,
            networks=unpack(self._weights, simulation.window, settings.hidden, settings.team),
            settings=settings,
        )


def apart(value: Any) -> Any:
    """Return a copy of ``value``, an array or named tuples of them, each with a cache line of nothing around it."""
    if isinstance(value, tuple):
        return type(value)(*(apart(part) for part in value))
    if not isinstance(value, np.ndarray):
        return value
    line = _CACHE_LINE // value.itemsize
    spacious = np.zeros(value.size + 2 * line, value.dtype)
    copy = spacious[line : line + value.size].reshape(value.shape)
    copy[...] = value
    return copy
