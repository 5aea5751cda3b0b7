"""A policy acting greedily, as it is or after looking ahead.

Looking ahead takes each action that the policy finds probable, in many copies of the simulated arm with the noise of
the simulation, lets the policy go on greedily from there until the goal, and keeps the action whose mean return is
highest. One step of such a search never makes a policy worse where the simulation is right, and as the noise is
averaged over and the policy is trusted for all that follows, it leans little on where it is wrong.

Source: G. Tesauro and G. R. Galperin, "On-line policy improvement using Monte-Carlo search", NIPS 1996.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.kernels import inner, kernel, part
from pneumarm.learning.policy.inputs import InputParameters, write_policy_inputs
from pneumarm.learning.policy.proximal import FORBIDDEN, log_softmax, write_bias
from pneumarm.networks.layers import Layers, forward, workspace
from pneumarm.random import RandomState
from pneumarm.simulation.noise import begin_noise
from pneumarm.task.environment import Environment
from pneumarm.task.fleet import Fleet, Limits, fleet, gained_by, take_alive, take_all
from pneumarm.task.noting import note_alive


class Mind(NamedTuple):
    """What decides, and does not change."""

    environment: Environment
    limits: Limits
    inputs: InputParameters
    layers: Layers
    """Layers of the policy."""
    hold: float
    seeds: RandomState
    """Seeds of the noise in which it looks ahead, the same in every decision, shape (lanes, 4)."""


class Lanes(NamedTuple):
    """Simulated arms in which a policy acts, and workspace for its decisions. Made by :func:`lanes`."""

    fleet: Fleet
    rows: NDArray[np.float32]
    """Shape (network's inputs, n)."""
    units: Layers
    bias: NDArray[np.float32]
    """Shape (9 joints, n)."""
    probability: NDArray[np.float32]
    """Same shape."""
    actions: NDArray[np.int64]
    """Shape (n, joints)."""
    is_reached: NDArray[np.bool_]
    """Shape (n,)."""
    total: NDArray[np.float64]
    """Return so far, shape (n,)."""
    alive: NDArray[np.bool_]
    """Whether the movement goes on, shape (n,)."""


def lanes(mind: Mind, sizes: tuple[int, ...], random: RandomState) -> Lanes:
    """Return as many lanes as there are random states in ``random`` (n, 4), for a policy of ``sizes``."""
    n, joints = len(random), mind.environment.simulation.layout.joints
    return Lanes(
        fleet=fleet(mind.environment, random),
        rows=np.zeros((sizes[0], n), np.float32),
        units=workspace(sizes, n),
        bias=np.zeros((ACTIONS * joints, n), np.float32),
        probability=np.zeros((ACTIONS * joints, n), np.float32),
        actions=np.zeros((n, joints), np.int64),
        is_reached=np.zeros(n, np.bool_),
        total=np.zeros(n),
        alive=np.ones(n, np.bool_),
    )


@inner
def judge_all(mind, lanes):  # type: ignore[no-untyped-def]
    """Let ``lanes.units[-1]`` be the logits of the actions, and ``lanes.actions`` the most probable, where alive."""
    arms = lanes.fleet
    write_policy_inputs(mind.inputs, arms.x, arms.actions, lanes.rows)
    forward(mind.layers, lanes.rows, lanes.units)
    for e in range(lanes.actions.shape[0]):
        if not lanes.alive[e]:
            continue
        write_bias(mind.limits, mind.hold, arms.x[:, e], arms.actions[e], arms.still[e], lanes.bias, e)
    logits = lanes.units[-1]
    for e in range(lanes.actions.shape[0]):
        if not lanes.alive[e]:
            continue
        for joint in range(lanes.actions.shape[1]):
            first, best = ACTIONS * joint, 0
            for action in range(ACTIONS):
                logits[first + action, e] += lanes.bias[first + action, e]
                if logits[first + action, e] > logits[first + best, e]:
                    best = action
            lanes.actions[e, joint] = best


@kernel
def run_lanes(mind, lanes, record, first, count):  # type: ignore[no-untyped-def]
    """Let the policy move in ``count`` lanes that have begun, and write entries from ``first`` on into ``record``."""
    task, arms, left = mind.environment.task, lanes.fleet, count
    for e in range(lanes.alive.shape[0]):
        lanes.alive[e] = e < count
    while left > 0:
        judge_all(mind, lanes)
        take_all(mind.environment, mind.limits, arms, lanes.actions, lanes.is_reached)
        left -= note_alive(task, arms, lanes.alive, lanes.is_reached, record, first)


@inner
def copy_all(mind, lanes, arm, samples):  # type: ignore[no-untyped-def]
    """Make every lane the first of the fleet ``arm``; equal ``samples`` (n,) get equal noise."""
    arms, goal_place = lanes.fleet, mind.limits.layout.goal
    unit = mind.environment.task.unit
    for e in range(samples.shape[0]):
        for i in range(arms.x.shape[0]):
            arms.x[i, e] = arm.x[i, 0]
        for word in range(4):
            arms.random[e, word] = mind.seeds[samples[e], word]
        for joint in range(arms.goal.shape[1]):
            arms.goal[e, joint] = unit[joint, 0] + unit[joint, 1] * arm.x[goal_place + joint, 0]
            arms.actions[e, joint] = arm.actions[0, joint]
            arms.still[e, joint] = arm.still[0, joint]
        begin_noise(mind.environment.noise, arms.average[:, e], arms.random[e])
        lanes.total[e] = 0.0
        lanes.alive[e] = True


@inner
def move_all(mind, lanes, horizon):  # type: ignore[no-untyped-def]
    """Take ``lanes.actions``, then go on greedily for ``horizon`` steps at most; sum up ``lanes.total``."""
    for k in range(horizon):
        if k > 0:
            judge_all(mind, lanes)
        take_alive(mind.environment, mind.limits, lanes.fleet, lanes.actions, lanes.alive, lanes.is_reached)
        is_done = True
        for e in range(lanes.total.shape[0]):
            if lanes.alive[e]:
                lanes.total[e] += gained_by(mind.environment.task, lanes.fleet, e, lanes.is_reached[e])
                lanes.alive[e] = not lanes.is_reached[e]
                is_done = is_done and not lanes.alive[e]
        if is_done:
            break


@part
def best_of(total, count):  # type: ignore[no-untyped-def]
    """Return which of ``count`` choices has the highest mean ``total`` (n,), that of ``e`` being of ``e % count``."""
    n, best, highest = total.shape[0], 0, -np.inf
    for place in range(count):
        added = 0.0
        for e in range(place, n, count):
            added += total[e]
        mean = added / ((n - place + count - 1) // count)
        if mean > highest:
            best, highest = place, mean
    return best


@kernel
def decide_ahead(mind, single, lanes, samples, horizon, clear):  # type: ignore[no-untyped-def]
    """Set ``single.actions`` (1, joints) to what to do in the arm of ``single``, looking ahead where it is not clear.

    ``single`` are lanes with one arm, ``samples`` is workspace, shape (n,).
    """
    judge_all(mind, single)
    if lanes.total.shape[0] == 0:
        return
    log_softmax(single.units[-1], np.zeros_like(single.bias), single.probability)
    n = lanes.total.shape[0]
    for joint in range(single.actions.shape[1]):
        first = ACTIONS * joint
        candidates = np.zeros(ACTIONS, np.int64)
        count = 0
        for action in range(ACTIONS):
            allowed = single.bias[first + action, 0] > FORBIDDEN
            if allowed and single.probability[first + action, 0] >= clear:
                candidates[count] = action
                count += 1
        if count < 2:
            continue
        for e in range(n):
            samples[e] = e // count
        copy_all(mind, lanes, single.fleet, samples)
        for e in range(n):
            for other in range(single.actions.shape[1]):
                lanes.actions[e, other] = single.actions[0, other]
            lanes.actions[e, joint] = candidates[e % count]
        move_all(mind, lanes, horizon)
        single.actions[0, joint] = candidates[best_of(lanes.total, count)]
