"""Control frequencies, and what is set per action made the same per time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from pneumarm.experiments.experiment import Axis, Experiment, Figures, LaboratorySettings
from pneumarm.experiments.there_and_back import (
    DECISIVE,
    MOVEMENTS,
    TRAINING,
    TRANSITIONS,
    Prepared,
    prepared,
    train_and_move,
    usual_recipe,
)
from pneumarm.experiments.words import words_of
from pneumarm.learning import TrainSettings
from pneumarm.progress import Report
from pneumarm.transitions import QUANTITIES

THESIS_FREQUENCY = 30.0
_FREQUENCIES = (20.0, 30.0, 40.0, 60.0)
_UNITS = dict(zip(QUANTITIES, ("counts", "counts/ms", "counts", "counts"), strict=True))
_CLOSE = 20.0  # percent by which eq. 3.7 may be wrong


def at_frequency(settings: TrainSettings, frequency: float) -> TrainSettings:
    """Return ``settings``, which are meant for 30 Hz, with what is per action made the same per time."""
    share = THESIS_FREQUENCY / frequency
    return replace(
        settings,
        cutoff=round(settings.cutoff / share),
        discount=settings.discount**share,
        reward=replace(settings.reward, action=settings.reward.action * share),
        noise=replace(settings.noise, steps=max(1, round(settings.noise.steps / share))),
    )


@dataclass(frozen=True)
class ControlFrequency(Experiment):
    """The whole job at several frequencies."""

    frequencies: tuple[float, ...] = _FREQUENCIES
    """Control frequencies in ascending order, 20, 30 and 40 Hz among them [Hz]."""
    name = "control-frequency"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """The frequencies."""
        return {trial: f"{frequency:g} Hz" for trial, frequency in enumerate(self.frequencies, 1)}

    @property
    def axis(self) -> Axis:
        """The frequencies."""
        return Axis("control frequency [Hz]", self.frequencies)

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training in ``trial``."""
        return at_frequency(TRAINING, self.frequencies[trial - 1])

    def settings(self) -> Any:
        """Return frequencies and trainings."""
        trainings = {words: msgspec.to_builtins(self.train_settings(trial)) for trial, words in self.trials.items()}
        return {
            "frequencies": list(self.frequencies),
            "transitions": TRANSITIONS,
            "collect": DECISIVE["collect"],
            "movements": MOVEMENTS,
            "trainings": trainings,
        }

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> list[Prepared]:
        """Return a simulation of every frequency."""
        recipes = [usual_recipe(settings, frequency=frequency) for frequency in self.frequencies]
        return [prepared(arm, folder, recipe, settings, progress) for recipe in recipes]

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent and move the arm with it, to goals in the range that 30 Hz reached."""
        chosen = material[trial - 1]
        goals = material[self.frequencies.index(THESIS_FREQUENCY)].simulation.goal_range
        found = train_and_move(chosen, self.train_settings(trial), run, settings, goals)
        return {**chosen.figures, **found}
