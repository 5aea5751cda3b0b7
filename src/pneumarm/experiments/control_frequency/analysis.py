"""What the rows say of the control frequency, besides what its words estimate."""

from pneumarm.experiments.analysis import analysed, by_trial, filled_words
from pneumarm.experiments.control_frequency.frequencies import THESIS_FREQUENCY, ControlFrequency
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import mean
from pneumarm.experiments.words import Quantity


def analysis(experiment: ControlFrequency, rows: TrialRows) -> Analysis:
    """Return errors and the performance of agents by frequency, and whether any earns more than the thesis'."""
    trials, middle = experiment.trials, 1 + experiment.frequencies.index(THESIS_FREQUENCY)
    words, found = filled_words(
        experiment,
        rows,
        frequencies=", ".join(trials.values()),
        angles=", ".join(f"{mean(rows, 'std angle', t).mean:.2f}" for t in trials),
        velocities=", ".join(f"{mean(rows, 'std velocity', t).mean:.3f}" for t in trials),
        rewards=", ".join(f"{mean(rows, 'reward', t):.1f}" for t in trials),
        gains=by_trial(experiment, rows, Quantity(figure="reward", base=middle)),
    )
    return analysed(experiment, rows, words, found)
