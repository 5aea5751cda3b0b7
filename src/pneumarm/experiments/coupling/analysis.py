"""What the rows say of the coupling."""

from pneumarm.experiments.coupling.couplings import Coupling
from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import change, difference, mean, numbers
from pneumarm.experiments.pictures import Axis, section


def analysis(experiment: Coupling, rows: TrialRows) -> Analysis:
    """Return errors and agents by the share of the coupling."""
    found, trials, count = measured(experiment, rows), experiment.trials, len(experiment.shares)
    words = experiment.words.filled(found)
    policies = {trial: called for trial, called in trials.items() if trial <= count}
    agents = {trial: called for trial, called in trials.items() if trial > count}
    axis = Axis("share of the coupling [-]", experiment.shares)
    fit, policy, thesis = words.sections
    shares = ["coupling\N{NO-BREAK SPACE}" + f"{share:g}" for share in experiment.shares]
    policies_here, agents_here = (dict(zip(which, shares, strict=True)) for which in (policies, agents))
    return words.analysis(
        found,
        numbers(rows, policies, [*fit.columns, *policy.columns])
        | {"agents": numbers(rows, agents, thesis.columns)["ours"]},
        [
            section(fit, rows, policies_here, axis),
            section(policy, rows, policies_here, axis),
            section(thesis, rows, agents_here, axis),
        ],
    )


def measured(experiment: Coupling, rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by: all of the coupling against none."""
    count = len(experiment.shares)
    return {
        "angle": change(rows, "std angle", count, 1),
        "policy": difference(rows, "reward", count, 1),
        "agents": difference(rows, "reward", 2 * count, count + 1),
        "longer": difference(rows, "episodes", 2 * count, count + 1),
        "success": mean(rows, "success_rate", count),
        "without": mean(rows, "success_rate", 1),
    }
