"""What rows of several arms and runs say: means and differences over arms, courses, tables of trials.

Runs on one arm share its simulation, so the arms are the sample: figures are averaged over the runs of each arm
first. Where there is one arm alone its runs are the sample, and what is found is true of that arm.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.experiments.differences import Interval, interval
from pneumarm.experiments.experiment import Row, TrialRows
from pneumarm.experiments.words import Column, Quantity
from pneumarm.report.page import Table

Array = NDArray[np.float64]
_SHORT = 12  # letters that are not broken over lines


# Rows -----------------------------------------------------------------------------------------------------------


def of_trial(rows: TrialRows, trial: int) -> list[list[Row]]:
    """Return the rows of ``trial`` arm by arm."""
    return [[row for row in rows.rows if (row.arm, row.trial) == (arm, trial)] for arm in rows.arms]


def values(rows: TrialRows, figure: str, trial: int) -> Array:
    """Return ``figure`` of ``trial``, shape (arms, runs); NaN in rows that have none, as no successes no actions."""
    found = [[row.figures.get(figure, math.nan) for row in runs] for runs in of_trial(rows, trial)]
    return np.array(found, np.float64)


def blocks(rows: TrialRows, figure: str, trial: int) -> Array:
    """Return the course of ``figure`` in ``trial`` as of :func:`~.moving.course`, shape (arms, runs, blocks).

    A block in which nothing succeeded has no actions; there are as many blocks as there are of rewards.
    """
    count = 0
    while any(f"reward @{count + 1}" in row.figures for row in rows.rows):
        count += 1
    return np.stack([values(rows, f"{figure} @{k + 1}", trial) for k in range(count)], axis=-1)


def series(name: str, values: Any) -> dict[str, float]:
    """Return an array of one dimension as figures of a row."""
    return {f"{name} #{i}": float(value) for i, value in enumerate(np.asarray(values, np.float64))}


def from_series(figures: Mapping[str, float], name: str) -> Array:
    """Return what :func:`series` put into the ``figures`` of a row."""
    found: list[float] = []
    while (key := f"{name} #{len(found)}") in figures:
        found.append(figures[key])
    return np.array(found)


def series_of(rows: TrialRows, name: str, trial: int) -> Array:
    """Return what :func:`series` put into all rows of ``trial``, one after the other."""
    return np.concatenate([from_series(row.figures, name) for runs in of_trial(rows, trial) for row in runs])


# Means and differences ------------------------------------------------------------------------------------------


def by_arm(table: ArrayLike) -> Array:
    """Return the samples of ``table`` (arms, runs): its means by arm, or of one arm its runs.

    NaN entries do not count; NaN where nothing else is left.
    """
    found = np.atleast_2d(np.asarray(table, np.float64))
    if len(found) == 1:
        return found[0]
    known = [runs[~np.isnan(runs)] for runs in found]
    return np.array([runs.mean() if len(runs) else math.nan for runs in known])


def samples(rows: TrialRows, figure: str, trial: int) -> Array:
    """Return ``figure`` of ``trial``: its means by arm, shape (arms,), or by run where there is one arm."""
    return by_arm(values(rows, figure, trial))


def over_arms(table: ArrayLike) -> Interval:
    """Return the mean of ``table`` (arms, runs) with its interval; NaN entries do not count."""
    found = by_arm(table)
    known = found[~np.isnan(found)]
    return interval(known) if len(known) else Interval(math.nan, math.inf, 0)


def mean(rows: TrialRows, figure: str, trial: int) -> Interval:
    """Return the mean of ``figure`` in ``trial`` over arms."""
    return over_arms(values(rows, figure, trial))


def estimate(rows: TrialRows, quantity: Quantity, trial: int, base: int | None = None) -> Interval:
    """Return the mean of ``quantity`` over arms in ``trial``, less that in ``base``, its base if it has one."""
    if quantity.percent:
        other = samples(rows, quantity.less or quantity.figure, trial if base is None else base)
        return interval(100 * (samples(rows, quantity.figure, trial) / other - 1))

    def of(trial: int) -> Array:
        found = values(rows, quantity.figure, trial)
        return found if quantity.less is None else found - values(rows, quantity.less, trial)

    return over_arms(quantity.factor * (of(trial) if base is None else of(trial) - of(base)))


def difference(rows: TrialRows, figure: str, trial: int, reference: int) -> Interval:
    """Return by how much ``figure`` is more in ``trial`` than in ``reference``, within runs."""
    return over_arms(values(rows, figure, trial) - values(rows, figure, reference))


def change(rows: TrialRows, figure: str, trial: int, reference: int) -> Interval:
    """Return by how many percent ``figure`` is larger in ``trial`` than in ``reference``, arm by arm."""
    return interval(100 * (samples(rows, figure, trial) / samples(rows, figure, reference) - 1))


# For people and programs ----------------------------------------------------------------------------------------


def text(rows: TrialRows, column: Column, trial: int) -> str:
    """Return the mean of ``column`` in ``trial`` for people."""
    return f"{estimate(rows, column, trial):.{column.digits}f}"


def means_table(rows: TrialRows, trials: Mapping[int, str], columns: Sequence[Column], caption: str) -> Table:
    """Return the means of ``columns`` by trial with their intervals, and beside them what the thesis has."""
    header = ["trial"]
    for column in columns:
        header += [column.words, *(["thesis"] if column.thesis else [])]
    lines = []
    for trial, words in trials.items():
        line = [words.replace(" ", "\N{NO-BREAK SPACE}") if len(words) < _SHORT else words]
        for column in columns:
            line.append(text(rows, column, trial))
            if column.thesis:
                line.append(f"{column.thesis[words]:.{column.digits}f}" if words in column.thesis else "")
        lines.append(line)
    return Table(header, lines, caption)


def numbers(rows: TrialRows, trials: Mapping[int, str], columns: Sequence[Column]) -> dict[str, Any]:
    """Return for programs the means of the figures that :func:`means_table` shows, by trial."""
    return {
        column.figure: {
            words: {"mean": one.mean, "half": one.half}
            for trial, words in trials.items()
            for one in [mean(rows, column.figure, trial)]
        }
        for column in columns
    }
