"""What the rows say of the control frequency."""

from typing import Any

from pneumarm.experiments.control_frequency.frequencies import THESIS_FREQUENCY, ControlFrequency
from pneumarm.experiments.differences import Interval, interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import change, difference, mean, numbers, samples
from pneumarm.experiments.pictures import Axis, section
from pneumarm.experiments.there_and_back import AFTER_A_SECOND


def analysis(experiment: ControlFrequency, rows: TrialRows) -> Analysis:
    """Return errors and the performance of agents by frequency."""
    found, trials = measured(experiment, rows), experiment.trials
    words = experiment.words.filled(
        {
            **found,
            "frequencies": ", ".join(trials.values()),
            "angles": ", ".join(f"{mean(rows, 'std angle', t).mean:.2f}" for t in trials),
            "velocities": ", ".join(f"{mean(rows, 'std velocity', t).mean:.3f}" for t in trials),
            "rewards": ", ".join(f"{mean(rows, 'reward', t):.1f}" for t in trials),
        }
    )
    axis = Axis("control frequency [Hz]", experiment.frequencies)
    sections = [section(one, rows, trials, axis) for one in words.sections]
    return words.analysis(found, numbers(rows, trials, words.columns), sections)


def measured(experiment: ControlFrequency, rows: TrialRows) -> dict[str, Any]:
    """Return what claims are judged by."""
    low, middle, high = (1 + experiment.frequencies.index(f) for f in (20.0, THESIS_FREQUENCY, 40.0))

    def grown(name: str) -> Interval:
        """Return by how many percent the error after a second is more than expected."""
        ran, expected = (samples(rows, f"{kind} {name}{AFTER_A_SECOND}", middle) for kind in ("measured", "expected"))
        return interval(100 * (ran / expected - 1))

    poor = samples(rows, "relative velocity", middle) - samples(rows, "relative angle", middle)
    gains = {t: difference(rows, "reward", t, middle) for t in experiment.trials if t != middle}
    better = any(found.low > 0 for found in gains.values())
    worse = all(found.high < 0 for found in gains.values())
    return {
        **{name: difference(rows, f"std {name}", high, low) for name in ("angle", "velocity")},
        **{name: change(rows, f"std {name}", high, low) for name in ("pressure_1", "pressure_2")},
        **{f"grown_{name}": grown(name) for name in ("angle", "pressure_1", "pressure_2")},
        "poor": interval(100 * poor),
        "gains": "; ".join(f"{experiment.trials[t]} {found}" for t, found in gains.items()),
        "trade_off": "does not hold" if better else "holds" if worse else "open",
    }
