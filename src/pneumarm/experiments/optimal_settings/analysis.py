"""What the rows say of the two learning rates."""

from collections.abc import Sequence
from dataclasses import replace

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.comparison import side_by_side
from pneumarm.experiments.design.table import packaged_results
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Array
from pneumarm.experiments.optimal_settings.confirmation import DerivedSettings
from pneumarm.experiments.trainings import CRITERIA
from pneumarm.experiments.verdict import interval

_CRITERIA = ("reward", "actions", "switches", "episodes")
_TRIAL_10 = 10


def analysis(experiment: DerivedSettings, rows: TrialRows) -> Analysis:
    """Return both settings beside the thesis', and the difference within the runs."""
    trials = experiment.trials
    ours = {name: rows.table(name, list(trials)) for name in _CRITERIA}
    printed, arrayed = (
        packaged_results(f"pneumarm.experiments.{one}", *_CRITERIA) for one in ("optimal_settings", "all_goals")
    )
    thesis = {name: [printed[name][0], arrayed[name][_TRIAL_10 - 1]] for name in _CRITERIA}
    words, found = filled_words(
        experiment,
        rows,
        theirs=interval(thesis["reward"][1] - thesis["reward"][0]),
        our_means=_against(ours["reward"]),
        their_means=_against(thesis["reward"]),
    )
    figures = {name: {"mean": table.mean(axis=1).tolist(), "runs": table.tolist()} for name, table in ours.items()}
    made = analysed(experiment, rows, words, found, figures=figures)
    return replace(made, sections=[side_by_side(trials, ours, thesis, CRITERIA)])


def _against(reward: Sequence[Array] | Array) -> str:
    return f"{reward[1].mean():.2f} against {reward[0].mean():.2f}"
