"""Radial basis functions: Gaussian bumps around points that fill the space of states evenly (section 4.2.6).

    phi_i(s) = exp(-|s - c_i|^2 / 2 sigma^2), scaled to unit length

Difference from the source: bumps of less than a hundredth of the nearest one count as 0.
Source: Sutton and Barto, Reinforcement Learning, section 9.5.5.
"""

import math

import numpy as np

from pneumarm.kernels import part
from pneumarm.learning.values.approximators.coding import RADIAL, Coding, coding, spread_evenly

_LEAST = 0.01


def radial(variables: int, count: int, width: float) -> Coding:
    """Return ``count`` basis functions of this ``width`` (sigma), a share of the range of each variable."""
    return coding(RADIAL, count, count, variables, centres=spread_evenly(count, variables), reach=width)


@part
def write_radial(coding, z, places, amounts):  # type: ignore[no-untyped-def]
    """Write the basis functions of ``z`` (variables,) that are not 0; return how many."""
    centres, factor = coding.centres, np.float32(-0.5 / coding.reach**2)
    nearest = np.float32(np.inf)
    for c in range(centres.shape[0]):
        distance = np.float32(0.0)
        for i in range(centres.shape[1]):
            distance += (z[i] - centres[c, i]) ** 2
        amounts[c] = distance
        nearest = min(nearest, distance)
    count, total = 0, np.float32(0.0)
    for c in range(centres.shape[0]):
        exponent = factor * (amounts[c] - nearest)  # by the nearest, so that it is not 0 far from all of them
        if exponent > np.float32(math.log(_LEAST)):
            places[count], amounts[count] = c, math.exp(exponent)
            total += amounts[count] * amounts[count]
            count += 1
    for k in range(count):
        amounts[k] /= math.sqrt(total)
    return count
