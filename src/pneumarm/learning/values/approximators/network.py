"""Networks of one hidden layer: one for all outputs, or one for each (section 4.2.6).

    Q(s, a) = scale sum_h w_ah tansig(sum_i v_ih s_i)

In one network for all actions the hidden units serve all of them, and what is learned of one changes the others: the
thesis calls it unlearning, and therefore has a network an action. Inputs end in a 1; so do the units of a network.

Weights are one array (inputs + rows, groups x width): the groups of hidden units lie side by side. One network an
action has a group and one row of output weights each; one for all has one group and a row for each output.
"""

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import part
from pneumarm.learning.values.approximators.coding import NETWORK, Coding, coding
from pneumarm.networks.tansig import tansig


def network() -> Coding:
    """Return that states are not coded: a network sees them whole."""
    return coding(NETWORK, 0, 0, 0)


def network_shape(inputs: int, hidden: int, outputs: int, groups: int) -> tuple[int, int]:
    """Return the shape of the weights of one agent."""
    return inputs + (1 if groups > 1 else outputs), groups * (hidden + 1)


def draw_weights(shape: tuple[int, ...], most: float, random: np.random.Generator) -> NDArray[np.float32]:
    """Return weights uniform between ``most`` and its negative."""
    return random.uniform(-most, most, shape).astype(np.float32)


@part
def activate(function, agent, z):  # type: ignore[no-untyped-def]
    """Set the hidden units of ``agent`` for the state ``z`` (inputs,)."""
    weights, hidden = function.weights[agent], function.hidden
    for u in range(hidden.shape[0]):
        hidden[u] = np.float32(0.0)
    for i in range(z.shape[0]):
        for u in range(hidden.shape[0]):
            hidden[u] += z[i] * weights[i, u]
    tansig(hidden)
    for u in range(function.width - 1, hidden.shape[0], function.width):
        hidden[u] = np.float32(1.0)


@part
def place_of(function, output):  # type: ignore[no-untyped-def]
    """Return the row of output weights of an ``output``, and the first of its hidden units."""
    if function.groups > 1:
        return function.inputs, output * function.width
    return function.inputs + output, 0


@part
def network_value(function, agent, output):  # type: ignore[no-untyped-def]
    """Return an ``output`` of what :func:`activate` set."""
    weights, (row, first) = function.weights[agent], place_of(function, output)
    total = np.float32(0.0)
    for h in range(first, first + function.width):
        total += weights[row, h] * function.hidden[h]
    return total


@part
def add_network_gradient(function, agent, z, output, factor):  # type: ignore[no-untyped-def]
    """Add ``factor`` times the gradient of an ``output`` in ``z`` (inputs,) to the traces of ``agent``."""
    weights, traces, hidden = function.weights[agent], function.traces[agent], function.hidden
    width, slope, (row, first) = function.width, function.slope, place_of(function, output)
    for h in range(width):
        u = first + h
        slope[h] = factor * weights[row, u] * (np.float32(1.0) - hidden[u] * hidden[u])
        traces[row, u] += factor * hidden[u]
    for i in range(z.shape[0]):
        for h in range(width):
            traces[i, first + h] += z[i] * slope[h]
    function.listed[agent, first] = True


@part
def follow_network(function, agent, amount, decay):  # type: ignore[no-untyped-def]
    """Move the weights of ``agent`` by ``amount`` along their traces and multiply these by ``decay``."""
    weights, traces, width = function.weights[agent], function.traces[agent], function.width
    for first in range(0, function.hidden.shape[0], width):
        if function.listed[agent, first]:
            for i in range(weights.shape[0]):
                for u in range(first, first + width):
                    weights[i, u] += amount * traces[i, u]
                    traces[i, u] *= decay
            function.listed[agent, first] = decay > 0.0
