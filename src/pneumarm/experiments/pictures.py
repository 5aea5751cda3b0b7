"""Pictures of rows with their words: trials as dots, trials against a quantity, courses over movements."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from pneumarm.drawing.colours import DARK, GREY, INK, LIGHT, MIDDLE, PALE
from pneumarm.experiments.experiment import Axis, TrialRows
from pneumarm.experiments.means import Array, estimate, over_arms, samples, text
from pneumarm.experiments.verdict import Interval
from pneumarm.experiments.words import Column
from pneumarm.report.page import Picture
from pneumarm.report.style import key, legend_below, panels, styled

_INKS = ((DARK, "-", "o"), (MIDDLE, "--", "s"), (GREY, "-.", "^"), (LIGHT, ":", "D"), (INK, (0, (1, 1)), "v"))
_LABEL = 66  # letters of the labels of all axes side by side
_TICKS, _FEWEST_TICKS = 9, 4  # numbers on the axes of all panels side by side, and on one at least
_TITLE = 28  # letters of a panel's title in a line
_WIDE = 3  # panels side by side


class Curve(NamedTuple):
    """A course over movements."""

    name: str
    blocks: Array
    """Shape (arms, runs, blocks)."""
    before: float = math.nan
    """Mean in the simulation, drawn as a level."""

    @property
    def intervals(self) -> list[Interval]:
        """Means over arms by block."""
        return [over_arms(self.blocks[:, :, k]) for k in range(self.blocks.shape[-1])]


def courses(
    quantities: Mapping[str, Sequence[Curve]], block: int, caption: str, marks: Mapping[float, str] | None = None
) -> Picture:
    """Return the courses of quantities over the movements on the arm: means over arms, with 95 % bands.

    Args:
        quantities: by the label of their axis.
        block: movements in each block.
        caption: what is seen.
        marks: what happened after how many movements.

    """
    said = []
    for label, curves in quantities.items():
        ends = [f"{c.name} from {c.intervals[0]:.2f} to {c.intervals[-1]:.2f}" for c in curves]
        said.append(f"{_line(label)}: {', '.join(ends)}")
    return Picture(partial(_courses, quantities, block, marks or {}), caption, ". ".join(said) + ".")


@styled
def _courses(quantities: Mapping[str, Sequence[Curve]], block: int, marks: Mapping[float, str]) -> Figure:
    figure, axes = panels(len(quantities), 1, 0.8 + 1.75 * len(quantities), sharex=True)
    names: dict[str, Any] = {}
    for place, (label, curves) in zip(axes[:, 0], quantities.items(), strict=True):
        place.set_ylabel(label)
        for (color, style, marker), curve in zip(_INKS, curves, strict=False):
            found = curve.intervals
            x = block * (np.arange(len(found)) + 0.5)
            middle, half = np.array([one.mean for one in found]), np.array(_halves(found))
            place.fill_between(x, middle - half, middle + half, color=color, alpha=0.15, lw=0)
            place.plot(x, middle, color=color, ls=style, marker=marker, ms=3)
            if math.isfinite(curve.before):
                place.axhline(curve.before, color=color, ls=style, lw=0.8, alpha=0.7)
            names[curve.name] = key(color, style, marker=marker)
        if "%" in label:
            place.set_ylim(top=min(place.get_ylim()[1], 101.0))
        for where in marks:
            place.axvline(where, color=INK, ls=":", lw=1)
    for where, words in marks.items():
        axes[0, 0].annotate(words, (where, 1), xycoords=("data", "axes fraction"), xytext=(3, -2),
                            textcoords="offset points", ha="left", va="top", fontsize=8)  # fmt: skip
    axes[-1, 0].set_xlabel("movements on the arm [-]")
    axes[-1, 0].set_xlim(0)
    legend_below(figure, list(names.values()), list(names))
    figure.align_ylabels(axes[:, 0])
    return figure


def dots(
    names: Sequence[str],
    quantities: Mapping[str, Sequence[Interval]],
    caption: str,
    *,
    zero: bool = False,
    reference: int | None = None,
) -> Picture:
    """Return a line a name and a panel a quantity, means as dots with their 95 % intervals.

    Args:
        names: from top to bottom.
        quantities: by the label of their axis, an interval a name.
        caption: what is seen.
        zero: whether 0 is marked, where differences are drawn.
        reference: place of the name whose means are drawn through all lines, where others are compared with it.

    """
    said = [
        f"{_line(label)}: " + ", ".join(f"{name} {one:.2f}" for name, one in zip(names, found, strict=True))
        for label, found in quantities.items()
    ]
    return Picture(partial(_dots, names, quantities, zero, reference), caption, ". ".join(said) + ".")


@styled
def _dots(
    names: Sequence[str], quantities: Mapping[str, Sequence[Interval]], zero: bool, reference: int | None
) -> Figure:
    figure, axes = panels(1, len(quantities), 0.9 + 0.28 * len(names), sharey=True)
    places = np.arange(len(names))
    for axis, (label, found) in zip(axes[0], quantities.items(), strict=True):
        if zero:
            axis.axvline(0, color=INK, lw=0.8)
        if reference is not None:
            axis.axvline(found[reference].mean, color=PALE, lw=1.2)
        means = [one.mean for one in found]
        axis.errorbar(means, places, xerr=_halves(found), fmt="o", color=DARK, capsize=3, lw=1.2)
        axis.set_xlabel(label if "\n" in label else textwrap.fill(label, _LABEL // len(quantities)))
        axis.grid(visible=False, axis="y")
        axis.locator_params(axis="x", nbins=max(_FEWEST_TICKS, _TICKS // len(quantities)))
    axes[0, 0].set_yticks(places, names)
    axes[0, 0].set_ylim(len(names) - 0.5, -0.5)
    return figure


def against(
    rows: TrialRows, trials: Mapping[int, str], axis: Axis, columns: Sequence[Column], caption: str
) -> Picture:
    """Return ``columns`` against the trials, a panel each: every arm thin, the mean with its interval, the thesis'.

    Args:
        rows: of all arms.
        trials: to draw, from left to right, in words.
        axis: where they are.
        columns: at least one.
        caption: what is seen.

    """
    said = [
        f"{column.words}: " + ", ".join(f"{text(rows, column, trial)} ({words})" for trial, words in trials.items())
        for column in columns
    ]
    return Picture(partial(_against, rows, trials, axis, columns), caption, ". ".join(said) + ".")


@styled
def _against(rows: TrialRows, trials: Mapping[int, str], along: Axis, columns: Sequence[Column]) -> Figure:
    height = -(-len(columns) // _WIDE)
    width = -(-len(columns) // height)
    figure, axes = panels(height, width, 0.4 + 2.5 * height)
    places = along.places
    compared = False
    for axis in axes.flat[len(columns) :]:
        axis.set_visible(False)
    for axis, column in zip(axes.flat, columns, strict=False):
        axis.plot(places, [column.factor * samples(rows, column.figure, t) for t in trials], color=GREY, lw=0.7)
        found = [estimate(rows, column, trial) for trial in trials]
        means = [one.mean for one in found]
        axis.errorbar(places, means, _halves(found), color=DARK, marker="o", lw=1.6, capsize=3)
        if column.thesis:
            compared = True
            named = zip(places, trials.values(), strict=True)
            there = [(place, column.thesis[words]) for place, words in named if words in column.thesis]
            axis.plot(*zip(*there, strict=True), color=MIDDLE, marker="s", ls="none")  # not of one arm: no line
        axis.set_title(textwrap.fill(column.words, _TITLE))
        axis.set_xlabel(along.label)
        if along.log:
            axis.set_xscale("log")
        axis.set_xticks(places, along.ticks or [f"{place:g}" for place in places])
        axis.set_xticks([], minor=True)
        axis.margins(x=0.08)
    single = "one arm" if len(rows.arms) > 1 else "one run"
    handles = [key(DARK, marker="o"), key(GREY, lw=0.7)]
    names = ["mean; bars: its 95 % interval", single]
    if compared:
        handles.append(key(MIDDLE, "none", marker="s"))
        names.append("thesis")
    legend_below(figure, handles, names)
    return figure


def _halves(found: Sequence[Interval]) -> list[float]:
    return [one.half if math.isfinite(one.half) else 0.0 for one in found]


def _line(label: str) -> str:
    return label.replace("\n", " ")
