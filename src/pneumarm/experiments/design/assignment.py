"""Which factor has which column of an orthogonal array, and what else the column then tells (thesis section 5.3)."""

import itertools
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.arrays import OrthogonalArray, orthogonal_array
from pneumarm.files import read_toml

Level = float | int | str


@dataclass(frozen=True)
class Factor:
    """What an experiment varies."""

    label: str
    """Short name, a letter as in table 5.4."""
    name: str
    levels: tuple[Level, ...]
    """The lowest first."""
    column: int
    """Column of the array, from 1."""
    setting: str = ""
    """What it sets, for experiments that pneumarm runs itself, such as ``learning_rate`` or ``reward.switch``."""


@dataclass(frozen=True)
class Design:
    """Factors on the columns of an orthogonal array."""

    array: OrthogonalArray
    factors: tuple[Factor, ...]
    """Sorted by their column."""

    def __post_init__(self) -> None:
        for values, what in (
            ([f.label for f in self.factors], "labels"),
            ([f.column for f in self.factors], "columns"),
        ):
            if len(set(values)) != len(values):
                raise UnusableInput(f"the {what} of a design's factors must differ, got {values}")
        for factor in self.factors:
            self.array.column(factor.column)
            expected = int(self.array.counts[factor.column - 1])
            if len(factor.levels) != expected:
                raise UnusableInput(
                    f"factor {factor.label}: column {factor.column} of {self.array.name} has {expected} levels, "
                    f"the factor has {len(factor.levels)}; give it another column or other levels"
                )

    def factor(self, label: str) -> Factor:
        """Return the factor with this label."""
        for factor in self.factors:
            if factor.label == label:
                return factor
        raise UnusableInput(f"the design has no factor {label!r}; it has {', '.join(f.label for f in self.factors)}")

    def on(self, column: int) -> Factor | None:
        """Return the factor on ``column``."""
        return next((factor for factor in self.factors if factor.column == column), None)

    def interactions(self, column: int) -> tuple[tuple[Factor, Factor], ...]:
        """Return the pairs of factors whose interaction falls on ``column``."""
        return tuple(pair for pair, columns in self._pairs if column in columns)

    @cached_property
    def _pairs(self) -> list[tuple[tuple[Factor, Factor], tuple[int, ...]]]:
        """Pairs of factors with the columns that their interaction falls on."""
        pairs = itertools.combinations(self.factors, 2)
        return [((a, b), self.array.interaction(a.column, b.column)) for a, b in pairs]

    def label(self, column: int) -> str:
        """Return the label of ``column`` as in table 5.3: its factor, else the interactions on it, else nothing."""
        factor = self.on(column)
        if factor is not None:
            return factor.label
        return "=".join(f"{a.label}{b.label}" for a, b in self.interactions(column))

    def labels(self) -> tuple[str, ...]:
        """Return the labels of all columns."""
        return tuple(self.label(column) for column in range(1, self.array.columns + 1))

    def settings(self, trial: int) -> dict[str, Level]:
        """Return the level of every factor, by label, in ``trial``, from 1."""
        row = self.array.levels[trial - 1]
        return {factor.label: factor.levels[row[factor.column - 1]] for factor in self.factors}

    def trial(self, levels: Mapping[str, int]) -> int | None:
        """Return the trial in which every factor has the number of its level in ``levels``; None if none has."""
        for number, row in enumerate(self.array.levels, 1):
            if all(row[self.factor(label).column - 1] == level for label, level in levels.items()):
                return number
        return None

    def aliases(self, most: int = 3) -> dict[str, tuple[str, ...]]:
        """Return by labelled column which effects of up to ``most`` factors cannot be told from it, shortest first.

        Two-level arrays only; an array of more levels has no such simple words.
        """
        words: dict[str, list[str]] = {label: [] for label in self.labels() if label}
        by_column = {column: self.label(column) for column in range(1, self.array.columns + 1)}
        for size in range(1, most + 1):
            for word in itertools.combinations(self.factors, size):
                column = self._product([factor.column for factor in word])
                if column and by_column[column]:
                    words[by_column[column]].append("".join(factor.label for factor in word))
        return {label: tuple(w for w in found if w not in label.split("=")) for label, found in words.items()}

    def _product(self, columns: Sequence[int]) -> int:
        """Return the column that the product of ``columns`` is; 0 for the identity."""
        if (self.array.counts != 2).any():
            raise UnusableInput(f"aliases are defined here for arrays of two levels, {self.array.name} has others")
        product = 0
        for column in columns:
            if product == column:
                product = 0
            elif product == 0:
                product = column
            else:
                (product,) = self.array.interaction(product, column)
        return product


@dataclass(frozen=True)
class WantedFactor:
    """A factor whose column may still be open."""

    label: str
    name: str
    levels: tuple[Level, ...]
    column: int | None = None
    setting: str = ""


def assign(array: OrthogonalArray, factors: Sequence[WantedFactor], interactions: Sequence[str] = ()) -> Design:
    """Return the design in which no factor and no wanted interaction shares a column with another of them.

    The first such assignment in the order of the columns is taken; factors that have a column keep it.
    ``interactions`` are pairs of labels, such as "ab".

    Raises:
        UnusableInput: there is no such assignment.

    """
    labels = [factor.label for factor in factors]
    pairs = [_pair(word, labels) for word in interactions]
    for factor in factors:
        array.column(factor.column or 1)
    for columns in _assignments(array, factors, pairs, ()):
        placed = [
            Factor(f.label, f.name, f.levels, column, f.setting) for f, column in zip(factors, columns, strict=True)
        ]
        return Design(array, tuple(sorted(placed, key=lambda factor: factor.column)))
    raise UnusableInput(
        f"{array.name} has no columns of its own for the factors {', '.join(labels)}"
        f"{' and the interactions ' + ', '.join(interactions) if interactions else ''}; take a larger array"
    )


def _pair(word: str, labels: Sequence[str]) -> tuple[int, int]:
    for first, second in itertools.combinations(range(len(labels)), 2):
        if word in (labels[first] + labels[second], labels[second] + labels[first]):
            return first, second
    raise UnusableInput(f"interaction {word!r}: expected the labels of two factors among {', '.join(labels)}")


def _is_whole(array: OrthogonalArray, first: int, second: int, columns: Sequence[int]) -> bool:
    """Return whether ``columns`` have all degrees of freedom of the interaction of two columns."""
    free = array.counts - 1
    return int(free[first - 1] * free[second - 1]) == sum(int(free[column - 1]) for column in columns)


def _assignments(
    array: OrthogonalArray, factors: Sequence[WantedFactor], pairs: Sequence[tuple[int, int]], chosen: tuple[int, ...]
) -> Iterator[tuple[int, ...]]:
    """Give all assignments that begin with ``chosen``."""
    used = list(chosen)
    for first, second in pairs:
        if second < len(chosen):
            found = array.interaction(chosen[first], chosen[second])
            if not _is_whole(array, chosen[first], chosen[second], found):
                return  # it spreads over columns and cannot be separated
            used.extend(found)
    if len(set(used)) != len(used):
        return
    if len(chosen) == len(factors):
        yield chosen
        return
    factor = factors[len(chosen)]
    open_to = range(1, array.columns + 1) if factor.column is None else (factor.column,)
    for column in open_to:
        if column not in used and array.counts[column - 1] == len(factor.levels):
            yield from _assignments(array, factors, pairs, (*chosen, column))


class _DesignFile(msgspec.Struct, forbid_unknown_fields=True):
    array: str
    factors: tuple[WantedFactor, ...]
    interactions: tuple[str, ...] = ()


_EXPECTED = (
    "a design: array = 'L16', interactions = ['ab', ...] and for each factor a table [[factors]] with label, name, "
    "levels and perhaps column"
)


def _design_of(tables: dict[str, Any], source: str) -> Design:
    try:
        read = msgspec.convert(tables, _DesignFile)
    except msgspec.ValidationError as error:
        raise UnusableInput(f"{source}: expected {_EXPECTED}; {error}") from error
    return assign(orthogonal_array(read.array), read.factors, read.interactions)


def load_design(path: Path) -> Design:
    """Return the design in the TOML file ``path``.

    Raises:
        UnusableInput: it cannot be read or is no design.

    """
    return _design_of(read_toml(path, _EXPECTED), str(path))


def packaged_design(package: str) -> Design:
    """Return the design ``design.toml`` that lies in ``package``."""
    file = resources.files(package) / "design.toml"
    return _design_of(tomllib.loads(file.read_text(encoding="utf-8")), f"{package}/design.toml")


def thesis_design() -> Design:
    """Return the design of tables 5.3 and 5.4: five factors on the columns 1, 2, 4, 11 and 12 of L16."""
    return packaged_design("pneumarm.experiments.design")


def unnamed(design: Design) -> Design:
    """Return ``design`` without what its factors and levels mean: programs get its columns, whoever used them."""
    factors = (
        replace(one, name=f"factor {one.label}", levels=tuple(range(1, len(one.levels) + 1)), setting="")
        for one in design.factors
    )
    return replace(design, factors=tuple(factors))
