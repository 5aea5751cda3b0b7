"""What the rows say of what agents lose on the way to the arm."""

from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import by_trial, difference, mean, over_arms, values
from pneumarm.experiments.moving import SIMULATION
from pneumarm.experiments.pictures import dots, section
from pneumarm.experiments.transferability.kinds import (
    BASE,
    KINDS,
    NO_NOISE,
    NO_PUNISHMENT,
    NO_SHAPING,
    TWICE,
    Transferability,
)


def analysis(experiment: Transferability, rows: TrialRows) -> Analysis:
    """Return what every kind of agent earns, and what it loses on the arm."""
    trials = experiment.trials
    lost = {t: values(rows, SIMULATION + "reward", t) - values(rows, "reward", t) for t in KINDS}
    found = {
        "unpunished": over_arms(lost[NO_PUNISHMENT] - lost[BASE]),
        "unshaped": over_arms(lost[NO_SHAPING] - lost[BASE]),
        "noise": difference(rows, "reward", BASE, NO_NOISE),
        "twice": difference(rows, "reward", TWICE, BASE),
    }
    losses = "; ".join(f"{name}: {over_arms(lost[t]):.1f}" for t, name in trials.items())
    words = experiment.words.filled({**found, "losses": losses})
    shown = {
        "reward on the arm [-]": [mean(rows, "reward", t) for t in KINDS],
        "lost on the way [-]": [over_arms(lost[t]) for t in KINDS],
        "switches of successes\non the arm [-]": [mean(rows, "switches", t) for t in KINDS],
    }
    (kinds,) = words.sections
    return words.analysis(
        found,
        figures={
            "lost": {name: over_arms(lost[t])._asdict() for t, name in trials.items()},
            "reward": by_trial(rows, trials, "reward"),
        },
        sections=[section(kinds, rows, trials, figures=[dots(list(trials.values()), shown, kinds.figure)])],
    )
