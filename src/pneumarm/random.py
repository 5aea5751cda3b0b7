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

from pneumarm.kernels import inner

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


@inner
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


@inner
def uniform(state):  # type: ignore[no-untyped-def]
    """Return a float64 uniform in [0, 1)."""
    return float(next_word(state) >> np.uint64(11)) * _TO_UNIT


@inner
def integer(state, bound):  # type: ignore[no-untyped-def]
    """Return an integer uniform in [0, bound); the bias of at most bound / 2**53 is of no consequence here."""
    return int(uniform(state) * bound)


def _ziggurat() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the right edges (257,) of 256 layers of equal area under exp(-x^2/2), and the curve there.

    Layer 0 is the base with the tail beyond ``_TAIL``; its edge is that of a rectangle of the same area.
    """
    curve = math.exp(-0.5 * _TAIL**2)
    area = _TAIL * curve + math.sqrt(math.pi / 2) * math.erfc(_TAIL / math.sqrt(2))
    edge = [area / curve, _TAIL]
    while len(edge) < _LAYERS:
        edge.append(math.sqrt(-2.0 * math.log(area / edge[-1] + math.exp(-0.5 * edge[-1] ** 2))))
    edges = np.array([*edge, 0.0])
    return edges, np.exp(-0.5 * edges**2)


_LAYERS = 256
_TAIL = 3.6541528853610088  # where 256 layers of equal area begin their tail
_EDGE, _CURVE = _ziggurat()


@inner
def normal(state):  # type: ignore[no-untyped-def]
    """Return a standard normal deviate (the ziggurat of Marsaglia and Tsang, J. Stat. Softw. 5(8), 2000)."""
    while True:
        word = next_word(state)
        layer = word & np.uint64(_LAYERS - 1)  # the lowest 8 bits; the 53 highest ones give the place in it
        x = (2.0 * float(word >> np.uint64(11)) * _TO_UNIT - 1.0) * _EDGE[layer]
        if abs(x) < _EDGE[layer + np.uint64(1)]:
            return x
        if layer == 0:
            return _normal_tail(state, x)
        below, above = _CURVE[layer], _CURVE[layer + np.uint64(1)]
        if below + uniform(state) * (above - below) < math.exp(-0.5 * x * x):
            return x


@inner
def _normal_tail(state, side):  # type: ignore[no-untyped-def]
    """Return a deviate beyond ``_TAIL`` on the ``side`` of its sign (Marsaglia, Technometrics 6, 1964)."""
    while True:
        x = -math.log(1.0 - uniform(state)) / _TAIL
        y = -math.log(1.0 - uniform(state))
        if 2.0 * y > x * x:
            return math.copysign(_TAIL + x, side)
