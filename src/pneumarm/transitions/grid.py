"""The grid over observation and action, and how many transitions its cells hold (thesis section 3.2.3).

A transition belongs to the cell of its o_k and a_k alone, because the older parts of the state add little but
dimensions: 5 dimensions for one joint, 10 for two. Only occupied cells take memory.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import ACTIONS, to_actions
from pneumarm.errors import UnusableInput
from pneumarm.settings import PositiveInt, PythonOnly, Settings
from pneumarm.transitions.quantiles import Quantiles
from pneumarm.transitions.window import Transitions, Window


@dataclass(frozen=True)
class GridSettings(Settings):
    """How finely the grid divides, and how much of each cell is kept."""

    angle_bins: PositiveInt = 8
    """Divisions of the angle (thesis: 8)."""
    velocity_bins: PositiveInt = 8
    """Divisions of the velocity (thesis: 8)."""
    pressure_bins: PositiveInt = 8
    """Divisions of each pressure (thesis: 8)."""
    chain_bins: PositiveInt = 5
    """Divisions of angle, velocity and pressures where an arm has several joints (thesis section 6.1.4: 5)."""
    command_bins: Annotated[PositiveInt, PythonOnly] = 3
    """Divisions of each muscle's command where commands are continuous or pulses (not in the thesis); valves are
    divided into the 9 actions of a joint. Three keeps a grid of as many cells: 3 x 3 = 9."""
    per_cell: PositiveInt = 5
    """Transitions kept of a cell at most, on average (thesis: n = 5)."""
    inside: Annotated[float, Meta(ge=0.5, le=1), PythonOnly] = 0.998
    """Share of the data that the grid spans in each dimension, leaving out as much at both ends; what lies beyond
    counts to the outermost cells. The thesis does not say what its grid spans. With 1 it spans everything, and one
    spike of the velocity makes its divisions too coarse for all the rest."""
    most: Annotated[PositiveInt, PythonOnly] = 500_000
    """Transitions kept at most, on average; over that the probability to be kept is lowered everywhere alike. It
    bounds memory where there are so many dimensions that nearly every transition has a cell of its own."""


@dataclass(frozen=True)
class Grid:
    """A uniform grid over the observation and the command of one step."""

    window: Window
    low: NDArray[np.float64]
    """Lower ends, shape (dimensions,): the observation in its order, then commands but for valves (sensor units)."""
    high: NDArray[np.float64]
    """Upper ends, shape (dimensions,)."""
    bins: NDArray[np.int64]
    """Divisions, shape (dimensions,)."""
    valves: bool
    """Whether the command is the joint's action, one of 9, instead of further dimensions to divide."""

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.bins.tolist()) * (ACTIONS**self.window.joints if self.valves else 1)

    def cells(self, inputs: ArrayLike) -> NDArray[np.int64]:
        """Return the numbers of the cells (n,) of the inputs (n, input_size) in 0..size - 1."""
        inputs = np.asarray(inputs)
        window = self.window
        observed, command = inputs[:, : window.observation_size], inputs[:, -window.command_size :]
        divided = observed if self.valves else np.concatenate([observed, command], axis=1)
        span = self.high - self.low
        scale = np.divide(self.bins, span, out=np.zeros(len(span)), where=span > 0)
        cell = np.zeros(len(inputs), np.int64)
        for d, bins in enumerate(self.bins.tolist()):
            # Clipped as floats: far outside the grid an integer would overflow.
            place = np.clip(np.floor((divided[:, d] - self.low[d]) * scale[d]), 0, bins - 1)
            cell = cell * bins + place.astype(np.int64)
        if self.valves:
            actions = to_actions(command.reshape(len(inputs), window.joints, 2))
            for joint in range(window.joints):
                cell = cell * ACTIONS + actions[:, joint]
        return cell


def span_grid(blocks: Iterable[Transitions], window: Window, settings: GridSettings) -> tuple[Grid, int]:
    """Return the grid that spans the transitions (:attr:`GridSettings.inside`), and how many there are.

    Raises:
        UnusableInput: there are none, or the grid has too many cells to be numbered.

    """
    size = window.observation_size
    counted = Quantiles(size + window.command_size)
    valves = True
    for block in blocks:
        values = block.inputs[:, [*range(size), *range(-window.command_size, 0)]]
        counted.add(values)
        command = values[:, size:]
        valves = valves and bool(((command == 0) | (np.abs(command) == 1)).all())
    if not counted.total:
        raise UnusableInput("there is not a single complete transition to filter; collect or import more")
    outside = (1 - settings.inside) / 2
    low, high = counted([outside, 1 - outside])
    per_joint = [settings.angle_bins, settings.velocity_bins, settings.pressure_bins, settings.pressure_bins]
    if window.joints > 1:
        per_joint = [settings.chain_bins] * len(per_joint)
    # What further sensors say is not divided: each would multiply the cells, and with them what there is to collect.
    bins = per_joint * window.joints + [1] * len(window.further)
    if valves:
        low, high = low[:size], high[:size]
    else:
        bins += [settings.command_bins] * window.command_size
    grid = Grid(window, low, high, np.array(bins, np.int64), valves)
    if grid.size >= 1 << 63:
        raise UnusableInput(f"a grid of {grid.size:.1e} cells cannot be numbered; give it fewer divisions")
    return grid, counted.total


class CellCounts:
    """How many transitions each occupied cell holds: two arrays, sorted by the number of the cell.

    What is added is kept in runs whose lengths at least halve from one to the next, so that merging costs
    n log n in all and memory stays within a few times the occupied cells.
    """

    def __init__(self) -> None:
        self._runs: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []

    def add(self, cells: NDArray[np.int64]) -> None:
        """Count the transitions in ``cells`` (n,)."""
        run: tuple[NDArray[np.int64], NDArray[np.int64]] = np.unique(cells, return_counts=True)
        while self._runs and len(self._runs[-1][0]) < 2 * len(run[0]):
            run = _merged(self._runs.pop(), run)
        self._runs.append(run)

    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the occupied cells, rising, and how many each holds; both (occupied,)."""
        while len(self._runs) > 1:
            last = self._runs.pop()
            self._runs.append(_merged(self._runs.pop(), last))
        if not self._runs:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        return self._runs[0]

    def of(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return how many transitions each of ``cells`` (n,) holds, shape (n,); 0 where none was met."""
        occupied, counts = self.arrays()
        if not len(occupied):
            return np.zeros(len(cells), np.int64)
        place = np.minimum(np.searchsorted(occupied, cells), len(occupied) - 1)
        return np.where(occupied[place] == cells, counts[place], 0)


_Run = tuple[NDArray[np.int64], NDArray[np.int64]]


def _merged(one: _Run, other: _Run) -> _Run:
    cells, place = np.unique(np.concatenate([one[0], other[0]]), return_inverse=True)
    counts = np.zeros(len(cells), np.int64)
    counts[place[: len(one[0])]] = one[1]
    counts[place[len(one[0]) :]] += other[1]
    return cells, counts


@dataclass(frozen=True)
class Coverage:
    """What part of the grid the data covers."""

    cells: int
    """Cells of the grid; most of them are unsound: the arm cannot get there (thesis section 3.2.2)."""
    occupied: int
    """Cells that hold a transition."""
    full: int
    """Cells that hold at least ``per_cell``."""
    per_cell: int
    """Transitions wanted of a cell."""
    histogram: tuple[int, ...]
    """Number of cells that hold 1, 2-3, 4-7, ..., 2**i to 2**(i+1) - 1 transitions."""
    seen: int
    """Transitions looked at."""
    kept: int
    """Transitions in the filtered set."""
    unseen: float
    """Chance that one more transition falls into a cell that is still empty: the share of transitions that are alone
    in their cell (I. J. Good, "The population frequencies of species", Biometrika 40, 1953)."""

    @classmethod
    def of(cls, grid: Grid, counts: NDArray[np.int64], per_cell: int, kept: int) -> "Coverage":
        """Return the coverage of ``grid`` for the counts (occupied,) of its occupied cells."""
        seen = int(counts.sum())
        octave = np.frexp(counts)[1] - 1
        return cls(
            cells=grid.size,
            occupied=len(counts),
            full=int((counts >= per_cell).sum()),
            per_cell=per_cell,
            histogram=tuple(np.bincount(octave).tolist()) if len(counts) else (),
            seen=seen,
            kept=kept,
            unseen=float((counts == 1).sum() / seen) if seen else 1.0,
        )

    def summary(self) -> dict[str, Any]:
        """Return the figures that reports give."""
        return {
            "kept": self.kept,
            "seen": self.seen,
            "cells": self.cells,
            "cells_occupied": self.occupied,
            "cells_full": self.full,
            "unseen": self.unseen,
        }
