"""A linear least-squares fit in place of a network, and what its weights say of the inputs (thesis section 3.2.4)."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.networks.network import Network

_SMALLEST = 1e-10
"""Directions of the inputs with less than this part of the largest singular value are not used: inputs that are
combinations of others get weights that share out the effect, not huge ones that cancel."""


def least_squares(x: ArrayLike, y: ArrayLike, block: int = 8192) -> Network:
    """Return the linear model with the least squared error on the targets ``y`` (n, outputs) at ``x`` (n, inputs).

    It is a :class:`Network` without hidden units. The rows are reduced block by block to the triangle R of a QR
    decomposition, so neither memory nor rounding grows with their number as in normal equations.

    Raises:
        ValueError: the shapes do not fit together.

    """
    return nested_least_squares(x, y, [np.shape(x)[-1]], block)[0]


def nested_least_squares(x: ArrayLike, y: ArrayLike, sizes: Iterable[int], block: int = 8192) -> list[Network]:
    """Return linear models as of :func:`least_squares`, each of the first so many inputs, by one decomposition.

    Raises:
        ValueError: the shapes do not fit together.

    """
    x, y = np.asarray(x), np.asarray(y)
    if x.ndim != 2 or y.ndim != 2 or len(x) != len(y) or len(x) == 0:
        raise ValueError(f"expected x (n, inputs) and y (n, outputs), got {x.shape} and {y.shape}")
    inputs, outputs = x.shape[1], y.shape[1]
    triangle: NDArray[np.float64] = np.zeros((0, 1 + inputs + outputs))
    for begin in range(0, len(x), block):
        part = slice(begin, begin + block)
        rows = np.concatenate([np.ones((len(x[part]), 1)), x[part], y[part]], axis=1, dtype=np.float64)
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, rows]), mode="r"))
    return [_solved(triangle[: 1 + size, : 1 + size], triangle[: 1 + size, 1 + inputs :]) for size in sizes]


def _solved(triangle: NDArray[np.float64], target: NDArray[np.float64]) -> Network:
    """Return the linear model of which R is a ``triangle``, and Q^T y the ``target``."""
    weights = np.asarray(np.linalg.lstsq(triangle, target, rcond=_SMALLEST)[0], np.float64)
    inputs, outputs = len(weights) - 1, target.shape[1]
    return Network(
        hidden_weights=np.zeros((inputs, 0)),
        hidden_bias=np.zeros(0),
        output_weights=np.zeros((0, outputs)),
        output_bias=weights[0],
        direct=weights[1:],
    )


class Importance(NamedTuple):
    """How much each input moves each output in a linear fit."""

    inputs: list[str]
    """Names of the inputs."""
    outputs: list[str]
    """Names of the outputs."""
    weight: NDArray[np.float64]
    """Standardised weights: standard deviations of the output a standard deviation of the input, (inputs, outputs).

    Inputs that are nearly combinations of others share their effect, so read lags of one quantity together."""

    def ranking(self, output: int) -> list[tuple[str, float]]:
        """Return the inputs and weights of one output, the weightiest first."""
        order = np.argsort(-np.abs(self.weight[:, output]), kind="stable")
        return [(self.inputs[i], float(self.weight[i, output])) for i in order]


def importance(linear: Network, x: ArrayLike, y: ArrayLike, inputs: list[str], outputs: list[str]) -> Importance:
    """Return the standardised weights of a ``linear`` fit to ``y`` (n, outputs) at ``x`` (n, inputs).

    Raises:
        ValueError: ``linear`` has hidden units.

    """
    if linear.direct is None or linear.hidden_bias.size:
        raise ValueError("only the weights of a linear fit show the importance of its inputs")
    spread_x, spread = (np.asarray(a, np.float64).std(axis=0) for a in (x, y))
    return Importance(inputs, outputs, linear.direct * spread_x[:, None] / np.where(spread > 0, spread, 1.0))
