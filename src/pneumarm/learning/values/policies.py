"""Which action to take, by what each is worth (section 4.2.2).

    greedy          the action of the highest value
    epsilon-greedy  with probability epsilon any action, all alike; otherwise the greedy one
    boltzmann       P(a) = exp(Q(s, a) / T) / sum_b exp(Q(s, b) / T)                                  (eq. 4.8)
    max-boltzmann   with probability epsilon another than the greedy action, by eq. 4.8; otherwise the greedy one

The last is the thesis' own, see :mod:`pneumarm.learning.online.exploration`. An action of the value
:data:`~pneumarm.arm.valves.NEVER` is never chosen.
"""

import math
from typing import Literal, get_args

import numpy as np

from pneumarm.arm.valves import NEVER
from pneumarm.kernels import kernel, part
from pneumarm.learning.online.exploration import choose, greedy
from pneumarm.random import uniform

PolicyName = Literal["greedy", "epsilon-greedy", "boltzmann", "max-boltzmann"]
POLICIES: tuple[PolicyName, ...] = get_args(PolicyName)
"""A kernel takes a policy as its place here."""
GREEDY, EPSILON_GREEDY, BOLTZMANN, MAX_BOLTZMANN = range(4)
_POSSIBLE = 0.5 * NEVER


@kernel
def boltzmann(values, temperature, odds):  # type: ignore[no-untyped-def]
    """Set ``odds`` (choices,) to the probabilities of eq. 4.8."""
    highest, total = values[greedy(values)], np.float32(0.0)  # subtracted, so that no exponential overflows
    for action in range(values.shape[0]):
        odds[action] = math.exp((values[action] - highest) / np.float32(temperature))
        total += odds[action]
    for action in range(values.shape[0]):
        odds[action] /= total


@part
def _random_possible(values, odds):  # type: ignore[no-untyped-def]
    """Set ``odds`` (choices,) to the same for all actions that the arm has."""
    possible = 0
    for action in range(values.shape[0]):
        possible += 1 if values[action] > _POSSIBLE else 0
    for action in range(values.shape[0]):
        odds[action] = np.float32(1.0) / possible if values[action] > _POSSIBLE else np.float32(0.0)


@part
def _drawn(odds, random):  # type: ignore[no-untyped-def]
    """Return an action by its ``odds`` (choices,), which sum to 1."""
    left, last = uniform(random), 0
    for action in range(odds.shape[0]):
        if odds[action] > 0.0:
            last = action  # also where rounding leaves a rest
            left -= odds[action]
            if left < 0.0:
                break
    return last


@kernel
def act_by(policy, values, epsilon, temperature, odds, random):  # type: ignore[no-untyped-def]
    """Return the action that ``policy`` takes; ``odds`` (choices,) is workspace."""
    if policy == MAX_BOLTZMANN:
        return choose(values, epsilon, temperature, odds, random)
    if policy == BOLTZMANN:
        boltzmann(values, temperature, odds)
        return _drawn(odds, random)
    if policy == EPSILON_GREEDY and uniform(random) < epsilon:
        _random_possible(values, odds)
        return _drawn(odds, random)
    return greedy(values)
