"""A multilayer network with one hidden layer, or two: tansig hidden units, linear outputs (thesis section 4.2.6)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Network:
    """y = h W2 + b2 + x D of the hidden units h = tanh(x W1 + b1), or of a second layer, tanh(h W + b).

    ``D`` leads directly from the inputs to the outputs; the thesis' networks have none, and one hidden layer. A
    network without hidden units but with ``D`` is a linear model, so that a least-squares fit stands in the same
    place as a network.
    """

    hidden_weights: NDArray[np.float64]
    """W1, shape (inputs, hidden)."""
    hidden_bias: NDArray[np.float64]
    """b1, shape (hidden,)."""
    output_weights: NDArray[np.float64]
    """W2, shape (hidden units of the last layer, outputs)."""
    output_bias: NDArray[np.float64]
    """b2, shape (outputs,)."""
    direct: NDArray[np.float64] | None = None
    """D, shape (inputs, outputs), or None."""
    second_weights: NDArray[np.float64] | None = None
    """W, shape (hidden, hidden units of the second layer), or None."""
    second_bias: NDArray[np.float64] | None = None
    """b, shape (hidden units of the second layer,), or None."""

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the outputs (n, outputs) for the inputs ``x`` (n, inputs)."""
        x = np.asarray(x, np.float64)
        y = self.units(x) @ self.output_weights + self.output_bias
        return y if self.direct is None else y + x @ self.direct

    def units(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the units of the last hidden layer (n, hidden) for the inputs ``x`` (n, inputs)."""
        units: NDArray[np.float64] = np.tanh(x @ self.hidden_weights + self.hidden_bias)
        if self.second_weights is None or self.second_bias is None:
            return units
        second: NDArray[np.float64] = np.tanh(units @ self.second_weights + self.second_bias)
        return second

    def reading(self, inputs: NDArray[np.int64]) -> "Network":
        """Return it as a network of those ``inputs`` alone, in their order."""
        direct = None if self.direct is None else self.direct[inputs]
        return replace(self, hidden_weights=self.hidden_weights[inputs], direct=direct)

    def widened(self, inputs: NDArray[np.int64], size: int) -> "Network":
        """Return it, which reads ``inputs`` of ``size`` ones, as a network of all, with no weight on the others."""

        def wide(weights: NDArray[np.float64]) -> NDArray[np.float64]:
            whole = np.zeros((size, weights.shape[1]))
            whole[inputs] = weights
            return whole

        direct = None if self.direct is None else wide(self.direct)
        return replace(self, hidden_weights=wide(self.hidden_weights), direct=direct)

    def times(self, factor: NDArray[np.float64]) -> "Network":
        """Return it with outputs that are ``factor`` (outputs,) times as large."""
        return replace(
            self,
            output_weights=self.output_weights * factor,
            output_bias=self.output_bias * factor,
            direct=None if self.direct is None else self.direct * factor,
        )
