"""The network of a servo in whole numbers: weights of 8 bits, for boards without floating-point units.

With x the inputs, a their scales, w the weights of a layer and s the scale of a row of them,

    u_i = round(2^12 x_i / a_i)  for inputs,  127 tanh(z_i / 2^12)  for hidden units (a = 1)
    n_oi = round(w_oi a_i / s_o)
    z_o = clip(sum_i n_oi u_i / 2^d) m_o / 2^8 + b_o

where divisions by powers of two round down, z and b count in 2^-12, m_o is the whole number next above what s_o is
then to be multiplied by, and s_o what belongs to that. The hyperbolic tangent comes from a table, with straight lines
between its entries. The scales of inputs are the largest that were seen, so that all weights of a row count alike.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.networks.layers import split

ONE = 4096
"""What 1 is in inputs and in what hidden units bend; in what they give it is 127."""
_LARGEST = 127
_DROPPED = 8, 3  # bits of sums, of the first layer and of the others
_INPUT_BITS, _HIDDEN_BITS = _DROPPED
_SHORT = 32767
_FARTHEST = 8191  # of an input: twice what was seen
_STEP_BITS, _STEP = 8, 256  # between entries of the table
_ENTRIES = 98  # up to where the hyperbolic tangent is 1
_FINER, _HALF = 5, 16  # bits by which entries are finer than what hidden units give
BLOCK = 4
"""Rows are padded with zeros to a multiple of it."""


class Quantised(NamedTuple):
    """A network in whole numbers. Made by :func:`quantised_of`."""

    weights: NDArray[np.int8]
    """Of all layers, one after the other, each (outputs, inputs padded to a multiple of :data:`BLOCK`)."""
    factor: NDArray[np.int16]
    """m, one a row."""
    bias: NDArray[np.int16]
    """b, one a row."""
    into: NDArray[np.float32]
    """What inputs are multiplied by, shape (inputs,)."""
    sizes: NDArray[np.int16]
    """Units of each layer, inputs first."""
    bent: NDArray[np.int16]
    """The hyperbolic tangent at multiples of a sixteenth."""


class Units(NamedTuple):
    """Workspace of :func:`run_quantised`."""

    inputs: NDArray[np.int16]
    hidden: NDArray[np.int8]
    """Shape (2, widest)."""


def quantised_of(agent: NetworkAgent, inputs: NDArray[np.float32]) -> Quantised:
    """Return the network of ``agent`` in whole numbers, scaled by ``inputs`` (n, inputs) that it is to see."""
    scale = np.maximum(np.abs(inputs).max(axis=0), 1e-6).astype(np.float64)
    weights, factors, biases = [], [], []
    for number, layer in enumerate(split(agent.policy, agent.sizes)):
        wide = layer[:-1].T.astype(np.float64) * (scale if number == 0 else 1.0)
        unit, dropped = (ONE, _INPUT_BITS) if number == 0 else (_LARGEST, _HIDDEN_BITS)
        of_scale = 256.0 * ONE / unit * 2**dropped
        factor = np.clip(np.ceil(np.abs(wide).max(axis=1) / _LARGEST * of_scale), 1, _SHORT)
        whole = np.clip(np.round(wide / (factor / of_scale)[:, None]), -_LARGEST, _LARGEST)
        weights.append(np.pad(whole, ((0, 0), (0, -whole.shape[1] % BLOCK))).astype(np.int8).ravel())
        factors.append(factor)
        biases.append(np.clip(np.round(layer[-1] * ONE), -_SHORT, _SHORT))
    highest = _LARGEST << _FINER
    return Quantised(
        weights=np.concatenate(weights),
        factor=np.concatenate(factors).astype(np.int16),
        bias=np.concatenate(biases).astype(np.int16),
        into=(ONE / scale).astype(np.float32),
        sizes=np.array(agent.sizes, np.int16),
        bent=np.round(highest * np.tanh(np.arange(_ENTRIES) * _STEP / ONE)).astype(np.int16),
    )


def units_of(sizes: tuple[int, ...]) -> Units:
    """Return workspace for a network with layers of so many ``sizes``."""
    count, widest = (-(-size // BLOCK) * BLOCK for size in (sizes[0], max(sizes[1:])))
    return Units(np.zeros(count, np.int16), np.zeros((2, widest), np.int8))


@kernel
def run_quantised(network, inputs, units, said):  # type: ignore[no-untyped-def]
    """Set ``said`` (outputs, 1) to the outputs for ``inputs`` (inputs, 1)."""
    for i in range(inputs.shape[0]):
        far = np.float32(_FARTHEST)
        limited = min(max(inputs[i, 0] * network.into[i], -far), far)
        units.inputs[i] = int(limited + (far + np.float32(1.5))) - (_FARTHEST + 1)
    place, row, layers = 0, 0, network.sizes.shape[0] - 1
    for layer in range(layers):
        count, here = (network.sizes[layer] + BLOCK - 1) // BLOCK * BLOCK, layer % 2
        for o in range(network.sizes[layer + 1]):
            if layer == 0:
                total = sum_of_inputs(network.weights, place, units.inputs, count) >> _INPUT_BITS
            else:
                total = sum_of_hidden(network.weights, place, units.hidden[here], count) >> _HIDDEN_BITS
            high = int(min(max(total, np.int32(-_SHORT)), np.int32(_SHORT)))
            z = (np.int32(high) * np.int32(network.factor[row]) >> 8) + np.int32(network.bias[row])
            if layer < layers - 1:
                units.hidden[1 - here, o] = bend(network.bent, z)
            else:
                said[o, 0] = np.float32(z) / np.float32(ONE)
            place += count
            row += 1


@inner
def sum_of_inputs(weights, place, units, count):  # type: ignore[no-untyped-def]
    """Return the sum of ``count`` products of ``weights``, from ``place`` on, and ``units`` of 16 bits."""
    total = np.int32(0)
    for i in range(count):
        total += np.int32(weights[place + i]) * np.int32(units[i])
    return total


@inner
def sum_of_hidden(weights, place, units, count):  # type: ignore[no-untyped-def]
    """Return the sum of ``count`` products of ``weights``, from ``place`` on, and ``units`` of 8 bits."""
    total = np.int32(0)
    for i in range(count):
        total += np.int32(weights[place + i]) * np.int32(units[i])
    return total


@inner
def bend(table, z):  # type: ignore[no-untyped-def]
    """Return the hyperbolic tangent of ``z``, 127 being 1."""
    size = int(min(abs(z), np.int32((_ENTRIES - 2) * _STEP)))
    entry, low = size >> _STEP_BITS, int(table[size >> _STEP_BITS])
    part, more = size - (entry << _STEP_BITS), int(table[entry + 1]) - low
    bent = low + int(np.int32(more) * np.int32(part) >> _STEP_BITS) + _HALF >> _FINER
    return bent if z >= 0 else -bent
