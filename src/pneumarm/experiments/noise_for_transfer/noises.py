"""Noises by kind, by speed and by how large they are."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from pneumarm.experiments.experiment import Experiment, Figures, LaboratorySettings
from pneumarm.experiments.there_and_back import (
    DECISIVE,
    TRAINING,
    Prepared,
    prepared,
    train_and_move,
    usual_recipe,
)
from pneumarm.experiments.words import words_of
from pneumarm.progress import Report
from pneumarm.simulation.noise import NoiseSettings


@dataclass(frozen=True)
class NoiseForTransfer(Experiment):
    """Agents trained with noises, on the arm."""

    factors: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Deviations of the noise, in those of the fit's error; the first is the thesis' 1."""
    name = "noise-for-transfer"
    words = words_of(__package__)

    @property
    def noises(self) -> Mapping[str, NoiseSettings]:
        """The noises by what they are called."""
        found = {"none": NoiseSettings(kind="none")}
        for kind in ("white", "correlated"):
            for by_velocity in (False, True):
                for factor in self.factors:
                    words = f"{kind}, {'by velocity' if by_velocity else 'fixed'}, {factor:g}"
                    found[words] = NoiseSettings(kind=kind, factor=factor, by_velocity=by_velocity)
        return found

    @property
    def trials(self) -> Mapping[int, str]:
        """The noises."""
        return dict(enumerate(self.noises, 1))

    def settings(self) -> Any:
        """Return the noises and the training."""
        noises = {words: msgspec.to_builtins(noise) for words, noise in self.noises.items()}
        return {**DECISIVE, "noises": noises}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Prepared:
        """Return the arm's simulation."""
        return prepared(arm, folder, usual_recipe(settings), settings, progress)

    def measure(self, material: Prepared, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent with the noise of ``trial``, and move the arm with it."""
        noise = self.noises[self.trials[trial]]
        return train_and_move(material, replace(TRAINING, noise=noise), run, settings)

    def trial(self, kind: str, by_velocity: bool, factor: float) -> int:
        """Return the number of a trial."""
        wanted = NoiseSettings(kind=kind, factor=factor, by_velocity=by_velocity)  # type: ignore[arg-type]
        return 1 + list(self.noises.values()).index(wanted)
