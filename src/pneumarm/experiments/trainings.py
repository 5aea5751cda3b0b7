"""One training of the thesis' agent and its test, as an experiment measures them."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.preparation import Simulated
from pneumarm.learning import TrainSettings, test
from pneumarm.learning.environment import environment
from pneumarm.learning.testing import TEST, TestResult, run_test
from pneumarm.learning.training import train

CRITERIA = {
    "reward": "average cumulative reward per episode",
    "actions": "average number of actions per episode",
    "switches": "average number of switches per episode",
    "episodes": "episodes of training",
    "success_rate": "share of successful episodes",
}
"""What a trained agent is judged by (thesis section 5.2), in words: greedy, and exploring as when training ended.

The thesis says that the learning rate is 0 in the test, but not whether exploration ends; so both are measured.
"""
EXPLORING = "exploring "
"""Prefix of the figures of the test with exploration."""
CRITERIA |= {EXPLORING + name: f"{text}, exploring" for name, text in CRITERIA.items() if name != "episodes"}
_TEST_SEED = 0  # the same begin states and goals for every agent of every experiment


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
    """Train one agent and return what it makes of the test.

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
    training = train(simulation, material.begin, one, run_seed(laboratory, run), threads=1)
    agent, count = training.agent, laboratory.test_episodes
    greedy = _means(test(agent, simulation, material.begin, count, _TEST_SEED))
    env = environment(simulation, material.begin, one)
    exploring = _means(run_test(env, agent.weights(), one, count, (_TEST_SEED, TEST), one.exploration))
    return {
        **greedy,
        **{EXPLORING + name: value for name, value in exploring.items()},
        "episodes": float(training.episodes[0]),
        "steps": float(training.steps[0]),
        "met": float(training.met[0]),
    }


def _means(tested: TestResult) -> dict[str, float]:
    return {
        "reward": float(tested.reward.mean()),
        "success_rate": float(tested.success.mean()),
        "actions": float(tested.actions.mean()),
        "switches": float(tested.switches.sum(axis=1).mean()),
    }
