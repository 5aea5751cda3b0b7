"""What the rows say of the minutes of collecting."""

from typing import Any

import numpy as np

from pneumarm.experiments.enough_data.minutes import EnoughData
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import difference, mean, numbers
from pneumarm.experiments.pictures import Axis, section

_THESIS = 120.0  # minutes (section 3.2.2)
_MARGIN = 2.0  # reward that does not matter: two actions of some seventeen


def analysis(experiment: EnoughData, rows: TrialRows) -> Analysis:
    """Return coverage, fit and performance by minutes."""
    found, trials = measured(experiment, rows), experiment.trials
    words = experiment.words.filled(found)
    axis = Axis("collecting [min]", experiment.minutes, log=True)
    sections = [section(one, rows, trials, axis) for one in words.sections]
    return words.analysis(found, numbers(rows, trials, words.columns), sections)


def measured(experiment: EnoughData, rows: TrialRows) -> dict[str, Any]:
    """Return what claims are judged by, and the words that they need."""
    trials, last = experiment.trials, len(experiment.minutes)
    usual = 1 + int(np.argmin([abs(minutes - _THESIS) for minutes in experiment.minutes]))
    fewest = _fewest(rows, last)
    enough = f"nothing less than {trials[last]} is shown to be as good, within {_MARGIN:g} of its reward"
    shown = ""
    if fewest is not None:
        enough = f"from {trials[fewest]} on the reward is that of {trials[last]}, within {_MARGIN:g}"
        less, transitions = difference(rows, "reward", fewest, last), mean(rows, "transitions", fewest).mean
        shown = f": {transitions:.0f} transitions; reward less that of the longest: {less:+.2f}"
    return {
        "gain": difference(rows, "reward", last, usual),
        "new": mean(rows, "new", last),
        "least": difference(rows, "reward", last, 1),
        "fewer": "open" if fewest is None else "holds" if fewest < usual else "does not hold",
        "enough": enough,
        "shown": shown,
        "usual": trials[usual],
        "shortest": trials[1],
        "longest": trials[last],
    }


def _fewest(rows: TrialRows, last: int) -> int | None:
    """Return the first trial from which on no reward is shown to be worse than the last by the margin or more."""
    good = [difference(rows, "reward", trial, last).low > -_MARGIN for trial in range(1, last)]
    return next((trial for trial in range(1, last) if all(good[trial - 1 :])), None)
