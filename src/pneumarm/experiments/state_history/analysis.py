"""What the rows say of the history in the state, and of the length of the step."""

from collections.abc import Mapping

import msgspec

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Column, change, difference, numbers
from pneumarm.experiments.pictures import Axis, against, section
from pneumarm.experiments.state_history.histories import StateHistory
from pneumarm.report.page import Table

_THESIS = 3  # observations in the state (eq. 3.5)


def analysis(experiment: StateHistory, rows: TrialRows) -> Analysis:
    """Return errors and agents by history."""
    found, trials, count = measured(experiment, rows), experiment.trials, len(experiment.histories)
    words = experiment.words.filled({**found, "known": "{known}"})
    without = {trial: called for trial, called in trials.items() if trial <= count}
    axis = Axis("observations in the state [-]", experiment.histories)
    step, second = words.sections
    # The thesis' numbers are of another arm, and out of scale.
    drawn = [msgspec.structs.replace(column, thesis=None) for column in step.columns]
    pictures = [
        against(rows, which, axis, drawn, step.figure.format(known=known))
        for which, known in ((without, "unknown"), ({t: trials[t] for t in trials if t > count}, "known"))
    ]
    return words.analysis(
        found,
        numbers(rows, trials, step.columns) | {"agents": numbers(rows, without, second.columns)["ours"]},
        [
            section(step, rows, trials, figures=pictures, tables=[_nested(rows, trials, count, step.columns)]),
            section(second, rows, without, axis, compared=False),
        ],
    )


def measured(experiment: StateHistory, rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by."""
    one, three = (1 + experiment.histories.index(history) for history in (1, _THESIS))
    four, period = three + 1, three + len(experiment.histories)
    compared = {"history": (three, one), "more": (four, three), "known": (period, three)}
    return {
        **{
            f"{called}_{name}": change(rows, f"std {name}", trial, reference)
            for called, (trial, reference) in compared.items()
            for name in ("angle", "pressure_1", "pressure_2")
        },
        "reward": difference(rows, "reward", three, one),
        "further": difference(rows, "reward", four, three),
    }


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
