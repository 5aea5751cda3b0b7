"""How learning on the arm goes on."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from pneumarm.drawing.colours import DARK, GREY, LIGHT, MIDDLE
from pneumarm.experiments.means import from_series
from pneumarm.report.style import panels, styled

_STYLES = ((DARK, "-"), (MIDDLE, "--"), (GREY, "-."), (LIGHT, "-"), (DARK, ":"))


@styled
def progress_figure(arms: Sequence[Sequence[Mapping[str, float]]]) -> Figure:
    """Draw deviation and performance of agents over the time on the arm: figures of rows, arm by arm."""
    figure, axes = panels(2, 1, 4.2, sharex=True)
    above, below = axes[:, 0]
    for (color, style), row in [(_STYLES[i % len(_STYLES)], row) for i, runs in enumerate(arms) for row in runs]:
        hours = from_series(row, "hours so far")
        above.plot(hours, from_series(row, "deviation"), color=color, ls=style, lw=1)
        below.plot(hours, 100 * from_series(row, "performance"), color=color, ls=style, lw=1)
        above.plot(hours[-1], from_series(row, "deviation")[-1], color=color, marker="o" if row["met"] else "x")
    above.set_ylabel("deviation [counts]")
    above.set_yscale("log")
    below.set_ylabel("performance [%]")
    below.set_xlabel("time on the arm [h]")
    below.set_xlim(0)
    above.set_title("o: met the criterion; x: had not when training ended")
    return figure


def progress_alt(rows: Sequence[Mapping[str, float]]) -> str:
    """Say in words what :func:`progress_figure` shows."""
    said = [
        f"{'met the criterion' if row['met'] else 'had not met the criterion'} after {row['hours']:.1f} h"
        for row in rows
    ]
    return f"{len(rows)} agents; they {', '.join(said)}."
