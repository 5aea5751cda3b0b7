"""What the rows say of the fewest minutes of collecting that are enough."""

import numpy as np

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.enough_data.minutes import EnoughData
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import difference

_THESIS = 120.0  # minutes (section 3.2.2)
_MARGIN = 2.0  # reward that does not matter: two actions of some seventeen


def analysis(experiment: EnoughData, rows: TrialRows) -> Analysis:
    """Return coverage, fit and performance by minutes."""
    trials, last = experiment.trials, len(experiment.minutes)
    usual, half = (
        1 + int(np.argmin([abs(minutes - wanted) for minutes in experiment.minutes]))
        for wanted in (_THESIS, _THESIS / 2)
    )
    fewest = _fewest(rows, last)
    enough = f"nothing less than {trials[last]} is shown to be as good, within {_MARGIN:g} of its reward"
    if fewest is not None:
        enough = f"from {trials[fewest]} on the reward is that of {trials[last]}, within {_MARGIN:g}"
    words, found = filled_words(
        experiment,
        rows,
        gain=difference(rows, "reward", last, usual),
        shorter=difference(rows, "reward", last, half),
        enough=enough,
        half=trials[half],
        usual=trials[usual],
        shortest=trials[1],
        longest=trials[last],
    )
    return analysed(experiment, rows, words, found)


def _fewest(rows: TrialRows, last: int) -> int | None:
    """Return the first trial from which on no reward is shown to be worse than the last by the margin or more."""
    good = [difference(rows, "reward", trial, last).low > -_MARGIN for trial in range(1, last)]
    return next((trial for trial in range(1, last) if all(good[trial - 1 :])), None)
