"""What the rows say of noise on the simulation's predictions, besides what its words estimate."""

from collections.abc import Iterable

import numpy as np

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, Axis, TrialRows
from pneumarm.experiments.means import difference, over_arms, values
from pneumarm.experiments.noise_for_transfer.noises import NoiseForTransfer
from pneumarm.experiments.pictures import against
from pneumarm.experiments.verdict import Interval

_ONCE = 1.0  # as large as the fit's error, as in the thesis


def analysis(experiment: NoiseForTransfer, rows: TrialRows) -> Analysis:
    """Return what becomes of each noise on the arm."""
    trials, trial = experiment.trials, experiment.trial
    gains = {t: difference(rows, "reward", t, 1) for t in trials if t != 1}
    best = max(gains, key=lambda t: gains[t].mean)

    def gained(pairs: Iterable[tuple[int, int]]) -> Interval:
        """Return by how much the first of each pair of trials earns more, on average over the pairs."""
        return over_arms(np.mean([values(rows, "reward", a) - values(rows, "reward", b) for a, b in pairs], axis=0))

    words, found = filled_words(
        experiment,
        rows,
        count=len(gains),
        best=trials[best],
        most_gain=gains[best],
        better="; ".join(trials[t] for t, gain in gains.items() if gain.low > 0) or "none",
        worse="; ".join(trials[t] for t, gain in gains.items() if gain.high < 0) or "none",
        largest=max(experiment.factors),
        kind=gained((trial("correlated", slow, _ONCE), trial("white", slow, _ONCE)) for slow in (False, True)),
        speed=gained((trial(kind, True, _ONCE), trial(kind, False, _ONCE)) for kind in ("white", "correlated")),
    )
    axis, pictures = Axis("deviation of the noise [of the error]", (0.0, *experiment.factors)), []
    for kind in ("correlated", "white"):
        for slower, speeds in ((True, "less for a slow arm"), (False, "the same at all speeds")):
            chosen = [1, *(trial(kind, slower, factor) for factor in experiment.factors)]
            caption = f"{kind.capitalize()} noise, {speeds}: what agents trained with it do."
            pictures.append(against(rows, {t: trials[t] for t in chosen}, axis, words.sections[0].columns, caption))
    return analysed(experiment, rows, words, found, pictures={1: pictures})
