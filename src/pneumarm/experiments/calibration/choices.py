"""All-goals under each combination of the choices, and simulations whose inputs are scaled otherwise."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.design.assignment import Design, packaged_design
from pneumarm.experiments.experiment import Experiment, Figures, LaboratorySettings
from pneumarm.experiments.preparation import STORE, Simulated, simulated
from pneumarm.experiments.trainings import EXPLORING, train_and_test, with_settings
from pneumarm.experiments.words import words_of
from pneumarm.learning import TrainSettings
from pneumarm.progress import Report
from pneumarm.simulation import Simulation
from pneumarm.task import begin_states
from pneumarm.transitions import Store

FIGURES = ("reward", "success_rate", EXPLORING + "reward", EXPLORING + "success_rate")
_INPUT = "input_scale"


@dataclass(frozen=True)
class AgentCalibration(Experiment):
    """Combinations of the choices, each with all trials of all-goals."""

    name = "calibration"
    words = words_of(__package__)
    runs = 1
    records = True
    design: Design = field(default_factory=lambda: packaged_design(__package__))

    @property
    def trials(self) -> Mapping[int, str]:
        """The choices in words."""
        numbers = range(1, self.design.array.trials + 1)
        return {n: ", ".join(f"{k} {x}" for k, x in self.design.settings(n).items()) for n in numbers}

    def train_settings(self, trial: int, of: int) -> TrainSettings:
        """Return the settings of the trial ``of`` all-goals under the choices of ``trial``."""
        levels = self.design.settings(trial)
        changes = {f.setting: levels[f.label] for f in self.design.factors if f.setting != _INPUT}
        return with_settings(ALL_GOALS.train_settings(of), changes)

    def settings(self) -> Any:
        """Return all choices, and the settings of the first training under them."""
        return {text: msgspec.to_builtins(self.train_settings(trial, 1)) for trial, text in self.trials.items()}

    def prepare(
        self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report
    ) -> Mapping[float, Simulated]:
        """Return the arm's simulation by the scale of its inputs."""
        made = simulated(arm, folder, settings, progress)
        (factor,) = (one for one in self.design.factors if one.setting == _INPUT)
        found = {}
        with Store.open(folder / STORE) as store:
            for level in map(float, factor.levels):
                simulation = rescaled(made.simulation, level)
                begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
                found[level] = Simulated(arm, simulation, begin)
        return found

    def measure(self, material: Any, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train and test an agent in each trial of all-goals."""
        levels = self.design.settings(trial)
        found: dict[str, float] = {}
        scale = next(float(levels[f.label]) for f in self.design.factors if f.setting == _INPUT)
        for of in ALL_GOALS.trials:
            chosen, both = self.train_settings(trial, of), replace(settings, exploring=True)
            figures = train_and_test(material[scale], chosen, run, both)
            found |= {f"{name} {of}": figures[name] for name in FIGURES}
        return found


def rescaled(old: Simulation, factor: float) -> Simulation:
    """Return the same simulation, which predicts the same, with ``factor`` times the scale of its observations."""
    window, scaling = old.window, old.scaling
    rows = np.ones((window.input_size, 1))
    rows[: window.history * window.observation_size] = factor
    networks = tuple(
        replace(
            one,
            hidden_weights=one.hidden_weights * rows,
            output_weights=one.output_weights / factor,
            output_bias=one.output_bias / factor,
            direct=None if one.direct is None else one.direct * rows / factor,
        )
        for one in old.networks
    )
    return replace(
        old, networks=networks, scaling=replace(scaling, observation_scale=scaling.observation_scale * factor)
    )
