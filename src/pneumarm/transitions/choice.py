"""Choices by hashing: whether a sequence or a transition is chosen depends on its number and a seed alone.

So a choice can be repeated anywhere without being stored, whatever the blocks and the order the data comes in.

Source of the mixing function: S. Vigna's splitmix64, after G. L. Steele et al., "Fast splittable pseudorandom number
generators", OOPSLA 2014.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.transitions.window import Transitions

_TO_UNIT = 2.0**-53


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
    together = joined([block for block, _ in pending])
    if len(draw) <= count:
        return together, draw
    chosen = np.sort(np.argpartition(draw, count - 1)[:count])
    return picked(together, chosen), draw[chosen]


def joined(parts: list[Transitions]) -> Transitions:
    """Return the transitions of all ``parts`` (at least one) as one."""
    return Transitions._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def picked(transitions: Transitions, index: NDArray[np.bool_] | NDArray[np.intp]) -> Transitions:
    """Return those of the transitions that a mask (n,) or an index chooses."""
    return Transitions._make(array[index] for array in transitions)
