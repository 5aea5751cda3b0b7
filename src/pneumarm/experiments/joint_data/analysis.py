"""What the rows say of the transitions, and of several joints against one where there is an arm of one."""

from typing import Any

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.joint_data.transitions import JointData


def analysis(experiment: JointData, rows: TrialRows) -> Analysis:
    """Return errors and policies by transitions."""
    numbers = {"most": experiment.sizes[-1], "half": experiment.sizes[-2], "fewest": experiment.sizes[0]}
    own: dict[str, Any] = {name: f"{size:,}" for name, size in numbers.items()}
    if "std angle" not in rows.of([experiment.alone]).figures:
        own |= dict.fromkeys(("angle", "relative", "pressure"))
    return analysed(experiment, rows, *filled_words(experiment, rows, **own))
