"""What the rows say of the transitions, and of several joints against one."""

from typing import Any

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.joint_data.transitions import JointData
from pneumarm.experiments.means import change, difference, mean, numbers
from pneumarm.experiments.pictures import Axis, against, section


def analysis(experiment: JointData, rows: TrialRows) -> Analysis:
    """Return errors and policies by transitions."""
    found, trials = measured(experiment, rows), experiment.trials
    words = experiment.words.filled(found)
    several = {trial: called for trial, called in trials.items() if trial != experiment.alone}
    axis = Axis("transitions [1000]", [size / 1000 for size in experiment.sizes], log=True)
    fit, moved = words.sections
    picture = against(rows, several, axis, fit.columns, fit.figure)
    return words.analysis(
        found,
        numbers(rows, trials, fit.columns) | {"policies": numbers(rows, several, moved.columns)["ours"]},
        [section(fit, rows, trials, figures=[picture]), section(moved, rows, several, axis)],
    )


def measured(experiment: JointData, rows: TrialRows) -> dict[str, Any]:
    """Return what claims are judged by, and the words that they need."""
    last, alone = len(experiment.sizes), experiment.alone
    compared = bool({"std angle"} & rows.of([alone]).figures)
    worse: dict[str, Interval | None] = {
        name: change(rows, figure, last, alone) if compared else None
        for name, figure in (("angle", "std angle"), ("relative", "relative angle"), ("pressure", "std pressure_1"))
    }
    return {
        **worse,
        "success": mean(rows, "success_rate", last),
        "gain": difference(rows, "reward", last, last - 1),
        "least": difference(rows, "reward", last, 1),
        "most": f"{experiment.sizes[-1]:,}",
        "half": f"{experiment.sizes[-2]:,}",
        "fewest": f"{experiment.sizes[0]:,}",
    }
