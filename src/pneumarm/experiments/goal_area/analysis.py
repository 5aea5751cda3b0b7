"""What the rows say of the costs of precision."""

from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.goal_area.areas import AREAS, GoalArea
from pneumarm.experiments.means import Column, by_trial, difference, mean
from pneumarm.experiments.pictures import dots, section


def analysis(experiment: GoalArea, rows: TrialRows) -> Analysis:
    """Return what each goal area costs."""
    trials, base = experiment.trials, 1
    costs = {t: difference(rows, "reward", t, base) for t in AREAS if t != base}
    found = {
        "success": mean(rows, "success_rate", base),
        "slow": mean(rows, "half as fast at the end", base),
        "points": difference(rows, "success_rate", 2, base).times(100),
        "angle": costs[3],
        **{name: costs[t].times(-1) for name, t in (("of_speed", 2), ("of_angle", 3), ("of_both", 4))},
    }
    words = experiment.words.filled(found)
    shown = {
        "success on the arm [%]": [Column("success_rate", "", factor=100.0).interval(rows, t) for t in AREAS],
        "actions of successes\non the arm [-]": [mean(rows, "actions", t) for t in AREAS],
        "reward on the arm [-]": [mean(rows, "reward", t) for t in AREAS],
    }
    (areas,) = words.sections
    return words.analysis(
        found,
        figures={
            "reward": by_trial(rows, trials, "reward"),
            "success_rate": by_trial(rows, trials, "success_rate"),
            "cost": {trials[t]: one._asdict() for t, one in costs.items()},
        },
        sections=[section(areas, rows, trials, figures=[dots(list(trials.values()), shown, areas.figure)])],
    )
