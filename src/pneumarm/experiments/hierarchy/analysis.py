"""What the rows say of an upper agent."""

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.hierarchy.levels import WHO, Levels
from pneumarm.experiments.means import Column, difference, mean, numbers
from pneumarm.experiments.pictures import dots, section
from pneumarm.experiments.several_joints import SUCCESS

_REWARD = "in simulation: reward"


def analysis(experiment: Levels, rows: TrialRows) -> Analysis:
    """Return how flat and hierarchical agents do with one goal and with all."""
    found, trials = measured(rows), experiment.trials
    words = experiment.words.filled(found)
    halves = (
        {trial: called for trial, called in trials.items() if trial <= len(WHO)},
        {trial: called for trial, called in trials.items() if trial > len(WHO)},
    )
    sections = []
    for part, which in zip(words.sections, halves, strict=True):
        shown = {
            "success in simulation [%]": [Column(SUCCESS, "", factor=100.0).interval(rows, t) for t in which],
            "reward in simulation [-]": [mean(rows, _REWARD, t) for t in which],
            "episodes of training [-]": [mean(rows, "episodes", t) for t in which],
        }
        picture = dots(list(which.values()), shown, part.figure, reference=0)
        sections.append(section(part, rows, which, figures=[picture]))
    return words.analysis(found, numbers(rows, trials, words.sections[0].columns), sections)


def measured(rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by: the upper agent that sees angles, against others."""
    common, own, angles, whole = 1, 2, 3, 4
    all_ = len(WHO)
    return {
        "faster": difference(rows, "episodes", angles, common),
        "than_own_faster": difference(rows, "episodes", angles, own),
        "reward": difference(rows, _REWARD, angles, common),
        "than_own": difference(rows, _REWARD, angles, own),
        "low": difference(rows, _REWARD, angles, whole),
        "low_all": difference(rows, _REWARD, angles + all_, whole + all_),
        "success_all": difference(rows, SUCCESS, angles + all_, common + all_),
        "than_own_all": difference(rows, SUCCESS, angles + all_, own + all_),
        "all_goals": mean(rows, SUCCESS, angles + all_),
        "one_goal": mean(rows, SUCCESS, angles),
    }
