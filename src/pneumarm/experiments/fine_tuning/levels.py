"""An orthogonal array of three levels, and the settings to beat."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import packaged_design
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.trainings import Trainings
from pneumarm.experiments.words import Words, words_of
from pneumarm.learning import TrainSettings

_TRIAL_10 = replace(BASE, method="sarsa", learning_rate=0.10, hidden=5, trace_decay=0.0, discount=0.98)


@dataclass(frozen=True)
class FineTuning(Trainings):
    """Trials of the array, then trial 10 of all-goals."""

    name = "fine-tuning"
    words = words_of(__package__)
    array: Factorial = field(
        default_factory=lambda: Factorial(
            name="fine-tuning",
            words=Words("", "Which of three levels around the derived settings are best?", ""),
            runs=4,
            design=packaged_design(__package__),
            base=replace(BASE, method="sarsa"),
            thesis={},
            criteria=("reward", "episodes"),
        )
    )

    @property
    def trials(self) -> Mapping[int, str]:
        """What is set in each."""
        return {**self.array.trials, self.reference: "trial 10 of all-goals"}

    @property
    def reference(self) -> int:
        """Number of the last trial."""
        return len(self.array.trials) + 1

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""
        return _TRIAL_10 if trial == self.reference else self.array.train_settings(trial)
