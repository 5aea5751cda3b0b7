"""The network of a servo, layer by layer, for one state at a time: what a board runs in floats."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.networks.tansig import FASTMATH, tansig


class FloatNetwork(NamedTuple):
    """A network. Made by :func:`network_of`."""

    weights: NDArray[np.float32]
    """Of all layers, one after the other, each (inputs + 1, outputs) with the biases last."""
    sizes: NDArray[np.int16]
    """Units of each layer, inputs first."""


def network_of(agent: NetworkAgent) -> FloatNetwork:
    """Return the network of ``agent``."""
    return FloatNetwork(np.ascontiguousarray(agent.policy, np.float32), np.array(agent.sizes, np.int16))


@kernel(fastmath=FASTMATH)
def run_network(network, inputs, units, said):  # type: ignore[no-untyped-def]
    """Set ``said`` (outputs, 1) to the outputs for ``inputs`` (inputs, 1); ``units`` (2, widest) is workspace."""
    for i in range(inputs.shape[0]):
        units[0, i] = inputs[i, 0]
    place, layers = 0, network.sizes.shape[0] - 1
    for layer in range(layers):
        count, wide, here, there = network.sizes[layer], network.sizes[layer + 1], layer % 2, (layer + 1) % 2
        for o in range(wide):
            total = np.float32(0.0)
            for i in range(count):
                total += network.weights[place + i * wide + o] * units[here, i]
            units[there, o] = total + network.weights[place + count * wide + o]
        place += (count + 1) * wide
        if layer < layers - 1:
            tansig(units[there])
    for o in range(said.shape[0]):
        said[o, 0] = units[layers % 2, o]
