"""Which effects are more than noise, without replication: half-normal plots and Lenth's test.

In a half-normal plot the effects are sorted and drawn against

    P_i = (i - 0.5) / m * 100 %        (thesis eq. 5.3, m = 15)

on an axis on which noise lies on a straight line through the origin. Lenth tells where it ends: his pseudo standard
error is robust against the few effects that are real,

    s_0 = 1.5 median |c_j|,    PSE = 1.5 median { |c_j| : |c_j| < 2.5 s_0 },    with m / 3 degrees of freedom

(R. V. Lenth, Quick and easy analysis of unreplicated factorials, Technometrics 31, 1989). An effect beyond the margin
of error is significant on its own; beyond the simultaneous margin it is, although the largest of m was looked for.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.distributions import half_normal_quantile, t_quantile

Array = NDArray[np.float64]

CONFIDENCE = 0.95


def percentages(count: int) -> Array:
    """Return P_i of eq. 5.3 for i = 1 ... ``count`` [%]."""
    return (np.arange(1, count + 1) - 0.5) / count * 100


def positions(count: int) -> Array:
    """Return where these percentages lie on the half-normal axis, in standard deviations, shape (count,)."""
    return np.array([half_normal_quantile(p / 100) for p in percentages(count)])


class Lenth(NamedTuple):
    """What Lenth's test says of a set of effects."""

    pseudo_standard_error: float
    margin: float
    """Margin of error of one effect that was chosen beforehand."""
    simultaneous_margin: float
    """Margin of error of the largest effect."""


def lenth(sizes: ArrayLike, confidence: float = CONFIDENCE) -> Lenth:
    """Return Lenth's pseudo standard error and margins for effects of these ``sizes`` (m,).

    Raises:
        UnusableInput: there are fewer than three effects.

    """
    size = np.abs(np.asarray(sizes, np.float64))
    m = len(size)
    if m < 3:
        raise UnusableInput(f"Lenth's test needs three effects at least, got {m}")
    first = 1.5 * float(np.median(size))
    small = size[size < 2.5 * first]
    error = 1.5 * float(np.median(small)) if len(small) else 0.0
    simultaneous = confidence ** (1 / m)
    return Lenth(error, error * t_quantile(confidence, m / 3), error * t_quantile(simultaneous, m / 3))
