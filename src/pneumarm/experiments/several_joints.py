"""What experiments of chapter 6 share: arms of two joints, and agents that learn one goal or all of them.

They go from an arm and back to it with :mod:`.there_and_back`. What a trial learns is a :class:`Lesson`.
"""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Experiment, Figures, LaboratorySettings, run_seed
from pneumarm.experiments.there_and_back import (
    BEFORE,
    MOVEMENTS,
    Prepared,
    Recipe,
    open_arm_at,
    prepared,
    train_and_move,
)
from pneumarm.experiments.words import Words
from pneumarm.learning import PolicySettings, TrainSettings, find_method
from pneumarm.progress import Report
from pneumarm.simulation import SINGLE_STEPS

ARMS = tuple(f"virtual:joints=2,seed={number}" for number in range(1, 6))
"""Five arms of two joints to develop on; those to judge on are ``virtual:joints=2,seed=1001`` to ``1005``."""
TRANSITIONS = 12_000
"""Transitions of a simulation, at most as many as the laboratory's: 7 minutes on the arm."""
FIT = replace(SINGLE_STEPS, epochs=30)
"""Fit of a simulation: twice the thesis' epochs; twice as many again take 5 % off its errors."""
THESIS = TrainSettings(agents=1, validation_episodes=100, max_episodes=100_000)
"""Thesis' agents, one a joint, with as many episodes as it needed for a single goal (section 6.1.4)."""
HALF_AS_LONG = replace(THESIS, max_episodes=50_000)
"""The thesis' agents with half the episodes at most."""
POLICY = PolicySettings(agents=1, validation_episodes=100, lookahead=0)
"""A policy learned in many simulated arms; on the arm it does what it says, as the thesis' agents do."""
_GOAL = 6  # stream of random numbers


@dataclass(frozen=True)
class Lesson:
    """What is learned in a trial, and how."""

    learning: Any
    """Settings of a method."""
    method: str | None = None
    """Name of that method, where it is no built-in one."""
    goals: Literal["all", "one", "middle"] = "all"
    """Whether all goals are learned that the arm can hold, a single one, drawn alike for all trials of a run on an
    arm, or the one in the middle of the ranges of the joints."""


@dataclass(frozen=True, kw_only=True)
class SeveralJoints(Experiment):
    """An experiment on arms of several joints, by default of two, in which every trial is a lesson."""

    name: str
    words: Words
    lessons: Mapping[str, Lesson]
    """What is learned in each trial, by what the trial is called."""
    runs = 1
    arms = ARMS
    recipe: Recipe = field(default_factory=lambda: Recipe(TRANSITIONS, fit=FIT))
    """How the simulation is made; never from more transitions than the laboratory's."""

    @property
    def trials(self) -> Mapping[int, str]:
        """The lessons."""
        return dict(enumerate(self.lessons, 1))

    def settings(self) -> Any:
        """Return the lessons, and what their simulations and figures rest on."""
        return {
            "experiment": self.name,
            "lessons": {words: msgspec.to_builtins(lesson) for words, lesson in self.lessons.items()},
            "recipe": msgspec.to_builtins(self.recipe),
            "movements": MOVEMENTS,
        }

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Any:
        """Return the arm's simulation."""
        return of_several(arm, folder, self.within(settings), settings, progress)

    def within(self, settings: LaboratorySettings) -> Recipe:
        """Return the recipe with no more transitions than those of the laboratory."""
        return replace(self.recipe, transitions=min(self.recipe.transitions, settings.transitions))

    def measure(self, material: Any, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Learn what ``trial`` is about, and move the arm with it."""
        return lesson_results(material, self.lessons[self.trials[trial]], run, settings)


def of_several(arm: str, folder: Path, recipe: Recipe, settings: LaboratorySettings, progress: Report) -> Prepared:
    """Return what ``recipe`` makes of ``arm``, as :func:`~.there_and_back.prepared` does.

    Raises:
        UnusableInput: no arm has this name, or it has one joint, about which there is no question here.

    """
    with open_arm_at(arm, settings.seed) as found:
        if found.spec.joints == 1:
            raise UnusableInput(f"arm {arm!r} has one joint; expected several, such as {ARMS[0]}")
    return prepared(arm, folder, recipe, settings, progress)


def lesson_results(material: Prepared, lesson: Lesson, run: int, settings: LaboratorySettings) -> Figures:
    """Return how agents do that took ``lesson`` in the simulation of an arm, there and on the arm."""
    if lesson.goals != "all":
        simulation = material.simulation
        goal = simulation.goals.middle if lesson.goals == "middle" else one_goal(material, run, settings)
        material = replace(material, simulation=simulation.with_goals(np.stack([goal, goal], axis=1)))
    method = None if lesson.method is None else find_method(lesson.method)
    return train_and_move(material, lesson.learning, run, settings, method=method)


def one_goal(material: Prepared, run: int, settings: LaboratorySettings) -> NDArray[np.float64]:
    """Return the goal of a run that learns a single one, shape (joints,) [counts]; the arm can hold it."""
    random = np.random.default_rng([run_seed(settings, run), _GOAL, zlib.crc32(material.arm.encode())])
    return material.simulation.goals.draw(random, 1)[0]


SUCCESS = BEFORE + "success_rate"
"""Share of successes in the simulation."""
