"""Tile coding: several tables of few large cells, each shifted against the others (section 4.2.6).

One tile of each tiling is active. Tilings are shifted by odd multiples of a fraction of a tile, variable by variable;
and where all tiles are more than there is room for, they share it by a hash.

Source: Sutton and Barto, Reinforcement Learning, section 9.5.4.
"""

import numpy as np

from pneumarm.kernels import part
from pneumarm.learning.values.approximators.coding import TILES, Coding, coding

_HASH = np.uint64(0x9E3779B97F4A7C15)  # 2^64 over the golden ratio (Knuth, The Art of Computer Programming, 6.4)
_HALF = np.uint64(32)


def tiles(cells: tuple[int, ...], tilings: int, room: int) -> Coding:
    """Return ``tilings`` of so many ``cells`` a variable, with ``room`` for so many tiles at most."""
    shift = np.outer(np.arange(tilings), 2 * np.arange(len(cells)) + 1) / tilings % 1.0
    all_tiles = tilings * int(np.prod(np.array(cells) + 1))  # shifted by up to one cell, a tiling needs one more
    return coding(TILES, min(all_tiles, room), tilings, len(cells), cells, offsets=shift)


@part
def write_tiles(coding, z, places, amounts):  # type: ignore[no-untyped-def]
    """Write the tiles that ``z`` (variables,) lies in; return how many."""
    tilings, cells = coding.offsets.shape[0], coding.cells
    amount, every = np.float32(1.0 / np.sqrt(tilings)), tilings
    for i in range(cells.shape[0]):
        every *= cells[i] + 1
    for t in range(tilings):
        index = t
        for i in range(cells.shape[0]):
            inside = min(max(z[i], 0.0), 1.0)
            index = index * (cells[i] + 1) + min(int(inside * cells[i] + coding.offsets[t, i]), cells[i])
        if every > coding.size:
            mixed = (np.uint64(index) * _HASH) >> _HALF
            index = int(mixed % np.uint64(coding.size))
        places[t], amounts[t] = index, amount
    return tilings
