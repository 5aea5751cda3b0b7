"""What the rows say of who acts for the joints."""

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.joint_agents.teams import WHO, JointAgents
from pneumarm.experiments.means import Column, difference, mean, numbers
from pneumarm.experiments.pictures import dots, section
from pneumarm.experiments.several_joints import SUCCESS


def analysis(experiment: JointAgents, rows: TrialRows) -> Analysis:
    """Return how each team does with one goal and with all."""
    found, trials = measured(rows), experiment.trials
    words = experiment.words.filled(found)
    one, all_ = words.sections
    halves = (
        {trial: called for trial, called in trials.items() if trial <= len(WHO)},
        {trial: called for trial, called in trials.items() if trial > len(WHO)},
    )
    sections = []
    for part, which in zip((one, all_), halves, strict=True):
        shown = {
            "success in simulation [%]": [Column(SUCCESS, "", factor=100.0).interval(rows, t) for t in which],
            "success on the arm [%]": [Column("success_rate", "", factor=100.0).interval(rows, t) for t in which],
            "reward on the arm [-]": [mean(rows, "reward", t) for t in which],
        }
        sections.append(section(part, rows, which, figures=[dots(list(which.values()), shown, part.figure)]))
    return words.analysis(found, numbers(rows, trials, one.columns), sections)


def measured(rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by, of one goal and of all."""
    common, own, one, policy = 1, 2, 3, 4
    all_ = len(WHO)
    reward = "in simulation: reward"
    return {
        "own": difference(rows, SUCCESS, own, common),
        "own_all": difference(rows, SUCCESS, own + all_, common + all_),
        "one_agent": mean(rows, SUCCESS, one),
        "one_more": difference(rows, reward, one, common),
        "common_all": mean(rows, SUCCESS, common + all_),
        "own_goals_all": mean(rows, SUCCESS, own + all_),
        "policy": difference(rows, reward, policy, common),
        "policy_all": difference(rows, reward, policy + all_, common + all_),
        "policy_success": mean(rows, SUCCESS, policy + all_),
    }
