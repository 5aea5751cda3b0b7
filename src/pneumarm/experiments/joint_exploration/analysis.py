"""What the rows say of exploring by several agents."""

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.joint_exploration.rates import JointExploration
from pneumarm.experiments.means import Column, difference, mean, numbers
from pneumarm.experiments.pictures import dots, section
from pneumarm.experiments.several_joints import SUCCESS


def analysis(experiment: JointExploration, rows: TrialRows) -> Analysis:
    """Return how agents learn with each rate of exploring."""
    found, trials = measured(rows), experiment.trials
    words = experiment.words.filled(found)
    (rates,) = words.sections
    shown = {
        "episodes of training [-]": [mean(rows, "episodes", t) for t in trials],
        "success in simulation [%]": [Column(SUCCESS, "", factor=100.0).interval(rows, t) for t in trials],
        "reward in simulation [-]": [mean(rows, "in simulation: reward", t) for t in trials],
    }
    picture = dots(list(trials.values()), shown, rates.figure, reference=0)
    return words.analysis(
        found, numbers(rows, trials, words.columns), [section(rates, rows, trials, figures=[picture])]
    )


def measured(rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by; trials are compared with the first, the thesis'."""
    thesis, together, low, less, without = 1, 2, 3, 4, 5
    return {
        "both": mean(rows, "exploring", thesis),
        "fewer": difference(rows, "episodes", together, thesis),
        "fewest": difference(rows, "episodes", low, thesis),
        "demand": difference(rows, "episodes", less, thesis),
        "unshaped": difference(rows, "episodes", without, thesis),
        "reward": difference(rows, "in simulation: reward", together, thesis),
        "low_reward": difference(rows, "in simulation: reward", low, thesis),
        "off": mean(rows, "exploring", thesis)._replace(mean=mean(rows, "exploring", thesis).mean - 0.75),
    }
