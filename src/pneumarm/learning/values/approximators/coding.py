"""What of a state a linear approximator sees: features, few of which are active in any one state.

    V(s) = sum_i phi_i(s) w_i,   |phi(s)| = 1

``s`` are variables between 0 and 1. As the features are of unit length, a step size of beta takes away the share beta
of an error whatever the approximator (Sutton and Barto, Reinforcement Learning, section 9.6). A way to code states is
a function that makes a :class:`Coding` and a part that writes features; each has a file here.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TABLE, TILES, RADIAL, KANERVA, NETWORK = range(5)


class Coding(NamedTuple):
    """How states are coded. Made by :func:`~.table.table` and the like."""

    kind: int
    """:data:`TABLE` or another of these."""
    size: int
    """Features in all."""
    most: int
    """Features that are active at once, at most."""
    cells: NDArray[np.int64]
    """Into how many cells each variable is cut, shape (variables,)."""
    offsets: NDArray[np.float64]
    """Of each tiling, shape (tilings, variables) [cells]."""
    centres: NDArray[np.float32]
    """Of the basis functions, or prototypes, shape (size, variables)."""
    reach: float
    """Width of a basis function; distance at which a prototype is active."""


def coding(
    kind: int,
    size: int,
    most: int,
    variables: int,
    cells: tuple[int, ...] = (),
    offsets: NDArray[np.float64] | None = None,
    centres: NDArray[np.float32] | None = None,
    reach: float = 0.0,
) -> Coding:
    """Return a coding of so many ``variables``; what its kind has no use for is empty."""
    return Coding(
        kind=kind,
        size=size,
        most=most,
        cells=np.array(cells or (1,) * variables, np.int64),
        offsets=np.zeros((0, variables)) if offsets is None else offsets,
        centres=np.zeros((0, variables), np.float32) if centres is None else centres,
        reach=float(reach),
    )


def spread_evenly(count: int, variables: int) -> NDArray[np.float32]:
    """Return ``count`` points that fill the unit cube evenly, shape (count, variables).

    Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018: the fractions of k / g^j with
    g the root of g^(variables + 1) = g + 1.
    """
    g = 2.0
    for _ in range(50):
        g = (1.0 + g) ** (1.0 / (variables + 1))
    steps = g ** -np.arange(1.0, variables + 1)
    points: NDArray[np.float32] = ((0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0).astype(np.float32)
    return points
