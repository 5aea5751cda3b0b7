"""Two settings that differ in the learning rate, from the same weights."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.trainings import Trainings
from pneumarm.experiments.words import words_of
from pneumarm.learning import TrainSettings

_BEST = replace(BASE, method="sarsa", hidden=5, trace_decay=0.0, discount=0.98)


@dataclass(frozen=True)
class DerivedSettings(Trainings):
    """The thesis' settings and those of its rule."""

    name = "optimal-settings"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """The learning rates."""
        return {1: "learning rate 0.05, as printed", 2: "learning rate 0.10, by the rule: trial 10"}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of ``trial``."""
        return replace(_BEST, learning_rate={1: 0.05, 2: 0.10}[trial])
