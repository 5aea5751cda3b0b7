"""Kinds of agents by how they learned, each in the simulation and on the arm."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import msgspec

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
from pneumarm.learning import Exploration, TrainSettings
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.task import Reward

BASE, NO_SHAPING, NO_PUNISHMENT, NO_NOISE, WHITE, TWICE = range(1, 7)
KINDS: Mapping[int, tuple[str, dict[str, Any]]] = {
    BASE: ("trial 10 of table 5.3", {}),
    NO_SHAPING: ("without shaping", {"shaping": None, "exploration": Exploration(0.09, 10.0)}),
    NO_PUNISHMENT: ("switches not punished", {"reward": Reward(switch=0.0)}),
    NO_NOISE: ("without noise", {"noise": NoiseSettings(kind="none")}),
    WHITE: ("white noise", {"noise": NoiseSettings(kind="white")}),
    TWICE: ("twice the noise", {"noise": NoiseSettings(factor=2.0)}),
}
"""Kinds of agents by trial: in words, and what is changed in the settings of their training."""


@dataclass(frozen=True)
class Transferability(OnTheArm):
    """Agents that learned in different ways, in the simulation and on the arm."""

    name = "transferability"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """How the agents learned."""
        return {trial: words for trial, (words, _) in KINDS.items()}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return how the agents of ``trial`` learn."""
        return replace(self.agent, **KINDS[trial][1])

    def settings(self) -> Any:
        """Return the settings of all agents and the sizes."""
        agents = {words: msgspec.to_builtins(self.train_settings(trial)) for trial, words in self.trials.items()}
        return {"agents": agents, "sizes": asdict(self.sizes)}

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train, and move in the simulation and on the arm."""
        found = agent_of(material, self.train_settings(trial), run, settings)
        judged = replace(found, settings=replace(found.settings, reward=Reward()))  # all by the same reward
        before = simulated_test(material, judged, settings.test_episodes, noise=NoiseSettings(), prefix=SIMULATION)
        played = greedy_test(material, judged, self.sizes.test, run, settings)
        return {**before, **means(played)}
