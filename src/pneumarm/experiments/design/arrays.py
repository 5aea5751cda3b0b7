"""Orthogonal arrays of strength 2, by construction: in any two columns every pair of levels is equally frequent.

Arrays whose levels are a prime p are linear over the integers modulo p. With the digits d_1 ... d_k of the trial's
number in base p, the most significant first, a column is a sum

    c_1 d_1 + ... + c_k d_k (mod p),    the last c that is not 0 being 1

one column for every such c, ordered by (c_k, ..., c_1): for p = 2 column j has the binary digits of j, and all arrays
are the standard ones in their standard order (thesis table 5.3; G. Taguchi, System of Experimental Design, 1987).

The mixed array L18 comes from a difference scheme: six rows in which the difference of any two columns takes each
value modulo 3 twice. The scheme, once with each of 0, 1, 2 added, is an array of 18 trials; which of the six rows a
trial comes from is a factor of six levels besides, here one of two and one of three (A. S. Hedayat, N. J. A. Sloane,
J. Stufken, Orthogonal Arrays, 1999, chapter 6). It differs from the printed L18 in the order of rows and columns.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput

Levels = NDArray[np.int64]

LINEAR = {"L4": (2, 2), "L8": (2, 3), "L16": (2, 4), "L32": (2, 5), "L9": (3, 2), "L27": (3, 3)}
"""Name: number of levels (a prime) and of digits of the trial's number."""
NAMES = (*LINEAR, "L18")
"""Every array there is."""


@dataclass(frozen=True)
class OrthogonalArray:
    """Which level every column has in every trial. Trials and columns are numbered from 1, levels from 0."""

    name: str
    levels: Levels
    """Shape (trials, columns)."""

    @property
    def trials(self) -> int:
        """Number of trials."""
        return int(self.levels.shape[0])

    @property
    def columns(self) -> int:
        """Number of columns."""
        return int(self.levels.shape[1])

    @property
    def counts(self) -> Levels:
        """Number of levels by column, shape (columns,)."""
        counts: Levels = self.levels.max(axis=0) + 1
        return counts

    def column(self, number: int) -> Levels:
        """Return the levels (trials,) of column ``number``."""
        if not 1 <= number <= self.columns:
            raise UnusableInput(f"{self.name} has the columns 1 to {self.columns}, not {number}")
        return self.levels[:, number - 1]

    def interaction(self, first: int, second: int) -> tuple[int, ...]:
        """Return the columns that the interaction of two columns falls on.

        These are the columns whose level is decided by the levels of the two. Two columns of p levels have p - 1 of
        them in a linear array. In L18 most have none, because their interaction spreads over many columns, and some
        have one of the two that would be needed.
        """
        if first == second:
            raise UnusableInput(f"a column has no interaction with itself, asked for column {first} twice")
        cell = self.column(first) * int(self.counts[second - 1]) + self.column(second)
        return tuple(
            k for k in range(1, self.columns + 1) if k not in (first, second) and _decided(cell, self.column(k))
        )


def _decided(cell: Levels, column: Levels) -> bool:
    return all(len(np.unique(column[cell == value])) == 1 for value in np.unique(cell))


def orthogonal_array(name: str) -> OrthogonalArray:
    """Return the array of this ``name``, one of ``NAMES``.

    Raises:
        UnusableInput: there is no such array.

    """
    if name == "L18":
        return OrthogonalArray(name, _mixed())
    if name not in LINEAR:
        raise UnusableInput(f"no orthogonal array {name!r}; there are {', '.join(NAMES)}")
    return OrthogonalArray(name, linear(*LINEAR[name]))


def linear(prime: int, digits: int) -> Levels:
    """Return the linear array of ``prime`` ** ``digits`` trials and all columns that it can have."""
    trials = np.array(list(itertools.product(range(prime), repeat=digits)), np.int64)
    coefficients = np.zeros((0, digits), np.int64)
    for digit in range(digits):
        earlier = [c[::-1] for c in itertools.product(range(prime), repeat=digit)]  # the first digit's varies fastest
        block = np.zeros((len(earlier), digits), np.int64)
        block[:, :digit], block[:, digit] = np.array(earlier).reshape(len(earlier), digit), 1
        coefficients = np.concatenate([coefficients, block])
    columns: Levels = trials @ coefficients.T % prime
    return columns


def difference_scheme() -> Levels:
    """Return the first scheme (6, 6) modulo 3 in the order of its columns; its first row and column are 0."""
    candidates = [np.array((0, *rest)) for rest in sorted(set(itertools.permutations((0, 1, 1, 2, 2))))]

    def extended(columns: list[Levels]) -> Iterator[list[Levels]]:
        if len(columns) == 6:
            yield columns
            return
        for candidate in candidates:
            if all((np.bincount((candidate - other) % 3, minlength=3) == 2).all() for other in columns):
                yield from extended([*columns, candidate])

    return np.stack(next(extended([np.zeros(6, np.int64)])), axis=1)


def _mixed() -> Levels:
    row, added = np.divmod(np.arange(18), 3)
    scheme = (difference_scheme()[row] + added[:, None]) % 3
    return np.column_stack([row // 3, row % 3, scheme])
