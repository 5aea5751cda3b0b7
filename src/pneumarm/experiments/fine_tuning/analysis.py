"""What the rows say of the array, and of the settings chosen by odd runs in the even ones."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pneumarm.drawing.colours import DARK, GREY, MIDDLE
from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.fine_tuning.levels import FineTuning
from pneumarm.experiments.means import over_arms
from pneumarm.experiments.pictures import dots
from pneumarm.experiments.trainings import CRITERIA
from pneumarm.experiments.verdict import Interval
from pneumarm.learning import TrainSettings
from pneumarm.report.page import Picture, Section
from pneumarm.report.style import panels, styled

_GAMMAS = (0.95, 0.98, 0.99)  # of returns_figure: the thesis' levels, and the highest here


def analysis(experiment: FineTuning, rows: TrialRows) -> Analysis:
    """Return the analysis of the array, and how the settings chosen by odd runs do in the even ones."""
    array, trials = experiment.array, experiment.trials
    of_array = array.analyse(rows.of(array.trials))
    words, found = filled_words(experiment, rows, **confirmation(experiment, rows))
    shown = {
        CRITERIA[name]: [over_arms(rows.pooled(name, [trial])) for trial in trials]
        for name in ("reward", "success_rate", "episodes")
    }
    of_trials, discount = words.sections
    picture = dots(list(trials.values()), shown, of_trials.figure, reference=-1)
    returns = Picture(
        returns_figure(TrainSettings(), _GAMMAS),
        discount.figure,
        "The smaller γ, the sooner the return is the same for all distances.",
    )
    figures = {**of_array.figures, "reference": float(rows.table("reward", list(trials))[-1].mean())}
    sections = [
        Section(of_trials.title, [array.labels], [picture]),
        *of_array.sections,
        Section(discount.title, discount.text, [returns]),
    ]
    made = analysed(experiment, rows, words, found, figures=figures)
    return replace(made, sections=sections, summary=[*made.summary, *of_array.summary[1:]])


def confirmation(experiment: FineTuning, rows: TrialRows) -> dict[str, Any]:
    """Return whether the trial that is best in odd runs beats trial 10 in even ones, and which it is in words."""
    reward = rows.table("reward", list(experiment.trials))
    odd = np.tile(np.arange(1, rows.runs + 1) % 2 == 1, len(rows.arms))
    if odd.all():
        return {
            "difference": Interval(math.nan, math.inf, 0),
            "ours": "one run: nothing left to confirm with",
            "chosen": "One run confirms nothing.",
        }
    best = int(np.argmax(reward[:-1, odd].mean(axis=1)))
    even = reward[:, ~odd]
    difference = over_arms((even[best] - even[-1]).reshape(len(rows.arms), -1))
    return {
        "difference": difference,
        "ours": f"{difference}: {even[best].mean():.2f} against {even[-1].mean():.2f}",
        "chosen": f"Best in odd runs: {experiment.trials[best + 1]} (trial {best + 1}). In even runs it differs from "
        f"trial 10 of all-goals by {difference} of reward.",
    }


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
