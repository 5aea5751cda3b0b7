"""What the rows say of the fewest minutes of collecting that are enough."""

import numpy as np

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.enough_data.minutes import EnoughData
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import difference, mean

_THESIS = 120.0  # minutes (section 3.2.2)
_MARGIN = 2.0  # reward that does not matter: two actions of some seventeen


def analysis(experiment: EnoughData, rows: TrialRows) -> Analysis:
    """Return coverage, fit and performance by minutes."""
    trials, last = experiment.trials, len(experiment.minutes)
    usual = 1 + int(np.argmin([abs(minutes - _THESIS) for minutes in experiment.minutes]))
    fewest = _fewest(rows, last)
    enough, shown = f"nothing less than {trials[last]} is shown to be as good, within {_MARGIN:g} of its reward", ""
    if fewest is not None:
        enough = f"from {trials[fewest]} on the reward is that of {trials[last]}, within {_MARGIN:g}"
        less, transitions = difference(rows, "reward", fewest, last), mean(rows, "transitions", fewest).mean
        shown = f": {transitions:.0f} transitions; reward less that of the longest: {less:+.2f}"
    words, found = filled_words(
        experiment,
        rows,
        gain=difference(rows, "reward", last, usual),
        fewer="open" if fewest is None else "holds" if fewest < usual else "does not hold",
        enough=enough,
        shown=shown,
        usual=trials[usual],
        shortest=trials[1],
        longest=trials[last],
    )
    return analysed(experiment, rows, words, found)


def _fewest(rows: TrialRows, last: int) -> int | None:
    """Return the first trial from which on no reward is shown to be worse than the last by the margin or more."""
    good = [difference(rows, "reward", trial, last).low > -_MARGIN for trial in range(1, last)]
    return next((trial for trial in range(1, last) if all(good[trial - 1 :])), None)
