"""Goal areas, each learned and tested."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import msgspec
import numpy as np

from pneumarm.experiments.experiment import Figures, LaboratorySettings
from pneumarm.experiments.moving import (
    SIMULATION,
    OnTheArm,
    agent_of,
    greedy_test,
    means,
    simulated_test,
)
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.words import words_of
from pneumarm.learning import TrainSettings
from pneumarm.task import Reward

AREAS = {1: (25.0, 1.0), 2: (25.0, 0.5), 3: (12.0, 1.0), 4: (12.0, 0.5)}
"""Tolerances of angle [counts] and velocity [counts/ms] by trial."""


@dataclass(frozen=True)
class GoalArea(OnTheArm):
    """Four goal areas, each learned and tested."""

    name = "goal-area"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """Goal areas."""
        return {t: f"{angle:g} counts, {velocity:g} counts/ms" for t, (angle, velocity) in AREAS.items()}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return how the agents of ``trial`` learn."""
        angle, velocity = AREAS[trial]
        return replace(self.agent, reward=Reward(angle_tolerance=angle, velocity_tolerance=velocity))

    def settings(self) -> Any:
        """Return the settings of all agents and the sizes."""
        agents = {words: msgspec.to_builtins(self.train_settings(trial)) for trial, words in self.trials.items()}
        return {"agents": agents, "sizes": asdict(self.sizes)}

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train, and move in the simulation and on the arm."""
        agent = agent_of(material, self.train_settings(trial), run, settings)
        before = simulated_test(material, agent, settings.test_episodes, prefix=SIMULATION)
        made = greedy_test(material, agent, self.sizes.test, run, settings)
        speed = np.abs(made.velocity_end).max(axis=1)[made.success]
        slow = {"half as fast at the end": float((speed <= AREAS[trial][1] / 2).mean())} if made.success.any() else {}
        return {**before, **means(made), **slow}
