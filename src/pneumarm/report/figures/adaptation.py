"""How well an adapting agent's simulation predicts the arm, movement after movement, and what became of the agent."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, GREY, INK, MIDDLE
from pneumarm.report.style import Described, key, legend_below, nothing, panels, styled
from pneumarm.statistics import moving_mean

Array = NDArray[np.float64]
RATIO_WINDOW = 20
"""Movements in a moving mean."""


class CurveMark(NamedTuple):
    """Something that happened after a movement."""

    movement: int
    what: str
    """``noticed``, ``accepted`` or ``rolled back``; anything else is not drawn."""


_MARKS = {"noticed": (MIDDLE, "v", "change noticed"), "accepted": (DARK, "^", "new version")}
_MARKS["rolled back"] = (INK, "X", "version rolled back")


@styled
def adaptation_curves(
    squares: Array, quantities: Sequence[str], marks: Sequence[CurveMark], tolerated: float
) -> Described:
    """Draw the error of the simulation on the arm over that of its fit.

    Args:
        squares: mean squared error in each movement over that of the fit, shape (movements, 2, quantities): of the
            simulation that arrived, and of the one in use.
        quantities: their names.
        marks: what happened, and when.
        tolerated: ratio up to which the arm counts as unchanged.

    """
    figure, axes = panels(len(quantities), 1, 0.9 + 1.6 * len(quantities), sharex=True)
    for place, quantity, of_it in zip(axes[:, 0], quantities, np.moveaxis(squares, 2, 0), strict=True):
        place.set_ylabel(f"error of\n{quantity.replace('_', ' ')} [-]")
        if len(of_it) == 0:
            nothing(place, "no movements on the arm")
            continue
        place.axhline(tolerated, color=GREY, ls=":", lw=1.2)
        for column, (color, dashes) in zip(of_it.T, ((MIDDLE, "--"), (DARK, "-")), strict=True):
            smooth = moving_mean(column, RATIO_WINDOW)
            place.plot(smooth.position + 1, np.sqrt(smooth.mean), color=color, ls=dashes)
        place.set_ylim(bottom=0)
        for mark in marks:
            if mark.what in _MARKS:
                color, shape, _ = _MARKS[mark.what]
                place.axvline(mark.movement, color=color, lw=0.7, alpha=0.6)
                place.plot(
                    mark.movement, 0.04, color=color, marker=shape, transform=place.get_xaxis_transform(), ls=""
                )
        place.set_xlim(0, max(len(of_it), 1))
    axes[-1, 0].set_xlabel("movements on the arm [-]")
    handles = [key(MIDDLE, "--"), key(DARK), key(GREY, ":")]
    labels = ["simulation that arrived", "simulation in use", "no change yet"]
    for what in dict.fromkeys(mark.what for mark in marks):
        if what in _MARKS:
            color, shape, words = _MARKS[what]
            handles.append(key(color, "", marker=shape))
            labels.append(words)
    legend_below(figure, handles, labels)
    figure.align_ylabels(axes[:, 0])
    figure.alt = "No movements were made on the arm."
    if len(squares):
        first, last = (np.sqrt(part.mean(axis=0)) for part in (squares[:100], squares[-100:]))
        errors = "; ".join(
            f"{name.replace('_', ' ')} {first[1, i]:.2f} in the first hundred movements, {last[1, i]:.2f} in the "
            f"last ({last[0, i]:.2f} with the simulation that arrived)"
            for i, name in enumerate(quantities)
        )
        happened = "; ".join(
            f"{_MARKS[mark.what][2]} after movement {mark.movement}" for mark in marks if mark.what in _MARKS
        )
        figure.alt = f"Error of the simulation in use over that of its fit: {errors}." + f" {happened}." * bool(
            happened
        )
    return figure
