"""What the rows say of the control frequency, besides what its words estimate."""

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.control_frequency.frequencies import THESIS_FREQUENCY, ControlFrequency
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import difference, mean


def analysis(experiment: ControlFrequency, rows: TrialRows) -> Analysis:
    """Return errors and the performance of agents by frequency, and whether any earns more than the thesis'."""
    trials, middle = experiment.trials, 1 + experiment.frequencies.index(THESIS_FREQUENCY)
    gains = {t: difference(rows, "reward", t, middle) for t in trials if t != middle}
    better, worse = any(one.low > 0 for one in gains.values()), all(one.high < 0 for one in gains.values())
    words, found = filled_words(
        experiment,
        rows,
        frequencies=", ".join(trials.values()),
        angles=", ".join(f"{mean(rows, 'std angle', t).mean:.2f}" for t in trials),
        velocities=", ".join(f"{mean(rows, 'std velocity', t).mean:.3f}" for t in trials),
        rewards=", ".join(f"{mean(rows, 'reward', t):.1f}" for t in trials),
        gains="; ".join(f"{trials[t]} {one}" for t, one in gains.items()),
        trade_off="does not hold" if better else "holds" if worse else "open",
    )
    return analysed(experiment, rows, words, found)
