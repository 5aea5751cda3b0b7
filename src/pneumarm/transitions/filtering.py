"""The filter that gives an approximately uniform distribution of transitions (thesis section 3.2.3).

    first pass    count(i) = transitions in cell i of the grid
    second pass   keep a transition of cell i with probability min(1, n / count(i))

A pass before these finds what the grid spans. Memory holds the occupied cells and what is kept, never the data.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.transitions.choice import hashed_uniform, held_out, join_transitions, picked, sample
from pneumarm.transitions.grid import CellCounts, Coverage, Grid, GridSettings, span_grid
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Transitions, Window, transitions

Part = Literal["kept", "generalisation", "held-out"]
"""The filtered set; the transitions left out of it (thesis section 3.3); those of the sequences held out."""

SAMPLE = 200_000
"""Transitions drawn of a part by default, at most."""


@dataclass(frozen=True)
class Filter:
    """Which transitions are kept; whether one is depends on its cell, its sequence and its step alone."""

    grid: Grid
    counts: CellCounts
    settings: GridSettings
    seed: int
    fraction: float
    """Share of the sequences that are held out."""

    def part(self, block: Transitions, part: Part) -> NDArray[np.bool_]:
        """Return which of the transitions (n,) belong to the part."""
        apart = held_out(block.sequence, self.fraction, self.seed)
        if part == "held-out":
            return apart
        draw = hashed_uniform(self.seed + 1, block.sequence, block.step)
        keep = draw < self._probability(self.counts.of(self.grid.cells(block.inputs)))
        return ~apart & (keep if part == "kept" else ~keep)

    def expected(self) -> float:
        """Return how many transitions are kept on average."""
        counts = self.counts.arrays()[1]
        return float((counts * self._probability(counts)).sum())

    def holds_data(self, inputs: ArrayLike) -> NDArray[np.bool_]:
        """Return for inputs (n, input_size) whether their cell holds data (section 3.4, invalid predictions)."""
        return self.counts.of(self.grid.cells(inputs)) > 0

    def _probability(self, counts: NDArray[np.int64]) -> NDArray[np.float64]:
        return self._thinning * np.minimum(1.0, self.settings.per_cell / np.maximum(counts, 1))

    @cached_property
    def _thinning(self) -> float:
        wanted = float(np.minimum(self.counts.arrays()[1], self.settings.per_cell).sum())
        return min(1.0, self.settings.most / wanted)


@dataclass(frozen=True)
class Filtered:
    """The outcome of filtering; what is not kept can be streamed from the source again."""

    transitions: Transitions
    """The filtered set, in the order of the source."""
    coverage: Coverage
    """How the grid is covered by all transitions that are not held out."""
    filter: Filter
    """What decided."""
    source: Iterable[Rows]
    """What was filtered."""

    def stream(self, part: Part) -> Iterator[Transitions]:
        """Yield the transitions of a part, block by block, in bounded memory."""
        for block in _windows(self.source, self.filter.grid.window):
            yield picked(block, self.filter.part(block, part))

    def sample(self, part: Part, count: int = SAMPLE) -> Transitions | None:
        """Return at most ``count`` transitions of a part, drawn at random; None where the part is empty."""
        return sample(self.stream(part), count, self.filter.seed + 2)


def filter_transitions(
    source: Iterable[Rows],
    window: Window,
    settings: GridSettings | None = None,
    *,
    seed: int = 0,
    hold_out: float = 0.0,
) -> Filtered:
    """Filter what ``source`` gives: blocks of whole sequences, the same at every iteration, such as a store.

    The outcome depends on the seed but not on the size of the blocks. The sequences that are held out, a share of
    ``hold_out``, are neither counted nor kept. Commands that are all -1, 0 or +1 are taken as valves.

    Raises:
        UnusableInput: there are no transitions, the window does not fit, or a setting is out of its range.

    """
    if not 0 <= hold_out < 1:
        raise UnusableInput(f"the share of sequences held out must lie within 0 to 1, got {hold_out!r}")
    settings = settings or GridSettings()

    def training() -> Iterator[Transitions]:
        for block in _windows(source, window):
            yield picked(block, ~held_out(block.sequence, hold_out, seed)) if hold_out else block

    grid, _ = span_grid(training(), window, settings)
    counts = CellCounts()
    for block in training():
        counts.add(grid.cells(block.inputs))
    chosen = Filter(grid, counts, settings, seed, hold_out)
    kept = join_transitions([picked(block, chosen.part(block, "kept")) for block in _windows(source, window)])
    coverage = Coverage.of(grid, counts.arrays()[1], settings.per_cell, len(kept.sequence))
    return Filtered(kept, coverage, chosen, source)


def _windows(source: Iterable[Rows], window: Window) -> Iterator[Transitions]:
    if isinstance(source, Iterator):
        raise PneumarmError("the source of a filter is read several times: give a store or a list, not an iterator")
    for rows in source:
        if rows.joints != window.joints:
            raise UnusableInput(f"the data has {rows.joints} joint(s), the window {window.joints}; make them agree")
        yield transitions(rows, window)


@dataclass(frozen=True)
class NewCells:
    """Which cells only the second half of the data reached (thesis section 3.2.3)."""

    half: Coverage
    """Coverage of the first half."""
    whole: Coverage
    """Coverage of everything."""

    @property
    def count(self) -> int:
        """Cells that only the second half reached."""
        return self.whole.occupied - self.half.occupied

    @property
    def share(self) -> float:
        """New cells as a share of all that are occupied."""
        return self.count / self.whole.occupied


NEW_CELLS = (
    "New cells do not mean that more data would help: networks that have seen some states know their neighbours. "
    "What counts is whether the simulation's error still falls."
)
"""What to tell a person who sees many new cells beside data that are enough."""


def new_cells(source: Iterable[Rows], window: Window, settings: GridSettings | None = None) -> NewCells:
    """Compare how the first half of the transitions and all of them cover the same grid.

    The thesis collects as much again and looks whether "many more bins are filled". Whether that is worth it is told
    by :func:`pneumarm.simulation.enough.enough_data`.

    Raises:
        UnusableInput: there are no transitions.

    """
    settings = settings or GridSettings()
    grid, total = span_grid(_windows(source, window), window, settings)
    counts, half, seen = CellCounts(), total // 2, 0
    coverage_of_half = Coverage.of(grid, np.zeros(0, np.int64), settings.per_cell, 0)
    for block in _windows(source, window):
        cells = grid.cells(block.inputs)
        cut = min(max(half - seen, 0), len(cells))
        seen += len(cells)
        counts.add(cells[:cut])
        if cut and seen - len(cells) + cut == half:
            coverage_of_half = _coverage(grid, counts, settings)
        counts.add(cells[cut:])
    return NewCells(coverage_of_half, _coverage(grid, counts, settings))


def _coverage(grid: Grid, counts: CellCounts, settings: GridSettings) -> Coverage:
    held = counts.arrays()[1]
    return Coverage.of(grid, held, settings.per_cell, int(np.minimum(held, settings.per_cell).sum()))
