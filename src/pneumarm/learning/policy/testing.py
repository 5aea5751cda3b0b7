"""A policy's test in the simulation: the begin states and goals of every baseline, many movements side by side."""

import numpy as np

from pneumarm.errors import UnusableInput
from pneumarm.kernels import kernel
from pneumarm.learning.policy.acting import Mind, lanes, run_lanes
from pneumarm.random import random_state, random_states
from pneumarm.task.environment import begin_episode
from pneumarm.task.fleet import one
from pneumarm.task.movements import NOISE, Movements, movements
from pneumarm.task.noting import note_begin

_TOGETHER = 256


def run_policy(mind: Mind, sizes: tuple[int, ...], episodes: int, seed: tuple[int, ...]) -> Movements:
    """Return ``episodes`` greedy movements of a policy of ``sizes``, without lookahead.

    ``seed`` decides begin states and goals alone, as in :func:`pneumarm.learning.test`.
    """
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    random = random_state(seed)
    arms = lanes(mind, sizes, random_states((*seed, NOISE), min(episodes, _TOGETHER)))
    record = movements(episodes, arms.actions.shape[1])
    for first in range(0, episodes, _TOGETHER):
        count = min(_TOGETHER, episodes - first)
        _begin(mind, arms, random, record, first, count)
        run_lanes(mind, arms, record, first, count)
    return record


@kernel
def _begin(mind, lanes, random, record, first, count):  # type: ignore[no-untyped-def]
    """Let ``count`` lanes begin episodes one after another, as a single environment does."""
    task, arms = mind.environment.task, lanes.fleet
    for e in range(count):
        arm = one(arms, e)
        begin_episode(mind.environment, arm, np.inf, random)
        arms.taken[e] = 0
        for joint in range(arm.goal.shape[0]):
            arms.still[e, joint] = 0
        note_begin(task, arm, record, first + e)
