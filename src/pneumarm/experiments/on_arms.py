"""What rows of movements on several arms say: intervals by arm, courses over movements, pictures of both.

Runs on one arm share its simulation, so the arms are the sample: figures are averaged over the runs of each arm
first. Where there is one arm alone its runs are the sample, and what is found is true of that arm.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from pneumarm.experiments.differences import Interval, interval
from pneumarm.experiments.experiment import Row, Rows
from pneumarm.experiments.moving import from_series
from pneumarm.report.page import Table
from pneumarm.report.style import DARK, GREY, INK, LIGHT, MIDDLE, key, legend_below, panels, styled

Array = NDArray[np.float64]
_INKS = ((DARK, "-", "o"), (MIDDLE, "--", "s"), (GREY, "-.", "^"), (LIGHT, ":", "D"), (INK, (0, (1, 1)), "v"))


def thesis(package: str) -> dict[str, Any]:
    """Return the thesis' numbers in ``package``/thesis.toml."""
    return tomllib.loads((resources.files(package) / "thesis.toml").read_text(encoding="utf-8"))


def of_trial(rows: Rows, trial: int) -> list[list[Row]]:
    """Return the rows of ``trial`` arm by arm."""
    return [[row for row in rows.rows if (row.arm, row.trial) == (arm, trial)] for arm in rows.arms]


def values(rows: Rows, figure: str, trial: int) -> Array:
    """Return ``figure`` of ``trial``, shape (arms, runs); NaN in rows that have none, as no successes no actions."""
    found = [[row.figures.get(figure, math.nan) for row in runs] for runs in of_trial(rows, trial)]
    return np.array(found, np.float64)


def over_arms(table: ArrayLike) -> Interval:
    """Return the mean of ``table`` (arms, runs) with its interval; NaN entries do not count."""
    found = np.atleast_2d(np.asarray(table, np.float64))
    samples = np.array([runs[~np.isnan(runs)].mean() for runs in found if not np.isnan(runs).all()])
    if len(found) == 1:
        samples = found[0][~np.isnan(found[0])]
    return interval(samples) if len(samples) else Interval(math.nan, math.inf, 0)


def mean(rows: Rows, figure: str, trial: int) -> Interval:
    """Return the mean of ``figure`` in ``trial``."""
    return over_arms(values(rows, figure, trial))


def difference(rows: Rows, figure: str, trial: int, other: int) -> Interval:
    """Return by how much ``figure`` is more in ``trial`` than in ``other``, within runs."""
    return over_arms(values(rows, figure, trial) - values(rows, figure, other))


def blocks(rows: Rows, figure: str, trial: int) -> Array:
    """Return the course of ``figure`` in ``trial`` as of :func:`~.moving.course`, shape (arms, runs, blocks)."""
    count = 0
    while any(f"{name} @{count + 1}" in row.figures for row in rows.rows for name in ("reward",)):
        count += 1
    found = [values(rows, f"{figure} @{k + 1}", trial) for k in range(count)]
    return np.stack(found, axis=-1)


def series_of(rows: Rows, name: str, trial: int) -> Array:
    """Return what :func:`~.moving.series` put into all rows of ``trial``, one after the other."""
    return np.concatenate([from_series(row.figures, name) for runs in of_trial(rows, trial) for row in runs])


def plain(found: Interval, digits: int = 2, factor: float = 1.0) -> str:
    """Return ``factor`` times a mean and its interval for people."""
    if found.samples == 0:
        return "none"
    half = f" ± {abs(factor) * found.half:.{digits}f}" if math.isfinite(found.half) else ""
    return f"{factor * found.mean:.{digits}f}{half}"


def number(found: Interval) -> dict[str, Any]:
    """Return an interval for programs."""
    return {"mean": found.mean, "half": found.half, "samples": found.samples}


class Column(NamedTuple):
    """A figure as a column of a table."""

    figure: str
    words: str
    digits: int = 2
    factor: float = 1.0


def table(rows: Rows, trials: Mapping[int, str], columns: Sequence[Column], caption: str) -> Table:
    """Return the means of ``columns`` by trial with their intervals."""
    lines = [
        [words, *(plain(mean(rows, c.figure, trial), c.digits, c.factor) for c in columns)]
        for trial, words in trials.items()
    ]
    return Table(["trial", *(column.words for column in columns)], lines, caption)


class Curve(NamedTuple):
    """A course over movements."""

    name: str
    blocks: Array
    """Shape (arms, runs, blocks)."""
    before: float = math.nan
    """Mean in the simulation, drawn as a level."""


@styled
def courses_figure(
    quantities: Mapping[str, Sequence[Curve]], block: int, marks: Mapping[float, str] | None = None
) -> Figure:
    """Draw the courses of quantities over the movements on the arm: means over arms, with 95 % bands.

    Args:
        quantities: by the label of their axis.
        block: movements in each block.
        marks: what happened after how many movements.

    """
    figure, axes = panels(len(quantities), 1, 0.8 + 1.75 * len(quantities), sharex=True)
    names: dict[str, Any] = {}
    for place, (label, curves) in zip(axes[:, 0], quantities.items(), strict=True):
        place.set_ylabel(label)
        for (color, style, marker), curve in zip(_INKS, curves, strict=False):
            found = [over_arms(curve.blocks[:, :, k]) for k in range(curve.blocks.shape[-1])]
            x = block * (np.arange(len(found)) + 0.5)
            middle = np.array([one.mean for one in found])
            half = np.array([one.half if math.isfinite(one.half) else 0.0 for one in found])
            place.fill_between(x, middle - half, middle + half, color=color, alpha=0.15, lw=0)
            place.plot(x, middle, color=color, ls=style, marker=marker, ms=3)
            if math.isfinite(curve.before):
                place.axhline(curve.before, color=color, ls=style, lw=0.8, alpha=0.7)
            names[curve.name] = key(color, style, marker=marker)
        if "%" in label:
            place.set_ylim(top=min(place.get_ylim()[1], 101.0))
        for where in marks or {}:
            place.axvline(where, color=INK, ls=":", lw=1)
    for where, words in (marks or {}).items():
        axes[0, 0].annotate(words, (where, 1), xycoords=("data", "axes fraction"), xytext=(3, -2),
                            textcoords="offset points", ha="left", va="top", fontsize=8)  # fmt: skip
    axes[-1, 0].set_xlabel("movements on the arm [-]")
    axes[-1, 0].set_xlim(0)
    legend_below(figure, list(names.values()), list(names))
    figure.align_ylabels(axes[:, 0])
    return figure


def courses_alt(quantities: Mapping[str, Sequence[Curve]]) -> str:
    """Say in words what :func:`courses_figure` shows."""
    said = []
    for label, curves in quantities.items():
        ends = []
        for curve in curves:
            first, last = (plain(over_arms(curve.blocks[:, :, k])) for k in (0, -1))
            ends.append(f"{curve.name} from {first} to {last}")
        said.append(f"{label.replace(chr(10), ' ')}: {', '.join(ends)}")
    return ". ".join(said) + "."


@styled
def dots_figure(names: Sequence[str], quantities: Mapping[str, Sequence[Interval]], zero: bool = False) -> Figure:
    """Draw one line a name and one panel a quantity, means as dots with their 95 % intervals.

    Args:
        names: from top to bottom.
        quantities: by the label of their axis, an interval a name.
        zero: whether 0 is marked, where differences are drawn.

    """
    figure, axes = panels(1, len(quantities), 0.9 + 0.28 * len(names), sharey=True)
    places = np.arange(len(names))
    for axis, (label, found) in zip(axes[0], quantities.items(), strict=True):
        halves = [one.half if math.isfinite(one.half) else 0.0 for one in found]
        if zero:
            axis.axvline(0, color=INK, lw=0.8)
        axis.errorbar([one.mean for one in found], places, xerr=halves, fmt="o", color=DARK, capsize=3, lw=1.2)
        axis.set_xlabel(label)
        axis.grid(visible=False, axis="y")
    axes[0, 0].set_yticks(places, names)
    axes[0, 0].set_ylim(len(names) - 0.5, -0.5)
    return figure


def dots_alt(names: Sequence[str], quantities: Mapping[str, Sequence[Interval]]) -> str:
    """Say in words what :func:`dots_figure` shows."""
    said = [
        f"{label.replace(chr(10), ' ')}: "
        + ", ".join(f"{name} {plain(one)}" for name, one in zip(names, found, strict=True))
        for label, found in quantities.items()
    ]
    return ". ".join(said) + "."
