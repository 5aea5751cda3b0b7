"""Trainings that differ in their shaping, with a whole potentiometer and with a worn one."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.experiment import (
    Experiment,
    Figures,
    LaboratorySettings,
)
from pneumarm.experiments.preparation import Simulated, simulated
from pneumarm.experiments.trainings import train_and_test, with_settings
from pneumarm.experiments.words import words_of
from pneumarm.learning import Exploration, TrainSettings
from pneumarm.progress import Report

_WITHOUT = Exploration(0.09, 10.0)


class ShapingTrial(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a trial changes."""

    name: str
    settings: dict[str, Any] = {}
    """New values by the place of the setting."""
    shaping: bool = True
    worn: bool = False
    """Whether the potentiometer is."""


class _TrialsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    trials: tuple[ShapingTrial, ...]


@dataclass(frozen=True)
class WholeAndWorn:
    """The simulation of an arm, and of the same arm with a worn potentiometer."""

    whole: Simulated
    worn: Simulated


def _packaged(name: str) -> str:
    return (resources.files(__package__) / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class ShapingSettings(Experiment):
    """Trainings that differ in their shaping."""

    records = True

    name = "shaping-settings"
    words = words_of(__package__)
    plan: tuple[ShapingTrial, ...] = field(
        default_factory=lambda: msgspec.convert(tomllib.loads(_packaged("trials.toml")), _TrialsFile).trials
    )
    wear: str = field(default_factory=lambda: _packaged("worn.toml"))

    @property
    def trials(self) -> Mapping[int, str]:
        """Trials of ``trials.toml``."""
        return {number: trial.name for number, trial in enumerate(self.plan, 1)}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""
        chosen = self.plan[trial - 1]
        base = BASE if chosen.shaping else replace(BASE, shaping=None, exploration=_WITHOUT)
        places = {k: tuple(v) if isinstance(v, list) else v for k, v in chosen.settings.items()}
        return with_settings(base, places)

    def settings(self) -> Any:
        """Return the settings of every trial and the wear."""
        trials = {str(trial): msgspec.to_builtins(self.train_settings(trial)) for trial in self.trials}
        return {
            "trials": trials,
            "worn": [number for number in self.trials if self.plan[number - 1].worn],
            "wear": self.wear,
        }

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> WholeAndWorn:
        """Return the arm's simulation, and that of the arm with the worn potentiometer."""
        whole = simulated(arm, folder, settings, progress)
        return WholeAndWorn(whole, simulated(arm, folder / "worn", settings, progress, faults=self.wear))

    def measure(self, material: WholeAndWorn, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train and test one agent."""
        chosen = material.worn if self.plan[trial - 1].worn else material.whole
        return train_and_test(chosen, self.train_settings(trial), run, settings)

    def reference(self, trial: int) -> int:
        """Return the trial with the thesis' settings on the same kind of arm."""
        worn = self.plan[trial - 1].worn
        return next(
            n for n, other in enumerate(self.plan, 1) if other.worn == worn and other.shaping and not other.settings
        )
