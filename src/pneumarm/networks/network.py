"""A multilayer network with one hidden layer: tansig hidden units, linear outputs (thesis section 4.2.6)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Network:
    """y = tanh(x W1 + b1) W2 + b2 + x D.

    ``D`` leads directly from the inputs to the outputs; the thesis' networks have none. A network without hidden
    units but with ``D`` is a linear model, so that a least-squares fit stands in the same place as a network.
    """

    hidden_weights: NDArray[np.float64]
    """W1, shape (inputs, hidden)."""
    hidden_bias: NDArray[np.float64]
    """b1, shape (hidden,)."""
    output_weights: NDArray[np.float64]
    """W2, shape (hidden, outputs)."""
    output_bias: NDArray[np.float64]
    """b2, shape (outputs,)."""
    direct: NDArray[np.float64] | None = None
    """D, shape (inputs, outputs), or None."""

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the outputs (n, outputs) for the inputs ``x`` (n, inputs)."""
        x = np.asarray(x, np.float64)
        y: NDArray[np.float64] = np.tanh(x @ self.hidden_weights + self.hidden_bias) @ self.output_weights
        y += self.output_bias
        return y if self.direct is None else y + x @ self.direct
