"""The network of a servo in whole numbers: weights of 8 bits, units of 16, for boards without floating-point units.

With x the inputs, a their scales, w the weights of a layer and s the scale of a row of them,

    u_i = round(2^12 x_i / a_i),    n_oi = round(w_oi a_i / s_o),    s_o = max_i |w_oi a_i| / 127
    z_o = (clip(sum_i n_oi u_i / 2^6) m_o) / 2^e_o + b_o,    m_o 2^-e_o = 2^6 s_o to 13 bits
    u_o = tanh(z_o), from a table with straight lines between its entries

where divisions by powers of two round down and all of z, b and u count in 2^-12. Hidden units have a = 1. The scales
of the inputs are their largest magnitudes on the recording, so that all weights of a row count about alike.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.networks.layers import split

ONE = 4096
"""What 1 is."""
_LARGEST = 127  # of a weight
_BITS = 13  # of what a sum is multiplied by
_DROPPED = 6  # bits of a sum that are dropped before that
_HIGHEST = 131071  # sums beyond it are far beyond where the hyperbolic tangent ends
_SHORT = 32767
_STEP = 256  # between entries of the table
_ENTRIES = 98  # up to where the hyperbolic tangent is 1 to 12 bits


class Quantised(NamedTuple):
    """A network in whole numbers. Made by :func:`quantised_of`."""

    weights: NDArray[np.int8]
    """Of all layers, one after the other, each (outputs, inputs)."""
    factor: NDArray[np.int16]
    """m, one a row."""
    shift: NDArray[np.int8]
    """e, one a row."""
    bias: NDArray[np.int16]
    """b, one a row."""
    into: NDArray[np.float32]
    """What inputs are multiplied by, shape (inputs,)."""
    sizes: NDArray[np.int16]
    """Units of each layer, inputs first."""
    bent: NDArray[np.int16]
    """The hyperbolic tangent at multiples of a sixteenth."""


def quantised_of(agent: NetworkAgent, inputs: NDArray[np.float32]) -> Quantised:
    """Return the network of ``agent`` in whole numbers, scaled by ``inputs`` (n, inputs) that it is to see."""
    scale = np.maximum(np.abs(inputs).max(axis=0), 1e-6).astype(np.float64)
    weights, factors, shifts, biases = [], [], [], []
    for number, layer in enumerate(split(agent.policy, agent.sizes)):
        wide = layer[:-1].T.astype(np.float64) * (scale if number == 0 else 1.0)
        row = np.maximum(np.abs(wide).max(axis=1), 1e-9) / _LARGEST
        weights.append(np.round(wide / row[:, None]).astype(np.int8).ravel())
        factor = row * 2**_DROPPED
        shift = np.clip(_BITS - 1 - np.floor(np.log2(factor)), 0, 30)
        factors.append(np.clip(np.round(factor * 2**shift), 0, 2**_BITS))
        shifts.append(shift)
        biases.append(np.clip(np.round(layer[-1] * ONE), -_SHORT, _SHORT))
    return Quantised(
        weights=np.concatenate(weights),
        factor=np.concatenate(factors).astype(np.int16),
        shift=np.concatenate(shifts).astype(np.int8),
        bias=np.concatenate(biases).astype(np.int16),
        into=(ONE / scale).astype(np.float32),
        sizes=np.array(agent.sizes, np.int16),
        bent=np.round(ONE * np.tanh(np.arange(_ENTRIES) * _STEP / ONE)).astype(np.int16),
    )


@kernel
def run_quantised(network, inputs, units, said):  # type: ignore[no-untyped-def]
    """Set ``said`` (outputs, 1) to the outputs for ``inputs`` (inputs, 1); ``units`` (2, widest) is workspace."""
    for i in range(inputs.shape[0]):
        units[0, i] = as_short(inputs[i, 0] * network.into[i])
    place, row, layers = 0, 0, network.sizes.shape[0] - 1
    for layer in range(layers):
        count, here = network.sizes[layer], layer % 2
        for o in range(network.sizes[layer + 1]):
            total = sum_of_products(network.weights, place, units[here], count)
            high = min(max(total >> _DROPPED, np.int32(-_HIGHEST)), np.int32(_HIGHEST))
            z = (high * np.int32(network.factor[row]) >> network.shift[row]) + np.int32(network.bias[row])
            if layer < layers - 1:
                units[1 - here, o] = bend(network.bent, z)
            else:
                said[o, 0] = np.float32(z) / np.float32(ONE)
            place += count
            row += 1


@inner
def sum_of_products(weights, place, units, count):  # type: ignore[no-untyped-def]
    """Return the sum of ``count`` products of ``weights``, from ``place`` on, and ``units``."""
    total = np.int32(0)
    for i in range(count):
        total += np.int32(weights[place + i]) * np.int32(units[i])
    return total


@inner
def as_short(x):  # type: ignore[no-untyped-def]
    """Return ``x`` rounded to a number of 16 bits."""
    limited = min(max(x, np.float32(-_SHORT)), np.float32(_SHORT))
    return int(np.floor(limited + np.float32(0.5)))


@inner
def bend(table, z):  # type: ignore[no-untyped-def]
    """Return the hyperbolic tangent of ``z``."""
    size = min(abs(z), np.int32((_ENTRIES - 2) * _STEP))
    entry = int(size // np.int32(_STEP))
    part = size - np.int32(entry * _STEP)
    low = np.int32(table[entry])
    bent = low + ((np.int32(table[entry + 1]) - low) * part // np.int32(_STEP))
    return int(bent) if z >= 0 else -int(bent)
