"""Results of trials one below the other, with their intervals."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from pneumarm.experiments.differences import Interval
from pneumarm.report.style import DARK, PALE, panels, styled

_SHORT = 60  # characters of an axis label on a line


@styled
def forest_figure(names: Sequence[str], quantities: Mapping[str, Sequence[Interval]], reference: int = 0) -> Figure:
    """Draw a panel a quantity, and in it a line a trial: its mean and 95 % interval.

    Args:
        names: of the trials, from top to bottom.
        quantities: intervals of every trial by what they are of, which becomes the label of the axis.
        reference: place of the trial whose means are drawn through all lines.

    """
    figure, axes = panels(1, len(quantities), 0.9 + 0.24 * len(names), sharey=True)
    places = np.arange(len(names))
    for axis, (label, found) in zip(axes[0], quantities.items(), strict=True):
        means = [each.mean for each in found]
        halves = [each.half if np.isfinite(each.half) else 0.0 for each in found]
        axis.axvline(means[reference], color=PALE, linewidth=1.2)
        axis.errorbar(means, places, xerr=halves, fmt="o", color=DARK, capsize=2, linewidth=1)
        axis.set_xlabel(_wrapped(label, _SHORT // len(quantities)))
        axis.grid(visible=False, axis="y")
    axes[0, 0].set_yticks(places, names)
    axes[0, 0].invert_yaxis()
    return figure


def _wrapped(label: str, width: int) -> str:
    lines: list[str] = []
    for word in label.split():
        if lines and len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return "\n".join(lines)
