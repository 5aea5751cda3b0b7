"""What the rows say of noise on the simulation's predictions."""

from collections.abc import Iterable

import numpy as np

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import difference, mean, numbers, over_arms, values
from pneumarm.experiments.noise_for_transfer.noises import NoiseForTransfer
from pneumarm.experiments.pictures import Axis, against, section
from pneumarm.simulation.noise import NoiseSettings

_THESIS = NoiseSettings()  # correlated, less for a slow arm, as large as the fit's error (section 3.4)


def analysis(experiment: NoiseForTransfer, rows: TrialRows) -> Analysis:
    """Return what becomes of each noise on the arm."""
    trials, found = experiment.trials, measured(experiment, rows)
    gains = {t: difference(rows, "reward", t, 1) for t in trials if t != 1}
    best = max(gains, key=lambda t: gains[t].mean)
    words = experiment.words.filled(
        {
            **found,
            "without": mean(rows, "reward", 1),
            "count": len(gains),
            "best": trials[best],
            "most_gain": gains[best],
            "better": "; ".join(trials[t] for t, gain in gains.items() if gain.low > 0) or "none",
            "worse": "; ".join(trials[t] for t, gain in gains.items() if gain.high < 0) or "none",
            "factor": max(experiment.factors),
        }
    )
    agents, by_amount = words.sections
    axis, pictures = Axis("deviation of the noise [of the error]", (0.0, *experiment.factors)), []
    for kind in ("correlated", "white"):
        for slower, speeds in ((True, "less for a slow arm"), (False, "the same at all speeds")):
            chosen = [1, *(experiment.trial(kind, slower, factor) for factor in experiment.factors)]
            caption = f"{kind.capitalize()} noise, {speeds}: what agents trained with it do."
            pictures.append(against(rows, {t: trials[t] for t in chosen}, axis, agents.columns, caption))
    return words.analysis(
        found,
        numbers(rows, trials, agents.columns),
        [section(agents, rows, trials), section(by_amount, rows, trials, figures=pictures)],
    )


def measured(experiment: NoiseForTransfer, rows: TrialRows) -> dict[str, Interval]:
    """Return what claims are judged by."""
    trial, once = experiment.trial, _THESIS.factor
    usual, most = (trial(_THESIS.kind, _THESIS.by_velocity, factor) for factor in (once, max(experiment.factors)))

    def gained(pairs: Iterable[tuple[int, int]]) -> Interval:
        """Return by how much the first of each pair of trials earns more, on average over the pairs."""
        gains = [values(rows, "reward", first) - values(rows, "reward", second) for first, second in pairs]
        return over_arms(np.mean(gains, axis=0))

    return {
        "gain": difference(rows, "reward", usual, 1),
        "much": difference(rows, "reward", most, usual),
        "longer": difference(rows, "episodes", most, usual),
        "kind": gained((trial("correlated", slow, once), trial("white", slow, once)) for slow in (False, True)),
        "speed": gained((trial(kind, True, once), trial(kind, False, once)) for kind in ("white", "correlated")),
    }
