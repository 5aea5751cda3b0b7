"""Fine tuning (section 5.3): does another experiment, its levels closer together, find better settings?

The thesis' trial 10 beats its derived settings, "mainly" because two levels far apart were used (section 5.4.2); for
fine tuning it advises more levels that lie closer together (section 5.3). That is done here: learning rate, neurons,
traces and discount factor at three levels each on L9, with SARSA; trial 10 of all-goals is repeated beside it.

    pneumarm experiment fine-tuning

The best of nine trials looks better than it is. So the settings are chosen by the odd runs and compared with trial
10 on the even ones, which had no part in the choice.

On arms 1 to 5, four runs each, the settings so chosen (learning rate 0.05, 5 neurons, lambda 0.1, gamma 0.98) earn
26 ± 33 more than trial 10: not told apart, though low learning rates are ahead throughout.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from matplotlib.figure import Figure

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import packaged_design
from pneumarm.experiments.differences import above, interval
from pneumarm.experiments.experiment import ARMS, Analysis, Claim, Rows
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.pictures import dots
from pneumarm.experiments.trainings import CRITERIA, Trainings
from pneumarm.learning import TrainSettings
from pneumarm.report.page import Picture, Section
from pneumarm.report.style import DARK, GREY, MIDDLE, panels, styled

_TRIAL_10 = replace(BASE, method="sarsa", learning_rate=0.10, hidden=5, trace_decay=0.0, discount=0.98)
_GAMMAS = (0.95, 0.98, 0.99)  # of figure_returns: the thesis' levels, and the highest here


@dataclass(frozen=True)
class FineTuning(Trainings):
    """An orthogonal array of three levels, and the settings to beat."""

    name: str = "fine-tuning"
    title: str = "Fine tuning with three levels"
    question: str = "Do levels that lie closer together find better settings than those of trial 10?"
    source: str = "Thesis sections 5.3 and 5.4.2"
    runs: int = 4
    arms: tuple[str, ...] = ARMS
    array: Factorial = field(
        default_factory=lambda: Factorial(
            name="fine-tuning",
            title="",
            question="Which of three levels around the derived settings are best?",
            source="",
            runs=4,
            design=packaged_design(__name__),
            base=replace(BASE, method="sarsa"),
            thesis={},
            criteria=("reward", "episodes"),
        )
    )

    @property
    def trials(self) -> Mapping[int, str]:
        """Trials of the array, then trial 10 of all-goals."""
        return {**self.array.trials, self.reference: "trial 10 of all-goals"}

    @property
    def reference(self) -> int:
        """Number of the last trial."""
        return len(self.array.trials) + 1

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""
        return _TRIAL_10 if trial == self.reference else self.array.train_settings(trial)

    def analyse(self, rows: Rows) -> Analysis:
        """Return the analysis of the array, and what the settings chosen by odd runs make of the even ones."""
        found = self.array.analyse(rows.of(self.array.trials))
        reward = rows.table("reward", list(self.trials))
        shown = {
            CRITERIA[name]: [interval(rows.samples(values)) for values in rows.table(name, list(self.trials))]
            for name in ("reward", "success_rate", "episodes")
        }
        trials = Section(
            "Trials",
            [self.array.labels],
            figures=[
                dots(
                    list(self.trials.values()),
                    shown,
                    "Results of the trials, means with their 95 % intervals; the line through all is trial 10's.",
                    reference=-1,
                )
            ],
        )
        claim, text = self.confirmation(rows)
        return Analysis(
            summary=[self.question, text, *found.summary[1:]],
            figures={**found.figures, "reference": float(reward[-1].mean())},
            sections=[trials, *found.sections, _returns()],
            claims=[claim],
        )

    def confirmation(self, rows: Rows) -> tuple[Claim, str]:
        """Return whether the trial that is best in odd runs beats trial 10 in even ones, and which it is in words."""
        reward = rows.table("reward", list(self.trials))
        odd = np.tile(np.arange(1, rows.runs + 1) % 2 == 1, len(rows.arms))
        text = "Levels that lie closer together give settings better than those of trial 10"
        thesis = "supposed (sections 5.3 and 5.4.2); trial 10 earns 10.18 (table C.7)"
        if odd.all():
            return Claim(
                text, thesis, "one run: nothing left to confirm with", "open", "fine-tuning"
            ), "One run confirms nothing."
        best = int(np.argmax(reward[:-1, odd].mean(axis=1)))
        even = reward[:, ~odd]
        difference = interval(rows.samples(even[best] - even[-1]))
        ours = f"{difference}: {even[best].mean():.2f} against {even[-1].mean():.2f}"
        return (
            Claim(text, thesis, ours, above(difference), "fine-tuning"),
            f"Best in odd runs: {self.trials[best + 1]} (trial {best + 1}). In even runs it differs from trial 10 of "
            f"all-goals by {difference} of reward.",
        )


def _returns() -> Section:
    return Section(
        "What the discount factor does",
        ["How far ahead an agent plans: what the return of the best policy tells of a begin state so far away."],
        [
            Picture(
                returns_figure(TrainSettings(), _GAMMAS),
                "Return of the best policy by actions to the goal, for different γ (thesis fig. 4.2; no switches).",
                "The smaller γ, the sooner the return is the same for all distances.",
            )
        ],
    )


@styled
def returns_figure(settings: TrainSettings, discounts: Sequence[float]) -> Figure:
    """Draw the return of a policy that needs so many actions and never switches (thesis fig. 4.2)."""
    actions = np.arange(1, settings.cutoff + 1)
    figure, axes = panels(1, 1, 2.6)
    for discount, colour, line in zip(discounts, (DARK, MIDDLE, GREY), ("-", "--", ":"), strict=True):
        before = settings.reward.action * (1 - discount ** (actions - 1)) / (1 - discount)
        returns = before + settings.reward.goal * discount ** (actions - 1)
        axes[0, 0].plot(actions, returns, color=colour, linestyle=line, label=f"γ = {discount}")
    axes[0, 0].set_xlabel("actions to the goal")
    axes[0, 0].set_ylabel("return")
    axes[0, 0].legend()
    return figure


EXPERIMENT = FineTuning()
