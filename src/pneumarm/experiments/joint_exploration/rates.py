"""Rates of exploring at the begin of shaping, and what is demanded there."""

import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.several_joints import SeveralJoints, lesson_results
from pneumarm.experiments.there_and_back import Prepared
from pneumarm.learning import OnlineLearner, Shaping, TrainSettings, train

_FIRST = Shaping().exploration.epsilon
_AGENTS = 2
TOGETHER = 1 - (1 - _FIRST) ** (1 / _AGENTS)
"""Rate of each of two agents of which one or both explore as often as a single one with the thesis' rate."""
_LOW = 0.1
_COUNTED = 2000  # actions in which exploring is counted
_RATE, _CRITERION = "shaping.exploration.epsilon", "shaping.initial_criterion"
VARIED: Mapping[str, Mapping[str, Any]] = {
    f"{_FIRST:g} each, as in the thesis": {},
    f"{TOGETHER:.2f} each, {_FIRST:g} together": {_RATE: TOGETHER},
    f"{_LOW:g} each": {_RATE: _LOW},
    "half the criterion": {_CRITERION: Shaping().initial_criterion / 2},
    "no shaping": {"shaping": None},
}
"""What differs from the thesis, by trial."""


class JointExploration(SeveralJoints):
    """The thesis' agents with one goal, exploring more and less."""

    def measure(self, material: Prepared, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Learn with the rate of ``trial`` and move the arm; count how often an agent of any joint explores."""
        lesson = self.lessons[self.trials[trial]]
        seed = run_seed(settings, run) ^ zlib.crc32(material.arm.encode())
        return {
            "exploring": exploring(material, lesson.learning, seed),
            **lesson_results(material, lesson, run, settings),
        }


def exploring(material: Prepared, settings: TrainSettings, seed: int) -> float:
    """Return the share of the actions at the begin of training in which at least one joint's agent explores."""
    first = settings.shaping.exploration if settings.shaping else settings.exploration
    begun = replace(settings, agents=1, max_episodes=1, validation_episodes=1)
    agent = train(material.simulation, material.begin, begun, seed).agent
    learner = OnlineLearner(agent, 0.0, first, seed=seed)
    learner.begin(material.begin.states[0], material.begin.angle[0])
    count = 0
    for _ in range(_COUNTED):
        count += bool(np.any(learner.act() != learner.greedy()))
        learner.follow(material.begin.states[0])
    return count / _COUNTED
