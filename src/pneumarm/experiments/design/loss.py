"""Loss functions: one number for the results of a trial in all runs (thesis section 5.3).

The thesis takes the mean and the standard deviation, in the unit of the results. Taguchi's signal-to-noise ratios
are logarithmic, in decibel, and always the larger the better:

    larger is better     -10 log10 mean(1 / y^2)
    smaller is better    -10 log10 mean(y^2)
    nominal is best       10 log10 (mean(y)^2 / var(y))
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput

Array = NDArray[np.float64]
Loss = Literal["mean", "std", "larger", "smaller", "nominal"]


def loss(results: ArrayLike, kind: Loss) -> Array:
    """Return the loss of every trial (trials,) from ``results`` (trials, runs).

    ``std`` is the sample standard deviation (n - 1); it and ``nominal`` need two runs.

    Raises:
        UnusableInput: too few runs, or a ratio that is not defined for these results.

    """
    y = np.asarray(results, np.float64)
    if y.ndim != 2 or y.shape[1] < (2 if kind in ("std", "nominal") else 1):
        raise UnusableInput(f"loss {kind!r}: expected results of trials by runs, two runs at least, got {y.shape}")
    if kind == "mean":
        return np.asarray(y.mean(axis=1))
    if kind == "std":
        return np.asarray(y.std(axis=1, ddof=1))
    if kind == "nominal":
        variance = y.var(axis=1, ddof=1)
        _require(bool((variance > 0).all() and (y.mean(axis=1) != 0).all()), kind, "a mean and a variance besides 0")
        return np.asarray(10 * np.log10(y.mean(axis=1) ** 2 / variance))
    _require(bool((y > 0).all()), kind, "results above 0")
    square = (y**-2 if kind == "larger" else y**2).mean(axis=1)
    return np.asarray(-10 * np.log10(square))


def _require(holds: bool, kind: str, what: str) -> None:
    if not holds:
        raise UnusableInput(f"the signal-to-noise ratio {kind!r} needs {what} in every trial; use mean and std")
