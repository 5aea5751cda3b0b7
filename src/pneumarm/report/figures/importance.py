"""The weights of a least-squares fit as the importance of its inputs (thesis section 3.2.4)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, INK, MIDDLE
from pneumarm.report.style import Described, panels, styled

Array = NDArray[np.float64]

_SHOWN = 24  # inputs; the most important ones where there are more
_IN_A_ROW = 4  # outputs; of several joints each has a row of its own


@styled
def input_importance(weights: Array, inputs: Sequence[str], outputs: Sequence[str]) -> Described:
    """Draw the standardised weight of every input on every output as bars.

    Args:
        weights: change of an output in its standard deviations for one standard deviation of an input, shape
            (inputs, outputs).
        inputs: names of the inputs.
        outputs: names of the outputs.

    """
    order = _largest_first(weights)[:_SHOWN]
    order = np.sort(order)[::-1]
    columns = len(outputs) if len(outputs) <= _IN_A_ROW else next(n for n in (3, 4, 1) if len(outputs) % n == 0)
    rows = -(-len(outputs) // columns)
    figure, axes = panels(rows, columns, rows * (0.9 + 0.19 * len(order)), sharey=True)
    limit = 1.08 * float(np.abs(weights).max(initial=0)) or 1.0
    place = np.arange(len(order))
    words = []
    for o, (axis, name, w) in enumerate(zip(axes.flat, outputs, weights[order].T, strict=True)):
        axis.barh(place, w, color=np.where(w >= 0, DARK, MIDDLE), height=0.7)
        axis.axvline(0, color=INK, lw=0.7)
        title = f"change of {readable(name)}"
        largest = order[np.argsort(-np.abs(w), kind="stable")[:3]]
        words.append(f"{title}: " + ", ".join(f"{readable(inputs[i])} {weights[i, o]:+.2f}" for i in largest))
        axis.set_title(title.replace(" of joint", "\nof joint") if columns > 1 else title)
        axis.set_xlabel("standardised weight [-]")
        axis.set_xlim(-limit, limit)
    for axis in axes[:, 0]:
        axis.set_yticks(place, [readable(inputs[i]) for i in order])
        axis.set_ylabel("input")
    figure.alt = f"Standardised weights of a least-squares fit, the largest first. {'; '.join(words)}."
    return figure


def readable(name: str) -> str:
    """Return the name of an input for people: ``pressure 1 [k-1]`` for ``pressure_1[k-1]``."""
    return name.replace("_", " ").replace("[", " [")


def _largest_first(weights: Array) -> NDArray[np.int64]:
    return np.argsort(-np.abs(weights).max(axis=1, initial=0), kind="stable")
