"""How fast joints are, by which a search of plans knows how much of the way is left.

With several joints there are too many plans to try all that are cheaper than the best one. A search that adds to the
cost of each beginning what the rest of the way takes at least (A*) tries those last that lead away from the goal.
What joints never exceed says little of that: they are rarely as fast. What they do not exceed in nine of ten periods,
while valves change at random but as rarely as in a plan, is no bound, but a good guess. Valves that change more often
keep slow joints from getting fast, and plans are then taken for the best that are not.
"""

from typing import Any

import numpy as np

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import VALVES, possible_actions
from pneumarm.planning.search import Agility, advance, copy

_SHARE, _HASTY_SHARE = 0.9, 0.75
"""Of the periods of two joints, and of those of more, whose actions are so many that a surer search ends for want of
room."""
_ROLLOUTS = 50
_STEPS = 40
_CHANGED = 0.05
"""Probability that the valves of a joint change in a period."""


def agility_of(world: Any, states: Any, spec: ArmSpec) -> Agility:
    """Return how fast joints are, and how fast they gain speed, in most periods of random valves.

    Rollouts begin in the first of the ``states`` and pass in the second one.
    """
    joints, period, random = spec.joints, 1e3 * spec.period, np.random.default_rng(0)
    possible = np.flatnonzero(possible_actions(spec.muscles))
    speeds = np.empty((_ROLLOUTS, _STEPS, joints))
    for rollout in range(_ROLLOUTS):
        copy(states, 1, 0)
        actions = random.choice(possible, joints)
        for step in range(_STEPS):
            actions = np.where(random.random(joints) < _CHANGED, random.choice(possible, joints), actions)
            valves = VALVES[actions].copy()
            valves[(valves > 0) & (states.pressure[1] > world.limit)] = 0  # as a guard would
            advance(world, states, 1, valves)
            speeds[rollout, step] = states.velocity[1] * period
    gained = np.abs(np.diff(speeds, axis=1)).reshape(-1, joints)
    share = _SHARE if joints == 2 else _HASTY_SHARE
    speed, acceleration = (
        np.quantile(values, share, axis=0) for values in (np.abs(speeds).reshape(-1, joints), gained)
    )
    return Agility(np.maximum(speed, 1e-9), np.maximum(acceleration, 1e-9), period)
