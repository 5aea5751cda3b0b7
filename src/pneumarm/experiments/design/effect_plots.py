"""Pictures of an analysis: effects plots and half-normal probability plots."""

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pneumarm.drawing.colours import DARK, GREY, INK, LIGHT, MIDDLE, PALE
from pneumarm.experiments.design.analysis import TableAnalysis
from pneumarm.experiments.design.effects import Effects
from pneumarm.experiments.design.half_normal import percentages, positions
from pneumarm.report.style import panels, styled

_STYLES = tuple((colour, line) for line in ("-", "--", ":", "-.") for colour in (DARK, MIDDLE, LIGHT, GREY))
_MARKERS = "osD^vP*X"
_PER_ROW = 16  # columns of an array side by side
_MOST_NAMED = 8  # lines that can be distinguished; more are drawn alike
_LABEL, _HALF_LABEL = 34, 40  # letters in a line of an axis label
_REACH = 0.32  # of a column's levels to both sides of its place


@styled
def effects_figure(analysis: TableAnalysis, lines: Mapping[str, Effects], quantity: str) -> Figure:
    """Draw the average at each level of each column, a line for each of ``lines`` (thesis fig. 5.1 to 5.3)."""
    array = analysis.design.array
    rows = -(-array.columns // _PER_ROW)
    figure, axes = panels(rows, 1, 0.5 + 2.6 * rows, sharey=True)
    labels = analysis.design.labels()
    for row in range(rows):
        axis = axes[row, 0]
        columns = range(row * _PER_ROW, min((row + 1) * _PER_ROW, array.columns))
        for number, (name, found) in enumerate(lines.items()):
            drawn = _drawn(number, len(lines))
            for place, column in enumerate(columns):
                average = found.averages[column]
                x = place + np.linspace(-_REACH, _REACH, len(average))
                label = name if place == 0 and row == 0 else None
                axis.plot(x, average, markersize=3, label=label, **drawn)
        for place in range(1, len(columns)):
            axis.axvline(place - 0.5, color=PALE, linewidth=0.6)
        axis.set_xticks(range(len(columns)), [f"{c + 1}\n{labels[c]}" for c in columns])
        axis.set_xlim(-0.5, len(columns) - 0.5)
        axis.grid(visible=False, axis="x")
        axis.set_ylabel(textwrap.fill(quantity, _LABEL))
    axes[-1, 0].set_xlabel("column of the array and what is on it; levels from left to right")
    if 1 < len(lines) <= _MOST_NAMED:
        figure.legend(loc="outside upper center", ncols=len(lines))
    return figure


@styled
def half_normal_figure(analysis: TableAnalysis, names: tuple[str, ...], quantity: str) -> Figure:
    """Draw the effects on each of the losses ``names`` against the half-normal axis (thesis fig. 5.4, 5.5)."""
    figure, axes = panels(1, len(names), 3.6)
    columns = analysis.design.array.columns
    y, percent = positions(columns), percentages(columns)
    for axis, name in zip(axes[0], names, strict=True):
        found = analysis.effects[name]
        ascending = np.array(found.ranking[::-1]) - 1
        sizes = found.sizes[ascending]
        axis.plot(sizes, y, "o", color=DARK, label="effects")
        limit = 1.25 * float(sizes[-1]) or 1.0  # where nothing varies all effects are 0
        if name in analysis.lenth and analysis.lenth[name].pseudo_standard_error > 0:
            test = analysis.lenth[name]
            top = min(y[-1], sizes[-1] / test.pseudo_standard_error)
            axis.plot([0, top * test.pseudo_standard_error], [0, top], color=GREY, linewidth=1, label="noise (Lenth)")
            for margin, style, label in (
                (test.margin, "--", "margin of error"),
                (test.simultaneous_margin, ":", "simultaneous margin"),
            ):
                if margin < limit:
                    axis.axvline(margin, color=MIDDLE, linestyle=style, label=label)
        for place, column in enumerate(ascending):
            label = f"{column + 1} {analysis.design.label(int(column) + 1)}".strip()
            axis.annotate(
                label, (sizes[place], y[place]), xytext=(5, -3), textcoords="offset points", fontsize=7, color=INK
            )
        axis.set_yticks(y, [f"{p:.1f}" for p in percent])
        axis.set_xlim(0, limit)
        axis.set_ylim(0, y[-1] * 1.08)
        axis.set_xlabel(textwrap.fill(f"estimated effect on the {name}{_unit(quantity)}", _HALF_LABEL))
        axis.set_title(name)
        axis.legend(loc="lower right")
    axes[0, 0].set_ylabel("probability [%]")
    return figure


@styled
def half_normal_runs_figure(analysis: TableAnalysis, quantity: str) -> Figure:
    """Draw the effects in each run apart against the half-normal axis, a line a run (thesis fig. C.2)."""
    figure, axes = panels(1, 1, 3.6)
    axis, columns = axes[0, 0], analysis.design.array.columns
    y, percent = positions(columns), percentages(columns)
    for number, found in enumerate(analysis.runs):
        drawn = {**_drawn(number, len(analysis.runs)), "linewidth": 0.8}
        axis.plot(np.sort(found.sizes), y, label=f"run {number + 1}", **drawn)
    axis.set_yticks(y, [f"{p:.1f}" for p in percent])
    axis.set_xlim(0, None)
    axis.set_xlabel(f"estimated effect on the {quantity}")
    axis.set_ylabel("probability [%]")
    if len(analysis.runs) <= _MOST_NAMED:
        figure.legend(loc="outside upper center", ncols=len(analysis.runs))
    return figure


def _drawn(number: int, of: int) -> dict[str, Any]:
    """Return how line ``number`` is drawn: distinguishable where there are few, else thin."""
    if of > _MOST_NAMED:
        return {"color": GREY, "linewidth": 0.7, "alpha": 0.7}
    colour, style = _STYLES[number % len(_STYLES)]
    return {"color": colour, "linestyle": style, "marker": _MARKERS[number % len(_MARKERS)]}


def _unit(quantity: str) -> str:
    return f" of the {quantity}" if quantity else ""
