"""What the rows say of one goal and of all."""

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.goal_pairs.pairs import GoalPairs
from pneumarm.experiments.means import Column, mean, numbers
from pneumarm.experiments.pictures import dots, section
from pneumarm.experiments.several_joints import SUCCESS


def analysis(experiment: GoalPairs, rows: TrialRows) -> Analysis:
    """Return how each does with the middle goal, with another and with all."""
    found, trials = measured(rows), experiment.trials
    words = experiment.words.filled(found)
    (pairs,) = words.sections
    shown = {
        "success in simulation [%]": [Column(SUCCESS, "", factor=100.0).interval(rows, t) for t in trials],
        "success on the arm [%]": [Column("success_rate", "", factor=100.0).interval(rows, t) for t in trials],
        "reward on the arm [-]": [mean(rows, "reward", t) for t in trials],
    }
    picture = dots(list(trials.values()), shown, pairs.figure)
    return words.analysis(
        found, numbers(rows, trials, words.columns), [section(pairs, rows, trials, figures=[picture])]
    )


def measured(rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by."""
    middle, one, all_, policy_all = 1, 2, 3, 6
    return {
        "middle": mean(rows, SUCCESS, middle),
        "episodes": mean(rows, "episodes", middle),
        "one": mean(rows, SUCCESS, one),
        "all_goals": mean(rows, SUCCESS, all_),
        "policy_one": mean(rows, SUCCESS, 5),
        "policy": mean(rows, SUCCESS, policy_all),
        "policy_episodes": mean(rows, "episodes", policy_all),
        "policy_on_arm": mean(rows, "success_rate", policy_all),
    }
