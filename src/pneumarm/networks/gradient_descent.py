"""Gradient descent in small batches, for networks that Levenberg-Marquardt is too slow for.

An epoch of Levenberg-Marquardt takes time with the square of the weights, one of gradient descent in proportion to
them. So a network of two hidden layers with thousands of weights, which it fits in a tenth of the time, predicts
several joints better than small ones do (docs/decisions/simulation.md).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.kernels import kernel
from pneumarm.networks.layers import Trainable, adam, backward, forward, initial_weights, trainable
from pneumarm.networks.levenberg_marquardt import Fit
from pneumarm.networks.network import Network
from pneumarm.networks.tansig import FASTMATH

_DECAY = 0.01  # of all weights, in learning rates
_LONGEST = 1.0  # gradients are cut to this length
_FIRST_OUTPUT = 0.1  # the first outputs are small
_START, _ORDER = 0, 1  # streams of random numbers


def two_layers(inputs: int, hidden: int, outputs: int, seed: int) -> Network:
    """Return a network with random weights and two layers of so many ``hidden`` units."""
    sizes = (inputs, hidden, hidden, outputs)
    net = trainable(initial_weights(sizes, _FIRST_OUTPUT, np.random.default_rng([seed, _START])), sizes, 1)
    return _network(net)


def gradient_descent(
    x: ArrayLike,
    y: ArrayLike,
    start: Network,
    passes: int,
    rate: float,
    seed: int = 0,
    progress: Callable[[int, float], None] | None = None,
    batch: int = 64,
) -> Fit:
    """Fit a network of two hidden layers to the targets ``y`` (n, outputs) at ``x`` (n, inputs), both about 1.

    Args:
        x: inputs.
        y: targets.
        start: where it begins.
        passes: over all rows, in an order drawn anew each time.
        rate: learning rate of Adam at the start; falls to 0 as a cosine does.
        seed: of the order.
        progress: called as ``progress(pass, mse)`` after every pass.
        batch: rows that one step is made of.

    Raises:
        ValueError: ``start`` has one hidden layer, or direct connections.

    """
    if start.second_weights is None or start.second_bias is None or start.direct is not None:
        raise ValueError("gradient descent is for networks of two hidden layers, without direct connections")
    rows, targets = (np.ascontiguousarray(np.asarray(one).T, np.float32) for one in (x, y))
    count = rows.shape[1]
    batch = min(batch, count)
    sizes = (len(rows), start.hidden_bias.size, start.second_bias.size, len(targets))
    layers = (
        (start.hidden_weights, start.hidden_bias),
        (start.second_weights, start.second_bias),
        (start.output_weights, start.output_bias),
    )
    flat = np.concatenate([np.vstack([weights, bias]).ravel() for weights, bias in layers]).astype(np.float32)
    net = trainable(flat, sizes, batch)
    random = np.random.default_rng([seed, _ORDER])
    curve = [float(np.mean((start(x) - np.asarray(y)) ** 2, axis=0).sum())]
    rates = rate * 0.5 * (1 + np.cos(np.pi * np.arange(passes + 1) / passes))
    for number in range(passes):
        done = number * (count // batch)
        order = random.permutation(count)
        curve.append(_pass(net, rows, targets, order, rates[number], rates[number + 1], done))
        if progress is not None:
            progress(number + 1, curve[-1])
    return Fit(_network(net), np.array(curve), passes, converged=False)


@kernel(fastmath=FASTMATH)
def _pass(net, x, y, order, first_rate, last_rate, done):  # type: ignore[no-untyped-def]
    """Learn from all rows in their ``order``, after so many updates ``done``; return the mean squared error."""
    batch = net.units[0].shape[1]
    batches = order.shape[0] // batch
    seen, total = np.empty((x.shape[0], batch), np.float32), 0.0
    outputs, errors = net.units[-1], net.errors[-1]
    for number in range(batches):
        chosen = order[number * batch : (number + 1) * batch]
        for i in range(x.shape[0]):
            for e in range(batch):
                seen[i, e] = x[i, chosen[e]]
        forward(net.layers, seen, net.units)
        for o in range(errors.shape[0]):
            for e in range(batch):
                error = outputs[o, e] - y[o, chosen[e]]
                total += error * error
                errors[o, e] = error / np.float32(batch)
        backward(net, seen)
        rate = first_rate + (last_rate - first_rate) * number / batches
        adam(net, rate, _LONGEST, done + number + 1)
        kept = np.float32(1.0 - _DECAY * rate)
        for i in range(net.flat.shape[0]):
            net.flat[i] *= kept
    return total / (batches * batch)


def _network(net: Trainable) -> Network:
    first, second, last = (layer.astype(np.float64) for layer in net.layers)
    return Network(first[:-1], first[-1], last[:-1], last[-1], None, second[:-1], second[-1])
