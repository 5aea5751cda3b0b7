"""The confirmation of the derived settings (section 5.4.2, appendix C.4).

The thesis derives SARSA, 5 neurons, lambda 0, gamma 0.98 and, by a slip, learning rate 0.05; its own rule gives 0.10,
which is trial 10 of all-goals. Both are confirmed here, with the weights of the eight runs of all-goals.

    pneumarm experiment optimal-settings

On arms 1 to 5, four runs each, the printed settings are better by 28 ± 16, in the thesis those of the rule by 3.5 ±
3.5: a learning rate of 0.10 is too much here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.comparison import side_by_side
from pneumarm.experiments.design.table import packaged_table
from pneumarm.experiments.differences import above, interval
from pneumarm.experiments.experiment import Analysis, Claim, Rows
from pneumarm.experiments.trainings import CRITERIA, Trainings
from pneumarm.learning import TrainSettings

_CRITERIA = ("reward", "actions", "switches", "episodes")
_TRIAL_10 = 10
_BEST = replace(BASE, method="sarsa", hidden=5, trace_decay=0.0, discount=0.98)


@dataclass(frozen=True)
class Confirmation(Trainings):
    """Two settings that differ in the learning rate, from the same weights."""

    name: str = "optimal-settings"
    title: str = "The derived settings, confirmed"
    question: str = (
        "Which learning rate is best with SARSA, 5 neurons, no traces and gamma 0.98: 0.05 as printed, or 0.10 by "
        "the thesis' own rule?"
    )
    source: str = "Thesis section 5.4.2, appendix C.4"
    runs: int = 8

    @property
    def trials(self) -> Mapping[int, str]:
        """The thesis' settings and those of its rule."""
        return {1: "learning rate 0.05, as printed", 2: "learning rate 0.10, by the rule: trial 10"}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of ``trial``."""
        return replace(_BEST, learning_rate={1: 0.05, 2: 0.10}[trial])

    def analyse(self, rows: Rows) -> Analysis:
        """Return both settings beside the thesis', and the difference within the runs."""
        ours = {name: rows.table(name, list(self.trials)) for name in _CRITERIA}
        printed = {name: packaged_table(__name__, f"thesis_{name}") for name in _CRITERIA}
        arrayed = {name: packaged_table("pneumarm.experiments.all_goals", f"thesis_{name}") for name in _CRITERIA}
        thesis = {name: [printed[name][0], arrayed[name][_TRIAL_10 - 1]] for name in _CRITERIA}
        # Runs on one arm share its simulation, so where there are several arms they are the sample.
        difference = interval(rows.samples(ours["reward"][1] - ours["reward"][0]))
        theirs = interval(thesis["reward"][1] - thesis["reward"][0])
        return Analysis(
            summary=[
                self.question,
                f"Reward with 0.10 less that with 0.05, within runs: {difference}; "
                f"the thesis' numbers give {theirs}.",
            ],
            figures={
                name: {"mean": table.mean(axis=1).tolist(), "runs": table.tolist()} for name, table in ours.items()
            },
            sections=[side_by_side(self.trials, ours, thesis, CRITERIA)],
            claims=[
                Claim(
                    "The rule's settings (learning rate 0.10) give more reward than the printed ones (0.05)",
                    f"{theirs}: {_against(thesis['reward'])} (tables C.7 and 5.7)",
                    f"{difference}: {_against(ours['reward'])}",
                    above(difference),
                    "optimal",
                )
            ],
        )


def _against(reward: Any) -> str:
    return f"{reward[1].mean():.2f} against {reward[0].mean():.2f}"


EXPERIMENT = Confirmation()
