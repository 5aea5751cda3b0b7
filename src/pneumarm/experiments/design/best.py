"""The best settings, factor by factor in the order of the rankings, and their confirmation (section 5.4.2).

The thesis fixes factors from the most significant effect on, by two rankings at once: of the mean, whose best is the
goal, and of the standard deviation, whose best is the lowest. It does so in words; as a rule that is

1. Go through the ranks; at each rank take the columns that the rankings name there, an interaction before a factor of
   its own ("since column 8 affects column 12, we first fix column 8"), the mean before the standard deviation.
2. A column that is a factor is fixed to the level that is best for the ranking that named it.
3. A column that is an interaction, one factor of which is fixed, fixes the other: to the level for which the column
   is at its best. If neither is fixed it waits until one is; if both are, it is decided already.

On table C.7 this gives SARSA, gamma 0.98, 5 neurons, learning rate 0.10, lambda 0: trial 10, the best one that was
measured. The thesis comes to 0.05 instead, because having fixed column 1 "to its higher level" it names the lower.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.assignment import Design, Level
from pneumarm.experiments.design.distributions import t_quantile
from pneumarm.experiments.design.effects import Effects


@dataclass(frozen=True)
class Aim:
    """A loss and which way it is good."""

    name: str
    effects: Effects
    larger: bool


@dataclass(frozen=True)
class FixedFactor:
    """One factor fixed."""

    factor: str
    """Label."""
    level: int
    """Number of the level, from 0."""
    column: int
    """Name of the criterion that decided."""
    criterion: str
    rank: int
    """Rank of the column by that criterion, from 1."""


@dataclass(frozen=True)
class Best:
    """Settings and how they were derived."""

    levels: Mapping[str, int]
    """Number of the level, from 0, by the factor's label."""
    settings: Mapping[str, Level]
    """The levels themselves."""
    steps: tuple[FixedFactor, ...]
    trial: int | None
    """Trial of the array that has these settings, if one has."""


def derive(design: Design, criteria: Sequence[Aim]) -> Best:
    """Return the best settings of ``design`` by its ranked effects, see the module."""
    levels: dict[str, int] = {}
    steps: list[FixedFactor] = []
    waiting: list[tuple[int, Aim, int]] = []

    def fix(factor: str, level: int, column: int, criterion: Aim, rank: int) -> None:
        levels[factor] = level
        steps.append(FixedFactor(factor, level, column, criterion.name, rank))
        for item in list(waiting):
            if item in waiting and _deducible(design, item[0], levels):
                waiting.remove(item)
                consider(*item)

    def consider(column: int, criterion: Aim, rank: int) -> None:
        factor = design.on(column)
        if factor is not None:
            if factor.label not in levels:
                fix(factor.label, criterion.effects.best(column, criterion.larger), column, criterion, rank)
            return
        found = _deducible(design, column, levels)
        if found is not None:
            wanted = criterion.effects.best(column, criterion.larger)
            level = _other(design, column, wanted, found, levels)
            if level is not None:
                fix(found[1], level, column, criterion, rank)
        elif design.interactions(column):
            waiting.append((column, criterion, rank))

    for rank in range(1, design.array.columns + 1):
        named = [(criterion.effects.ranking[rank - 1], criterion, rank) for criterion in criteria]
        for item in sorted(named, key=lambda item: _deducible(design, item[0], levels) is None):
            consider(*item)
    settings = {factor.label: factor.levels[levels[factor.label]] for factor in design.factors}
    return Best(levels, settings, tuple(steps), design.trial(levels))


def _deducible(design: Design, column: int, levels: Mapping[str, int]) -> tuple[str, str] | None:
    """Return the fixed and the open factor of the interaction on ``column``, if just one of a pair is fixed."""
    if design.on(column) is not None:
        return None
    for first, second in design.interactions(column):
        if (first.label in levels) != (second.label in levels):
            return (first.label, second.label) if first.label in levels else (second.label, first.label)
    return None


def _other(design: Design, column: int, wanted: int, pair: tuple[str, str], levels: Mapping[str, int]) -> int | None:
    """Return the level of the open factor of ``pair`` with which ``column`` has the level ``wanted``."""
    fixed, open_ = (design.factor(label).column for label in pair)
    table = design.array
    rows = (table.column(fixed) == levels[pair[0]]) & (table.column(column) == wanted)
    found = np.unique(table.column(open_)[rows])
    return int(found[0]) if len(found) == 1 else None


@dataclass(frozen=True)
class Confirmation:
    """A confirmation run next to what the effects predict."""

    predicted: float
    low: float
    high: float
    """Interval in which the mean of so many runs is expected with 95 % confidence."""
    observed: float
    confirmed: bool


def predict(design: Design, results: ArrayLike, levels: Mapping[str, int], columns: Sequence[int]) -> float:
    """Return the mean expected at ``levels``, adding up the effects of ``columns`` on ``results`` (trials, runs)."""
    y = np.asarray(results, np.float64)
    predicted = float(y.mean())
    for column in columns:
        level = level_at(design, column, levels)
        if level is not None:
            predicted += float(y[design.array.column(column) == level].mean() - y.mean())
    return predicted


def level_at(design: Design, column: int, levels: Mapping[str, int]) -> int | None:
    """Return the level that ``column`` has where the factors have ``levels``; None where they do not decide it."""
    factor = design.on(column)
    if factor is not None:
        return levels[factor.label]
    for first, second in design.interactions(column):
        array = design.array
        rows = (array.column(first.column) == levels[first.label]) & (
            array.column(second.column) == levels[second.label]
        )
        found = np.unique(array.column(column)[rows])
        if len(found) == 1:
            return int(found[0])
    return None


def confirm(
    design: Design,
    results: ArrayLike,
    levels: Mapping[str, int],
    columns: Sequence[int],
    observed: ArrayLike,
    error: tuple[float, int],
) -> Confirmation:
    """Compare runs made at ``levels`` with what the effects of ``columns`` predict from ``results`` (trials, runs).

    The interval is for the mean of the confirmation runs: t sqrt(V_error (1/n_effective + 1/n_observed)), with
    n_effective = results / (1 + degrees of freedom of the columns) (Taguchi).

    Args:
        design: the design of ``results``.
        results: shape (trials, runs).
        levels: number of the level by the factor's label.
        columns: those that the prediction adds up.
        observed: results of the confirmation runs, shape (runs,).
        error: mean square of the error and its degrees of freedom, from :func:`~.anova.anova`.

    """
    y, seen = np.asarray(results, np.float64), np.asarray(observed, np.float64)
    if seen.ndim != 1 or not len(seen):
        raise UnusableInput(f"a confirmation needs one row of runs, got {seen.shape}")
    used = [c for c in columns if level_at(design, c, levels) is not None]
    effective = y.size / (1 + sum(int(design.array.counts[c - 1]) - 1 for c in used))
    predicted, mean = predict(design, y, levels, used), float(seen.mean())
    half = t_quantile(0.95, error[1]) * float(np.sqrt(error[0] * (1 / effective + 1 / len(seen))))
    return Confirmation(predicted, predicted - half, predicted + half, mean, abs(mean - predicted) <= half)
