"""One training of the thesis' agent and its test, as experiments measure them."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Experiment, Figures, LaboratorySettings, run_seed
from pneumarm.experiments.preparation import Simulated, simulated
from pneumarm.learning import TrainSettings, test
from pneumarm.learning.online.loop import loop_workspace, train_episodes
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.testing import run_test
from pneumarm.learning.online.training import train_online
from pneumarm.learning.online.values import learner
from pneumarm.progress import Report
from pneumarm.random import random_state
from pneumarm.task.environment import Environment, environment, episode
from pneumarm.task.movements import TEST

CRITERIA = {
    "reward": "average cumulative reward per episode",
    "actions": "average number of actions per episode",
    "switches": "average number of switches per episode",
    "episodes": "episodes of training",
    "success_rate": "share of successful episodes",
}
"""What a trained agent is judged by (thesis section 5.2), in words.

The thesis says that the learning rate is 0 in the test, but not whether exploration ends. The test is greedy here;
with ``LaboratorySettings.exploring`` it is made again, exploring as when training ended.
"""
EXPLORING = "exploring "
"""Prefix of the figures of the test with exploration."""
CRITERIA |= {EXPLORING + name: f"{text}, exploring" for name, text in CRITERIA.items() if name != "episodes"}
LEARNING = "learning success_rate"
"""Share of successes while the agent goes on learning and exploring as when its training ended.

It is what the criterion of the training phase is about. The same weights succeed less often once they are frozen: an
agent that is stuck while it learns unlearns the action that holds it, and so gets away.
"""
CRITERIA[LEARNING] = "share of successful episodes, learning on"
_LEARNING, _LEARNING_EPISODES = 6, 2000  # stream of random numbers, and for how long
_NEWEST = 0.002  # weight of the newest episode in the performance
_TEST_SEED = 0  # the same begin states and goals for every agent of every experiment


class Trainings(Experiment):
    """An experiment in which every trial is a training in the arm's simulation, and a test there."""

    records = True

    @abstractmethod
    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""

    def settings(self) -> Any:
        """Return the settings of every trial."""
        return {str(trial): msgspec.to_builtins(self.train_settings(trial)) for trial in self.trials}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Simulated:
        """Return the arm's simulation."""
        return simulated(arm, folder, settings, progress)

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train and test one agent."""
        return train_and_test(material, self.train_settings(trial), run, settings)


def with_setting(settings: Any, place: str, value: Any) -> Any:
    """Return the dataclass ``settings`` with the field at ``place``, such as ``reward.switch``, set to ``value``.

    Raises:
        UnusableInput: there is no such field.

    """
    name, _, rest = place.partition(".")
    if not is_dataclass(settings) or name not in {field.name for field in fields(settings)}:
        raise UnusableInput(f"{type(settings).__name__} has no setting {name!r}")
    new = with_setting(getattr(settings, name), rest, value) if rest else value
    return replace(settings, **{name: new})  # type: ignore[type-var]


def with_settings(settings: TrainSettings, changes: Mapping[str, Any]) -> TrainSettings:
    """Return ``settings`` with all ``changes`` by place."""
    for place, value in changes.items():
        settings = with_setting(settings, place, value)
    return settings


def train_and_test(
    material: Simulated, settings: TrainSettings, run: int, laboratory: LaboratorySettings, goal: float | None = None
) -> Figures:
    """Train one agent and return how it does in the test.

    All agents of a run begin with the same weights, for each number of hidden units, and all agents are tested with
    the same begin states and goals.

    Args:
        material: the simulation and its begin states.
        settings: of the training; its number of agents and its validation do not matter.
        run: that the weights are those of.
        laboratory: how long to train at most and to test.
        goal: the only angle to learn [counts]; by default all.

    """
    simulation = material.simulation
    if goal is not None:
        simulation = replace(simulation, goal_range=np.full_like(simulation.goal_range, goal))
    most = laboratory.max_episodes or settings.max_episodes
    one = replace(settings, agents=1, validation_episodes=1, max_episodes=most)
    training = train_online(simulation, material.begin, one, run_seed(laboratory, run), threads=1)
    agent, count = training.agent, laboratory.test_episodes
    found = test(agent, simulation, material.begin, count, _TEST_SEED).means()
    env = environment(simulation, material.begin, one)
    if laboratory.exploring:
        tested = run_test(env, agent.weights(), one, count, (_TEST_SEED, TEST), one.exploration)
        found |= {EXPLORING + name: value for name, value in tested.means().items()}
    return {
        **found,
        LEARNING: _learning(env, agent.weights(), one, min(count, _LEARNING_EPISODES)),
        "episodes": float(training.episodes[0]),
        "steps": float(training.steps[0]),
        "met": float(training.met[0]),
    }


def _learning(env: Environment, weights: NDArray[np.float32], settings: TrainSettings, count: int) -> float:
    """Return the performance (thesis eq. 4.14) after ``count`` further training episodes over all angles.

    It begins at 0 and is divided by what its weights add up to, so that it is a mean of these episodes alone.
    """
    one = episode(env, random_state((_TEST_SEED, _LEARNING)))
    low, high = env.begin.domain
    last = settings.exploration
    deviation = float(high - low) if settings.shaping else np.inf
    schedule = Schedule(deviation, float(last.epsilon), float(last.temperature), _NEWEST)
    learns = learner(weights.copy(), settings)
    performance, _, _ = train_episodes(env, learns, schedule, one, loop_workspace(learns, one.goal.size), count, 0.0)
    return float(performance / (1 - (1 - _NEWEST) ** count))
