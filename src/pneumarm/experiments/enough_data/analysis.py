"""What the rows say of the thesis' minutes of collecting, half of them, and more."""

import numpy as np

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.enough_data.minutes import EnoughData
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import difference

_THESIS = 120.0  # minutes (section 3.2.2)


def analysis(experiment: EnoughData, rows: TrialRows) -> Analysis:
    """Return coverage, fit and performance by minutes."""
    trials, last = experiment.trials, len(experiment.minutes)
    usual, half = (
        1 + int(np.argmin([abs(minutes - wanted) for minutes in experiment.minutes]))
        for wanted in (_THESIS, _THESIS / 2)
    )
    words, found = filled_words(
        experiment,
        rows,
        gain=difference(rows, "reward", last, usual),
        shorter=difference(rows, "reward", last, half),
        half=trials[half],
        usual=trials[usual],
        shortest=trials[1],
        longest=trials[last],
    )
    return analysed(experiment, rows, words, found)
