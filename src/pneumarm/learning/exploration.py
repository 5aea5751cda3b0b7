"""Which action to take: max-Boltzmann exploration with the greedy action disabled (section 4.2.2, eq. 4.8)."""

import math

from pneumarm.kernels import kernel
from pneumarm.random import uniform


@kernel(_nrt=False, forceinline=True)
def greedy(values):  # type: ignore[no-untyped-def]
    """Return the action with the highest of ``values`` (9,), the first of equals."""
    best = 0
    for action in range(1, values.shape[0]):
        if values[action] > values[best]:
            best = action
    return best


@kernel(_nrt=False, forceinline=True)
def choose(values, epsilon, temperature, random):  # type: ignore[no-untyped-def]
    """Return the greedy action, or with probability ``epsilon`` another one by the Boltzmann distribution."""
    best = greedy(values)
    if uniform(random) >= epsilon:
        return best
    second = -math.inf
    for action in range(values.shape[0]):
        if action != best:
            second = max(second, float(values[action]))
    total = 0.0
    for action in range(values.shape[0]):
        if action != best:
            total += math.exp((values[action] - second) / temperature)
    left = uniform(random) * total
    chosen = best
    for action in range(values.shape[0]):
        if action != best:
            chosen = action
            left -= math.exp((values[action] - second) / temperature)
            if left < 0.0:
                break
    return chosen
