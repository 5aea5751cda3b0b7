"""Choices by hashing: whether a sequence or a transition is chosen depends on its number and a seed alone.

So a choice can be repeated anywhere without being stored, whatever the blocks and the order the data comes in.

Source of the mixing function: S. Vigna's splitmix64, after G. L. Steele et al., "Fast splittable pseudorandom number
generators", OOPSLA 2014.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Transitions

_TO_UNIT = 2.0**-53
_STRETCH = 200
"""Rows of a stretch where whole sequences cannot be held out: as long as the thesis' sequences are."""
_STILL = 0.1
"""A sensor stands still in a sequence in which its readings spread by less than this part of what is typical."""


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    words = words + np.uint64(0x9E3779B97F4A7C15)
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def hashed_uniform(seed: int, *numbers: ArrayLike) -> NDArray[np.float64]:
    """Return a number uniform in [0, 1) for each of ``numbers`` (n,) taken together, shape (n,)."""
    words = np.random.SeedSequence(seed).generate_state(1, np.uint64)
    for number in numbers:
        words = _mixed(words ^ np.asarray(number, np.int64).view(np.uint64))
    return (words >> np.uint64(11)).astype(np.float64) * _TO_UNIT


def held_out(sequence: ArrayLike, fraction: float = 0.1, seed: int = 0) -> NDArray[np.bool_]:
    """Return which of the numbers of sequences (n,) are held out: about ``fraction`` of them, always the same."""
    return hashed_uniform(seed, np.atleast_1d(sequence)) < fraction


def share_held_out(sequences: ArrayLike, fraction: float = 0.1, seed: int = 0) -> float:
    """Return the smallest share from ``fraction`` on that holds out at least one of the ``sequences`` (n,).

    Among few sequences a small share may hold out none. A single sequence is never held out for that.
    """
    draws = np.sort(hashed_uniform(seed, np.atleast_1d(sequences)))
    return fraction if len(draws) < 2 or draws[0] < fraction else float(np.nextafter(draws[0], 1.0))


class HeldOut(NamedTuple):
    """What is held out of a fit."""

    share: float
    """Share of the sequences, or of stretches of them."""
    stretch: int
    """Rows of a stretch; 0 where whole sequences are held out."""


def choose_held_out(source: Iterable[Rows], fraction: float, seed: int, window: int) -> HeldOut:
    """Return what to hold out of ``source``, blocks of whole sequences: about ``fraction``, in which sensors move.

    Whole sequences, unless more than half of all rows would be in them, or whatever moves would move in one part
    alone; then stretches of sequences. A sequence that is no longer than a ``window`` [rows] says nothing.
    """
    usual: list[HeldOut] = []
    for stretch in (0, _STRETCH):
        number, rows, spread = _spreads(Stretched(source, stretch) if stretch else source)
        typical = np.sqrt(np.average(spread**2, axis=0, weights=rows))
        moves = (spread > _STILL * typical) & (rows > window)[:, None]
        shares = [share_held_out(number[one], fraction, seed) for one in moves.T if one.any()]
        found = HeldOut(max(shares, default=fraction), stretch)
        apart = held_out(number, found.share, seed)
        alone = moves.any(axis=0) & ~(moves[apart].any(axis=0) & moves[~apart].any(axis=0))
        if not alone.any() and 0 < 2 * rows[apart].sum() < rows.sum():
            return found
        found = HeldOut(share_held_out(number[rows > window], fraction, seed), stretch)
        if 0 < 2 * rows[held_out(number, found.share, seed)].sum() < rows.sum():
            usual.append(found)
    # Something moves too seldom to be in both parts: what can be said is said of the rest.
    return usual[0] if usual else found


def _spreads(source: Iterable[Rows]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return number, rows and standard deviation of angles and pressures of each sequence, (n,), (n,), (n, columns).

    [counts]
    """
    parts = []
    for block in source:
        first = np.flatnonzero(np.diff(block.sequence, prepend=-1))
        rows = np.diff(first, append=len(block))
        values = np.concatenate([block.angle, block.pressure.reshape(len(block), -1)], axis=1)
        mean = np.add.reduceat(values, first) / rows[:, None]
        scatter = np.add.reduceat((values - np.repeat(mean, rows, axis=0)) ** 2, first)
        parts.append((block.sequence[first], rows, np.sqrt(scatter / rows[:, None])))
    number, rows, spread = (np.concatenate(part) for part in zip(*parts, strict=True))
    return number, rows, spread


def stretch_of(sequence: NDArray[np.int64], step: NDArray[np.int64], stretch: int) -> NDArray[np.int64]:
    """Return the numbers of the stretches that rows (n,) belong to, as of sequences; 0: of their sequences."""
    return (sequence << 32) + np.maximum(step, 0) // stretch if stretch else sequence


@dataclass(frozen=True)
class Stretched:
    """Blocks of rows in which every stretch of a sequence is a sequence of its own, so that no window spans two."""

    source: Iterable[Rows]
    stretch: int
    """Steps of a stretch; 0 leaves sequences whole."""

    def __iter__(self) -> Iterator[Rows]:
        for rows in self.source:
            yield replace(rows, sequence=stretch_of(rows.sequence, rows.step, self.stretch))


def sample(blocks: Iterable[Transitions], count: int, seed: int = 0) -> Transitions | None:
    """Return ``count`` transitions drawn from a stream, in its order, or all where there are fewer; None of none.

    Memory is bounded by twice ``count`` and a block: those with the smallest hashes are kept.
    """
    pending: list[tuple[Transitions, NDArray[np.float64]]] = []
    for block in blocks:
        if not len(block.sequence):
            continue
        pending.append((block, hashed_uniform(seed, block.sequence, block.step)))
        if sum(len(draw) for _, draw in pending) > 2 * count:
            pending = [_smallest(pending, count)]
    return _smallest(pending, count)[0] if pending else None


def _smallest(
    pending: list[tuple[Transitions, NDArray[np.float64]]], count: int
) -> tuple[Transitions, NDArray[np.float64]]:
    draw = np.concatenate([d for _, d in pending])
    together = join_transitions([block for block, _ in pending])
    if len(draw) <= count:
        return together, draw
    chosen = np.sort(np.argpartition(draw, count - 1)[:count])
    return picked(together, chosen), draw[chosen]


def join_transitions(parts: list[Transitions]) -> Transitions:
    """Return the transitions of all ``parts`` (at least one) as one."""
    return Transitions._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def picked(transitions: Transitions, index: NDArray[np.bool_] | NDArray[np.intp]) -> Transitions:
    """Return those of the transitions that a mask (n,) or an index chooses."""
    return Transitions._make(array[index] for array in transitions)
