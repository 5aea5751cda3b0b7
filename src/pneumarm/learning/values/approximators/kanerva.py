"""Kanerva coding: prototypes in the space of states, active where few features differ from the state's (4.2.6).

Each variable is coded in as many bits as it is cut into, so many of them set as it is large: two codes differ in as
many bits as there are cells between them. A prototype is active within a distance in bits, the nearest one always.

Sources: Sutton and Barto, Reinforcement Learning (first edition), section 8.3.4; P. Kanerva, Sparse Distributed
Memory, 1988. Difference: prototypes fill the space evenly instead of at random.
"""

import math

import numpy as np

from pneumarm.kernels import part
from pneumarm.learning.values.approximators.coding import KANERVA, Coding, coding, spread_evenly


def kanerva(cells: tuple[int, ...], count: int, reach: float) -> Coding:
    """Return ``count`` prototypes that are active within ``reach`` bits; a variable has as many bits as ``cells``."""
    bits = np.round(spread_evenly(count, len(cells)) * np.array(cells, np.float32)).astype(np.float32)
    return coding(KANERVA, count, count, len(cells), cells, centres=bits, reach=reach)


@part
def write_kanerva(coding, z, places, amounts):  # type: ignore[no-untyped-def]
    """Write the prototypes that are active for ``z`` (variables,); return how many."""
    prototypes, nearest = coding.centres, np.float32(np.inf)
    for p in range(prototypes.shape[0]):
        distance = np.float32(0.0)
        for i in range(prototypes.shape[1]):
            distance += abs(np.float32(math.floor(z[i] * coding.cells[i] + 0.5)) - prototypes[p, i])
        amounts[p] = distance
        nearest = min(nearest, distance)
    limit, count = max(np.float32(coding.reach), nearest), 0
    for p in range(prototypes.shape[0]):
        if amounts[p] <= limit:
            places[count] = p
            count += 1
    for k in range(count):
        amounts[k] = np.float32(1.0 / math.sqrt(count))
    return count
