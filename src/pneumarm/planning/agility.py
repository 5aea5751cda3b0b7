"""How fast joints are, by which a search of plans knows how much of the way is left.

With several joints there are too many plans to try all that are cheaper than the best one. A search that adds to the
cost of each beginning what the rest of the way takes at least (A*) tries those last that lead away from the goal.
What joints never exceed says little of that: they are rarely as fast. What they do not exceed in nine of ten periods,
while valves change at random but as rarely as in a plan, is no bound, but a good guess. Valves that change more often
keep slow joints from getting fast, and plans are then taken for the best that are not.

What they do not exceed in three of four periods is a hasty guess: with it a search finds some plan where it would
otherwise end for want of room.
"""

from typing import Any

import numpy as np

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import VALVES, possible_actions
from pneumarm.planning.search import Agility
from pneumarm.planning.world import advance, copy

_SHARES = 0.9, 0.75
_ROLLOUTS = 50
_LENGTH = 4 / 3
"""Of a rollout [s]."""
_CHANGED = 1.5
"""How often the valves of a joint change in a second, on average."""


def agility_of(world: Any, states: Any, spec: ArmSpec) -> tuple[Agility, Agility]:
    """Return how fast joints are, and how fast they gain speed, in most periods of random valves; and hastily.

    Rollouts begin in the first of the ``states`` and pass in the second one.
    """
    joints, period, random = spec.joints, 1e3 * spec.period, np.random.default_rng(0)
    possible = np.flatnonzero(possible_actions(spec.muscles))
    steps, changed = max(round(_LENGTH / spec.period), 2), _CHANGED * spec.period
    speeds = np.empty((_ROLLOUTS, steps, joints))
    for rollout in range(_ROLLOUTS):
        copy(states, 1, 0)
        actions = random.choice(possible, joints)
        for step in range(steps):
            actions = np.where(random.random(joints) < changed, random.choice(possible, joints), actions)
            valves = VALVES[actions].copy()
            valves[(valves > 0) & (states.pressure[1] > world.limit)] = 0  # as a guard would
            advance(world, states, 1, valves)
            speeds[rollout, step] = states.velocity[1] * period
    gained = np.abs(np.diff(speeds, axis=1)).reshape(-1, joints)
    speed, acceleration = (
        np.maximum(np.quantile(values, _SHARES, axis=0), 1e-9)
        for values in (np.abs(speeds).reshape(-1, joints), gained)
    )
    sure, hasty = (Agility(*one, period) for one in zip(speed, acceleration, strict=True))
    return sure, hasty
