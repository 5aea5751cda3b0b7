"""What the rows say of the choices."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.calibration.choices import AgentCalibration
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.factorial import rank_correlation
from pneumarm.experiments.trainings import EXPLORING
from pneumarm.report.page import Table

_GOAL = 51.0  # reward of a goal in place of an action that reaches none


def analysis(experiment: AgentCalibration, rows: TrialRows) -> Analysis:
    """Return the choices from the nearest to the farthest, by the odd trials, and how they do in the even ones."""
    thesis, lines, figures = ALL_GOALS.thesis["reward"].mean(axis=1), [], {}
    for trial, choices in experiment.trials.items():
        for test, named in (("", "greedy"), (EXPLORING, "exploring")):
            reward, success = (_by_trial(rows, trial, test + name) for name in ("reward", "success_rate"))
            distance = abs(reward[::2].mean() - thesis[::2].mean()) + _GOAL * (1 - success[::2].mean())
            even, order = reward[1::2].mean(), rank_correlation(reward[1::2], thesis[1::2])
            cells = [f"{distance:.1f}", f"{reward[::2].mean():.1f}", f"{success[::2].mean():.1%}"]
            cells += [f"{even:.1f}", f"{success[1::2].mean():.1%}", f"{order:.2f}"]
            lines.append((distance, [f"{choices}, {named}", *cells]))
            figures[f"{choices}, {named}"] = {"distance": float(distance), "even": float(even), "rank": order}
    lines.sort(key=lambda line: line[0])
    best, odd, even = lines[0][1], thesis[::2].mean(), thesis[1::2].mean()
    chosen = f"Nearest to the thesis in odd trials: {best[0]}, reward {best[2]} ({odd:.1f}), success {best[3]}; "
    chosen += f"in the even ones {best[4]} ({even:.1f}), {best[5]}, rank correlation {best[6]}."
    words, found = filled_words(experiment, rows, chosen=chosen)
    header = ["choices and test", "distance", "odd: reward", "success", "even: reward", "success", "rank correlation"]
    key = "; ".join(f"{factor.label}: {factor.name}" for factor in experiment.design.factors)
    table = Table(header, [line for _, line in lines], f"Means over arms and runs; {key}.")
    return analysed(experiment, rows, words, found, figures=figures, tables={0: [table]})


def _by_trial(rows: TrialRows, trial: int, figure: str) -> NDArray[np.float64]:
    """Return the means of ``figure`` by trial of all-goals under the choices of ``trial``."""
    return np.array([rows.table(f"{figure} {of}", [trial]).mean() for of in ALL_GOALS.trials])
