"""What rows of several arms and runs say: means and differences over arms, courses, tables of trials.

The arms are the sample (:mod:`.verdict`): runs are reduced to a number of each arm first, by their mean and beside it
by their median. Where there is one arm alone its runs are the sample, and what is found is true of that arm.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.experiments.experiment import Row, TrialRows
from pneumarm.experiments.verdict import Interval, interval
from pneumarm.experiments.words import Column, Quantity
from pneumarm.report.page import Table
from pneumarm.statistics import wilson

Array = NDArray[np.float64]
_SHORT = 12  # letters that are not broken over lines


# Rows -----------------------------------------------------------------------------------------------------------


def of_trial(rows: TrialRows, trial: int) -> list[list[Row]]:
    """Return the rows of ``trial`` arm by arm."""
    found: dict[str, list[Row]] = {arm: [] for arm in rows.arms}
    for row in rows.of([trial]).rows:
        found[row.arm].append(row)
    return list(found.values())


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


def by_arm(table: ArrayLike, reduced: Callable[[Array], Any] = np.mean) -> Array:
    """Return the samples of ``table`` (arms, runs): its means by arm, or of one arm its runs.

    NaN entries do not count; NaN where nothing else is left. In place of the mean runs may be ``reduced`` otherwise.
    """
    found = np.atleast_2d(np.asarray(table, np.float64))
    if len(found) == 1:
        return found[0]
    known = [runs[~np.isnan(runs)] for runs in found]
    return np.array([reduced(runs) if len(runs) else math.nan for runs in known])


def samples(rows: TrialRows, figure: str, trial: int) -> Array:
    """Return ``figure`` of ``trial``: its means by arm, shape (arms,), or by run where there is one arm."""
    return by_arm(values(rows, figure, trial))


def over_arms(
    *tables: ArrayLike,
    combined: Callable[..., Array] | None = None,
    share: bool = False,
    limited: bool = False,
) -> Interval:
    """Return the mean of tables (arms, runs) over arms with its interval, and beside it that of their medians.

    Args:
        tables: NaN entries do not count.
        combined: makes one array of those of several tables, once each is reduced to its arms.
        share: whether all are 0 or 1; where no arm differs, each counts once in Wilson's interval of the share.
        limited: see :attr:`.Interval.limited`.

    """
    made = [np.atleast_2d(np.asarray(table, np.float64)) for table in tables]
    arms = int((~np.isnan(made[0])).any(axis=1).sum())
    found = []
    for reduced in (np.mean, np.median):
        parts = [by_arm(table, reduced) for table in made]
        whole = parts[0] if combined is None else combined(*parts)
        known = whole[~np.isnan(whole)]
        if not len(known):
            return Interval(math.nan, math.inf, 0)
        found.append(interval(known, arms))
    plain, robust = found
    if share and arms > 1 and plain.half == 0:
        plain = plain._replace(half=max(abs(float(end) - plain.mean) for end in wilson(plain.mean * arms, arms)))
    alike = share or (~np.isnan(made[0])).sum(axis=1).max() < 2  # one run is its mean and its median
    return plain._replace(median=None if alike else robust, limited=limited)


def at_limit(*tables: ArrayLike) -> bool:
    """Return whether most of the numbers in ``tables`` are the least or the largest of all, which differ."""
    found = np.concatenate([np.ravel(np.asarray(table, np.float64)) for table in tables])
    found = found[~np.isnan(found)]
    if not len(found) or np.isin(found, (0, 1)).all():
        return False
    return bool(max((found == found.min()).mean(), (found == found.max()).mean()) > 1 / 2)


def mean(rows: TrialRows, figure: str, trial: int) -> Interval:
    """Return the mean of ``figure`` in ``trial`` over arms."""
    return over_arms(values(rows, figure, trial))


def estimate(rows: TrialRows, quantity: Quantity, trial: int, base: int | None = None) -> Interval:
    """Return the mean of ``quantity`` over arms in ``trial``, less that in ``base``, its base if it has one."""
    if quantity.percent:
        other = values(rows, quantity.less or quantity.figure, trial if base is None else base)
        first = values(rows, quantity.figure, trial)
        return over_arms(first, other, combined=lambda one, of: 100 * (one / of - 1))

    def of(trial: int) -> Array:
        found = values(rows, quantity.figure, trial)
        return found if quantity.less is None else found - values(rows, quantity.less, trial)

    if base is None:
        return over_arms(quantity.factor * of(trial), share=quantity.share)
    return over_arms(quantity.factor * (of(trial) - of(base)), limited=at_limit(of(trial), of(base)))


def difference(rows: TrialRows, figure: str, trial: int, reference: int) -> Interval:
    """Return by how much ``figure`` is more in ``trial`` than in ``reference``, within runs."""
    return estimate(rows, Quantity(figure=figure), trial, reference)


def change(rows: TrialRows, figure: str, trial: int, reference: int) -> Interval:
    """Return by how many percent ``figure`` is larger in ``trial`` than in ``reference``, arm by arm."""
    return estimate(rows, Quantity(figure=figure, percent=True), trial, reference)


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
