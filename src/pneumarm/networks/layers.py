"""Layers of networks over many samples at once, with gradients, and Adam.

Everything is ``[unit][sample]``: the inner loop runs over the samples, so that it becomes vector instructions
whatever the sizes of the layers are. A layer's weights are (inputs + 1, outputs), its last row the biases; hidden
units are tansig, outputs linear.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.networks.tansig import FASTMATH, tansig
from pneumarm.vectors import LANES, add_sums

Layers = tuple[NDArray[np.float32], ...]


class Trainable(NamedTuple):
    """A network that is being trained: its weights and Adam's averages, and workspace. Made by :func:`trainable`."""

    flat: NDArray[np.float32]
    """All weights, shape (size,)."""
    layers: Layers
    """The same memory by layer, shapes (inputs + 1, outputs)."""
    gradient: NDArray[np.float32]
    """Shape (size,)."""
    slopes: Layers
    """The gradient's memory by layer."""
    mask: NDArray[np.float32]
    """0 where a weight stays as it is, otherwise 1, shape (size,)."""
    mean: NDArray[np.float32]
    """Adam's average of the gradient, shape (size,)."""
    square: NDArray[np.float32]
    """Adam's average of its square, shape (size,)."""
    units: Layers
    """Workspace for the units of each layer, (outputs, samples)."""
    errors: Layers
    """Workspace for the derivatives by them, same shapes."""


def layer_sizes(sizes: tuple[int, ...]) -> list[tuple[int, int]]:
    """Return the shapes of the weights of a network with layers of so many ``sizes``, inputs first."""
    return [(n + 1, m) for n, m in pairwise(sizes)]


def split(flat: NDArray[np.float32], sizes: tuple[int, ...]) -> Layers:
    """Return the layers that lie in ``flat``, as views."""
    shapes = layer_sizes(sizes)
    ends = np.cumsum([n * m for n, m in shapes])
    return tuple(flat[end - n * m : end].reshape(n, m) for end, (n, m) in zip(ends, shapes, strict=True))


def weight_count(sizes: tuple[int, ...]) -> int:
    """Return how many weights a network of ``sizes`` has."""
    return sum(n * m for n, m in layer_sizes(sizes))


def initial_weights(sizes: tuple[int, ...], last: float, random: np.random.Generator) -> NDArray[np.float32]:
    """Return random weights (size,): outputs keep the variance of the inputs; the last layer's times ``last``."""
    flat = np.zeros(weight_count(sizes), np.float32)
    layers = split(flat, sizes)
    for number, layer in enumerate(layers):
        gain = last if number == len(layers) - 1 else 1.0
        inputs = layer.shape[0] - 1
        layer[:-1] = random.normal(0.0, gain / np.sqrt(inputs), layer[:-1].shape)
    return flat


def trainable(
    flat: NDArray[np.float32], sizes: tuple[int, ...], samples: int, mask: NDArray[np.float32] | None = None
) -> Trainable:
    """Return a network with the weights ``flat`` (changed in place) and workspace for so many ``samples``."""
    gradient = np.zeros_like(flat)
    return Trainable(
        flat=flat,
        layers=split(flat, sizes),
        gradient=gradient,
        slopes=split(gradient, sizes),
        mask=np.ones_like(flat) if mask is None else mask,
        mean=np.zeros_like(flat),
        square=np.zeros_like(flat),
        units=workspace(sizes, samples),
        errors=workspace(sizes, samples),
    )


def workspace(sizes: tuple[int, ...], samples: int) -> Layers:
    """Return workspace for the units of every layer but the inputs, (outputs, samples)."""
    return tuple(np.zeros((size, samples), np.float32) for size in sizes[1:])


@inner(fastmath=FASTMATH)
def weighted_sums(weights, x, out):  # type: ignore[no-untyped-def]
    """Set ``out`` (outputs, n) to W^T x, ``weights`` (at least inputs, outputs), ``x`` (inputs, n); no biases."""
    out[:] = np.float32(0.0)
    add_sums(weights, x, out)


@kernel(fastmath=FASTMATH)
def forward(layers, x, units):  # type: ignore[no-untyped-def]
    """Set ``units`` to those of a network of ``layers`` over ``x`` (inputs, n); the last are its outputs."""
    below = x
    for number in range(len(layers)):
        weights, above = layers[number], units[number]
        weighted_sums(weights, below, above)
        row = below.shape[0]
        for o in range(above.shape[0]):
            bias = weights[row, o]
            unit = above[o]
            for e in range(unit.shape[0]):
                unit[e] += bias
            if number < len(layers) - 1:
                tansig(unit)
        below = above


@inner(fastmath=FASTMATH)
def add_slopes(x, error, slope):  # type: ignore[no-untyped-def]
    """Add the derivatives by the weights to ``slope`` (inputs + 1, outputs): the sums of x error over the samples.

    The errors are turned, so that what is added up at once are outputs and each sum runs in the order of the samples.
    """
    inputs, outputs, n = x.shape[0], error.shape[0], x.shape[1]
    width = (outputs + LANES - 1) // LANES * LANES
    turned, sums = np.zeros((n, width), np.float32), np.zeros((inputs, width), np.float32)
    for o in range(outputs):
        for e in range(n):
            turned[e, o] = error[o, e]
    add_sums(x.T, turned, sums)
    for i in range(inputs):
        for o in range(outputs):
            slope[i, o] += sums[i, o]
    for e in range(n):
        for o in range(outputs):
            slope[inputs, o] += turned[e, o]


@inner(fastmath=FASTMATH)
def through_weights(weights, error, below):  # type: ignore[no-untyped-def]
    """Set ``below`` (inputs, n) to the derivatives by a layer's inputs, from those by its outputs, ``error``."""
    weighted_sums(weights.T, error, below)


@inner(fastmath=FASTMATH)
def through_layer(weights, error, units, below):  # type: ignore[no-untyped-def]
    """Set ``below`` (inputs, n) to the derivatives by what enters the tansig ``units`` (inputs, n)."""
    through_weights(weights, error, below)
    for i in range(units.shape[0]):
        for e in range(units.shape[1]):
            below[i, e] *= np.float32(1.0) - units[i, e] * units[i, e]


@inner(fastmath=FASTMATH)
def backward(net, x):  # type: ignore[no-untyped-def]
    """Add to ``net.gradient`` what the derivatives by the outputs, in ``net.errors[-1]``, make of it.

    ``net.units`` must be those of :func:`forward` over the same ``x`` (inputs, n).
    """
    last = len(net.layers) - 1
    for back in range(last + 1):
        number = last - back
        if number > 0:
            below = net.units[number - 1]
            add_slopes(below, net.errors[number], net.slopes[number])
            through_layer(net.layers[number], net.errors[number], below, net.errors[number - 1])
        else:
            add_slopes(x, net.errors[0], net.slopes[0])


_MEAN, _SQUARE, _TINY = np.float32(0.9), np.float32(0.999), np.float32(1e-7)


@kernel(fastmath=FASTMATH)
def adam(net, rate, largest, count):  # type: ignore[no-untyped-def]
    """Move the weights along the gradient, which is cut to the length ``largest``, and set the gradient to 0.

    ``count`` is the number of this update, from 1. Source: D. P. Kingma and J. Ba, "Adam: a method for stochastic
    optimization", ICLR 2015, algorithm 1.
    """
    flat, gradient, mean, square = net.flat, net.gradient, net.mean, net.square
    length = np.float32(0.0)
    for i in range(flat.shape[0]):
        gradient[i] *= net.mask[i]
        length += gradient[i] * gradient[i]
    length = np.sqrt(length)
    cut = np.float32(largest) / length if length > largest else np.float32(1.0)
    unbias_square = np.sqrt(1.0 - float(_SQUARE) ** count)
    step = np.float32(rate * unbias_square / (1.0 - float(_MEAN) ** count))
    tiny = np.float32(_TINY * unbias_square)
    for i in range(flat.shape[0]):
        g = gradient[i] * cut
        mean[i] = _MEAN * mean[i] + (np.float32(1.0) - _MEAN) * g
        square[i] = _SQUARE * square[i] + (np.float32(1.0) - _SQUARE) * g * g
        flat[i] -= step * mean[i] / (np.sqrt(square[i]) + tiny)
        gradient[i] = np.float32(0.0)
