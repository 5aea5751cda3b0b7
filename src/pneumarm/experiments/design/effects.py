"""Effects: how much the loss differs between the levels of a column (thesis section 5.3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.arrays import OrthogonalArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effects:
    """The average loss table and what follows from it."""

    averages: tuple[Array, ...]
    """Average loss at each level by column, shapes (levels,)."""
    sizes: Array
    """Estimated effects: highest minus lowest average of each column, shape (columns,)."""

    @property
    def ranking(self) -> tuple[int, ...]:
        """Columns, from 1, largest effect first; the first of equals first."""
        return tuple(int(column) + 1 for column in np.argsort(-self.sizes, kind="stable"))

    @property
    def signed(self) -> Array:
        """Average at the last level minus that at the first, shape (columns,)."""
        return np.array([average[-1] - average[0] for average in self.averages])

    def best(self, column: int, larger: bool) -> int:
        """Return the level of ``column``, from 0, with the largest average, or with the smallest."""
        average = self.averages[column - 1]
        return int(np.argmax(average) if larger else np.argmin(average))


def effects(array: OrthogonalArray, losses: ArrayLike) -> Effects:
    """Return the effects of all columns of ``array`` on ``losses`` (trials,).

    Raises:
        UnusableInput: there are not as many losses as trials.

    """
    values = np.asarray(losses, np.float64)
    if values.shape != (array.trials,):
        raise UnusableInput(f"{array.name} has {array.trials} trials, got results of {values.shape}")
    averages = tuple(
        np.array([values[array.levels[:, c] == level].mean() for level in range(array.counts[c])])
        for c in range(array.columns)
    )
    return Effects(averages, np.array([np.ptp(average) for average in averages]))
