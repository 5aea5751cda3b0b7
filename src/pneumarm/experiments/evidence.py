"""What rows of several arms and runs say: means and differences by arm, tables and pictures of trials.

Runs on one arm share its simulation, so arms are the sample: values are averaged over the runs of each arm first.
Where there is one arm alone, its runs are the sample, and what is found is true of that arm.
"""

import math
import textwrap
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.experiments.differences import Interval, Verdict, interval
from pneumarm.experiments.experiment import Rows
from pneumarm.report.page import Table
from pneumarm.report.style import DARK, GREY, MIDDLE, key, legend_below, panels, styled

Array = NDArray[np.float64]

_SHORT = 12  # letters that are not broken over lines
_TITLE = 28  # letters of a panel's title in a line
_WIDE = 3  # panels side by side


def thesis(package: str) -> dict[str, Any]:
    """Return the thesis' numbers in ``package``/thesis.toml."""
    return tomllib.loads((resources.files(package) / "thesis.toml").read_text(encoding="utf-8"))


def samples(rows: Rows, figure: str, trial: int) -> Array:
    """Return ``figure`` of ``trial``: its means by arm, shape (arms,), or by run where there is one arm."""
    rows = Rows(tuple(row for row in rows.rows if row.trial == trial))  # others may not have the figure
    by_arm = [rows.table(figure, [trial], arm)[0] for arm in rows.arms]
    return by_arm[0] if len(by_arm) == 1 else np.array([runs.mean() for runs in by_arm])


def mean(rows: Rows, figure: str, trial: int) -> Interval:
    """Return the mean of ``figure`` over arms, with its interval."""
    return interval(samples(rows, figure, trial))


def difference(rows: Rows, figure: str, trial: int, reference: int) -> Interval:
    """Return by how much ``figure`` is larger in ``trial`` than in ``reference``, arm by arm."""
    return interval(samples(rows, figure, trial) - samples(rows, figure, reference))


def change(rows: Rows, figure: str, trial: int, reference: int) -> Interval:
    """Return by how many percent ``figure`` is larger in ``trial`` than in ``reference``, arm by arm."""
    return interval(100 * (samples(rows, figure, trial) / samples(rows, figure, reference) - 1))


def within(found: Interval, margin: float) -> Verdict:
    """Return whether what is estimated lies within ``margin`` of 0; open while the interval includes an end."""
    if max(abs(found.low), abs(found.high)) <= margin:
        return "holds"
    return "does not hold" if found.low > margin or found.high < -margin else "open"


def plain(found: Interval, digits: int = 2) -> str:
    """Return a value, not a difference, for people: without a sign where it is positive."""
    half = f" ± {found.half:.{digits}f}" if math.isfinite(found.half) else ""
    return f"{found.mean:.{digits}f}{half}"


def signed(found: Interval, digits: int = 2) -> str:
    """Return a difference for people, always with a sign."""
    return f"{'+' if found.mean >= 0 else ''}{plain(found, digits)}"


@dataclass(frozen=True)
class Column:
    """A figure of the rows, shown in a table or a picture."""

    figure: str
    """Its name in the rows."""
    words: str
    """What people call it, with its unit."""
    digits: int = 2
    factor: float = 1.0
    """That it is multiplied by to be shown."""
    thesis: Mapping[int, float] | None = None
    """What the thesis has, by trial."""


def table(rows: Rows, trials: Mapping[int, str], columns: Sequence[Column], caption: str) -> Table:
    """Return the means of ``columns`` by trial with their intervals, and beside them what the thesis has."""
    header = ["trial"]
    for column in columns:
        header += [column.words, *(["thesis"] if column.thesis else [])]
    lines = []
    for trial, words in trials.items():
        line = [words.replace(" ", "\N{NO-BREAK SPACE}") if len(words) < _SHORT else words]
        for column in columns:
            found = interval(column.factor * samples(rows, column.figure, trial))
            line.append(plain(found, column.digits))
            if column.thesis:
                line.append(f"{column.thesis[trial]:.{column.digits}f}" if trial in column.thesis else "")
        lines.append(line)
    return Table(header, lines, caption)


def numbers(rows: Rows, trials: Mapping[int, str], columns: Sequence[Column]) -> dict[str, Any]:
    """Return for programs what :func:`table` shows."""
    found = {
        column.figure: {
            words: {"mean": one.mean, "half": one.half if math.isfinite(one.half) else None}
            for trial, words in trials.items()
            for one in [mean(rows, column.figure, trial)]
        }
        for column in columns
    }
    return {"ours": found}


@styled
def picture(
    rows: Rows,
    trials: Sequence[int],
    places: Sequence[float],
    ticks: Sequence[str],
    label: str,
    columns: Sequence[Column],
    log: bool = False,
) -> Figure:
    """Draw ``columns`` against the trials, a panel each: every arm thin, the mean with its interval, the thesis' own.

    Args:
        rows: of all arms.
        trials: to draw, from left to right.
        places: where they are on the axis, shape as ``trials``.
        ticks: what is written there.
        label: of the axis, with its unit.
        columns: at least one.
        log: whether the axis is logarithmic.

    """
    height = -(-len(columns) // _WIDE)
    width = -(-len(columns) // height)
    figure, axes = panels(height, width, 0.4 + 2.5 * height)
    compared = False
    for axis in axes.flat[len(columns) :]:
        axis.set_visible(False)
    for axis, column in zip(axes.flat, columns, strict=False):
        found = column.factor * np.array([samples(rows, column.figure, trial) for trial in trials])
        axis.plot(places, found, color=GREY, lw=0.7)
        intervals = [interval(one) for one in found]
        half = [one.half if math.isfinite(one.half) else 0.0 for one in intervals]
        axis.errorbar(places, [one.mean for one in intervals], half, color=DARK, marker="o", lw=1.6, capsize=3)
        if column.thesis:
            compared = True
            there = [(places[i], column.thesis[t]) for i, t in enumerate(trials) if t in column.thesis]
            axis.plot(*zip(*there, strict=True), color=MIDDLE, marker="s", ls="none")  # not of one arm: no line
        axis.set_title(textwrap.fill(column.words, _TITLE))
        axis.set_xlabel(label)
        if log:
            axis.set_xscale("log")
        axis.set_xticks(places, ticks)
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


def seen(rows: Rows, trials: Mapping[int, str], columns: Sequence[Column]) -> str:
    """Say in words what :func:`picture` shows."""
    said = []
    for column in columns:
        values = [
            f"{plain(interval(column.factor * samples(rows, column.figure, trial)), column.digits)} ({words})"
            for trial, words in trials.items()
        ]
        said.append(f"{column.words}: {', '.join(values)}")
    return ". ".join(said) + "."
