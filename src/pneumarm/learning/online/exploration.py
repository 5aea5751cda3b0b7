"""Which action to take: max-Boltzmann exploration with the greedy action disabled (section 4.2.2, eq. 4.8)."""

import math

import numpy as np

from pneumarm.kernels import part
from pneumarm.random import uniform


@part
def greedy(values):  # type: ignore[no-untyped-def]
    """Return the action with the highest of ``values`` (9,), the first of equals."""
    best, highest = 0, values[0]
    for action in range(1, values.shape[0]):
        if values[action] > highest:
            best, highest = action, values[action]
    return best


@part
def choose(values, epsilon, temperature, odds, random):  # type: ignore[no-untyped-def]
    """Return the greedy action, or with probability ``epsilon`` another one by the Boltzmann distribution.

    ``odds`` (9,) is workspace for its probabilities, up to a factor.
    """
    best = greedy(values)
    if uniform(random) >= epsilon:
        return best
    second = -math.inf  # the highest of the others, so that no exponential overflows
    for action in range(values.shape[0]):
        odds[action] = np.float32(-math.inf) if action == best else values[action]
        second = max(second, odds[action])
    total, rate = np.float32(0.0), np.float32(1.0 / temperature)
    for action in range(values.shape[0]):
        odds[action] = math.exp((odds[action] - np.float32(second)) * rate)
        total += odds[action]
    left = np.float32(uniform(random)) * total
    last = best
    for action in range(values.shape[0]):
        if odds[action] > 0.0:  # one that is never to be chosen is not, however a draw is rounded
            last = action
            left -= odds[action]
            if left < 0.0:
                break
    return last
