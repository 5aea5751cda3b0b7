"""What the rows say of the history in the state, and of the length of the step."""

from collections.abc import Mapping

import msgspec

from pneumarm.experiments.analysis import analysed, filled_words, shown_trials
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import change
from pneumarm.experiments.pictures import against
from pneumarm.experiments.state_history.histories import StateHistory
from pneumarm.experiments.words import Column
from pneumarm.report.page import Table


def analysis(experiment: StateHistory, rows: TrialRows) -> Analysis:
    """Return errors and agents by history."""
    trials, count = experiment.trials, len(experiment.histories)
    words, found = filled_words(experiment, rows, known="{known}")
    step, second = words.sections
    # The thesis' numbers are of another arm, and out of scale.
    drawn = [msgspec.structs.replace(column, thesis=None) for column in step.columns]
    without = shown_trials(experiment, second)
    pictures = [
        against(rows, which, experiment.axis, drawn, step.figure.format(known=known))
        for which, known in ((without, "unknown"), ({t: trials[t] for t in trials if t > count}, "known"))
    ]
    nested = _nested(rows, trials, count, step.columns)
    return analysed(experiment, rows, words, found, pictures={0: pictures}, tables={0: [nested]})


def _nested(rows: TrialRows, trials: Mapping[int, str], count: int, columns: tuple[Column, ...]) -> Table:
    """Return how much what is added to the state changes the errors."""
    pairs = {f"{trials[t]} against {trials[t - 1]}": (t, t - 1) for t in range(2, count + 1)}
    pairs |= {f"{trials[t]} against without": (t, t - count) for t in range(count + 1, 2 * count + 1)}
    lines = [
        [called, *(f"{change(rows, column.figure, *pair):+.2f}" for column in columns)]
        for called, pair in pairs.items()
    ]
    header = ["states compared", *(column.words.split(" [")[0] for column in columns)]
    return Table(header, lines, "Change of the error by what is added to the state [%].")
