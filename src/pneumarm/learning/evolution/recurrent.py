"""A recurrent network in as many copies as there are arms: what is evolved, whatever it controls.

    h_k = tansig(W x_k + R h_{k-1}),  h_{-1} = 0

The first units are the outputs. The genes of a unit are its row of W and its row of R, so a network is
(units, inputs + units); its inputs end in a 1, and all arms that it moves are side by side.

Source: the fully recurrent networks of F. Gomez and R. Miikkulainen, see :mod:`.populations`.
"""

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner
from pneumarm.networks.layers import weighted_sums
from pneumarm.networks.tansig import FASTMATH, tansig


def memory_of(networks: int, inputs: int, units: int, arms: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what so many ``networks`` see in so many ``arms`` each, and their units, both empty.

    What they see are the inputs, of which the last is a 1 for good, then the units of the step before: shape
    (networks, inputs + units, arms). The units are (networks, units, arms).
    """
    seen = np.zeros((networks, inputs + units, arms), np.float32)
    seen[:, inputs - 1] = 1
    return seen, np.zeros((networks, units, arms), np.float32)


@inner(fastmath=FASTMATH)
def recur(network, seen, units):  # type: ignore[no-untyped-def]
    """Let a step pass in one ``network`` (units, inputs + units) that sees ``seen`` (inputs + units, arms)."""
    weighted_sums(network.T, seen, units)
    first = seen.shape[0] - units.shape[0]
    for u in range(units.shape[0]):
        tansig(units[u])
        for e in range(units.shape[1]):
            seen[first + u, e] = units[u, e]


@inner
def forget(seen, units):  # type: ignore[no-untyped-def]
    """Let the last ``units`` rows of ``seen`` (inputs + units, arms) be what they are before the first step."""
    for row in range(seen.shape[0] - units, seen.shape[0]):
        for e in range(seen.shape[1]):
            seen[row, e] = np.float32(0.0)
