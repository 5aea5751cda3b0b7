"""Random numbers inside kernels: xoshiro256++ with its whole state in a small array.

A state is a ``uint64`` array of 4 words, so that it can be saved in a checkpoint and restored bit for bit, and
handed to a kernel that runs without the GIL. Seeds go through NumPy's ``SeedSequence``.

Source: D. Blackman and S. Vigna, "Scrambled linear pseudorandom number generators", ACM Trans. Math. Softw.
47(4), 2021.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel

RandomState = NDArray[np.uint64]

_TO_UNIT = 2.0**-53


def random_state(seed: int | Sequence[int]) -> RandomState:
    """Return a fresh state (4,) for ``seed``; a sequence of integers gives independent streams."""
    state = np.random.SeedSequence(seed).generate_state(4, np.uint64)
    return np.ascontiguousarray(state)


def random_states(seed: int | Sequence[int], count: int) -> RandomState:
    """Return ``count`` independent states, shape (count, 4)."""
    children = np.random.SeedSequence(seed).spawn(count)
    return np.stack([child.generate_state(4, np.uint64) for child in children])


@kernel
def next_word(state):  # type: ignore[no-untyped-def]
    """Return the next 64 random bits and advance ``state`` (4,) in place."""
    s0, s1, s2, s3 = state[0], state[1], state[2], state[3]
    mixed = s0 + s3
    result = ((mixed << np.uint64(23)) | (mixed >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    state[0], state[1], state[2], state[3] = s0, s1, s2, s3
    return result


@kernel
def uniform(state):  # type: ignore[no-untyped-def]
    """Return a float64 uniform in [0, 1)."""
    return float(next_word(state) >> np.uint64(11)) * _TO_UNIT


@kernel
def integer(state, bound):  # type: ignore[no-untyped-def]
    """Return an integer uniform in [0, bound); the bias of at most bound / 2**53 is of no consequence here."""
    return int(uniform(state) * bound)


@kernel
def normal(state):  # type: ignore[no-untyped-def]
    """Return a standard normal deviate (Marsaglia's polar method, one of the two deviates used)."""
    while True:
        u = 2.0 * uniform(state) - 1.0
        v = 2.0 * uniform(state) - 1.0
        s = u * u + v * v
        if 0.0 < s < 1.0:
            return u * math.sqrt(-2.0 * math.log(s) / s)
