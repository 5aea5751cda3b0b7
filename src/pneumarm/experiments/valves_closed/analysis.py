"""What the rows say of valves that are closed while computing."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, MIDDLE
from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Array, mean, samples
from pneumarm.experiments.valves_closed.inflation import CLOSED, OPEN, ValvesClosed
from pneumarm.report.page import Picture
from pneumarm.report.style import panels, styled


def analysis(experiment: ValvesClosed, rows: TrialRows) -> Analysis:
    """Return fit and performance each way."""
    period, pause = (mean(rows, name, OPEN).mean for name in ("period", "pause"))
    words, found = filled_words(experiment, rows, period_ms=1e3 * period, pause_ms=1e3 * pause)
    times = sorted(
        int(name.split()[1]) for name in rows.rows[0].figures if name.startswith("after ") and name.endswith("angle")
    )
    traces = {
        trial: {
            name: np.array([samples(rows, f"after {t} ms {name}", trial).mean() for t in times])
            for name in ("angle", "pressure")
        }
        for trial in experiment.trials
    }
    left, closed = (float(traces[trial]["angle"][-1]) for trial in (OPEN, CLOSED))
    watched = Picture(
        inflations(np.array(times), traces, period, pause),
        words.sections[0].figure,
        f"After {times[-1]} ms the angle has changed by {left:.1f} counts with the valve left open and by "
        f"{closed:.1f} counts with pauses.",
    )
    return analysed(experiment, rows, words, found, pictures={0: [watched]})


@styled
def inflations(
    times: NDArray[np.int64], traces: Mapping[int, Mapping[str, Array]], period: float, pause: float
) -> Figure:
    """Draw figure 2.8: the valve, the angle and the pressure of the muscle in time [ms]."""
    figure, axes = panels(3, 1, 4.6, sharex=True, height_ratios=(1, 2, 2))
    valve, angle, pressure = axes[:, 0]
    fine = np.arange(0, times[-1] + 0.1, 0.1)
    shut = (fine / 1e3) % period >= period - pause
    for trial, colour, style, words in (
        (OPEN, DARK, "-", "left open"),
        (CLOSED, MIDDLE, "--", "closed in the pause"),
    ):
        valve.plot(fine, np.where(shut & (trial == CLOSED), 0, 1), color=colour, ls=style)
        angle.plot(times, traces[trial]["angle"], color=colour, ls=style, label=words)
        pressure.plot(times, traces[trial]["pressure"], color=colour, ls=style)
    valve.set_yticks([0, 1], ["closed", "inlet open"])
    angle.set_ylabel("change of the\nangle [counts]")
    pressure.set_ylabel("change of the\npressure [counts]")
    pressure.set_xlabel("time [ms]")
    angle.legend(loc="upper left")
    for begin in fine[1:][shut[1:] & ~shut[:-1]]:
        for axis in (valve, angle, pressure):
            axis.axvspan(begin, begin + 1e3 * pause, color="#eeeeee", zorder=0)
    return figure
