"""The thesis' action values, learned in many arms at once.

    repeat: act for some steps in all arms at once; then, several times over, move Q(s_k, a_k) towards
        G_k = r_{k+1} + gamma ((1 - lambda) max_b Q(s_{k+1}, b) + lambda G_{k+1})

A goal is terminal, its value is 0. A cut-off episode looks ahead to a state worth as much as its last one.

The nine networks of all joints are one network here, whose outputs see the hidden units of their own action only.

Source: J. Peng and R. J. Williams, "Incremental multi-step Q-learning", Machine Learning 22, 1996; its targets are
used for batches, by Adam, in place of traces.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.kernels import inner, kernel
from pneumarm.learning.online.exploration import choose, greedy
from pneumarm.learning.online.values import Networks
from pneumarm.learning.policy.inputs import write_policy_inputs
from pneumarm.networks.layers import adam, backward, forward, split
from pneumarm.random import integer
from pneumarm.task.environment import CUT_OFF, GOES_ON, REACHED, ending
from pneumarm.task.fleet import begin_one, gained_by, take_all
from pneumarm.task.reward import paid
from pneumarm.transitions.window import Window


class ValueBatch(NamedTuple):
    """What ``n`` arms did in ``steps`` steps. Made by :func:`value_batch`."""

    inputs: NDArray[np.float32]
    """Shape (steps + 1, inputs, n)."""
    actions: NDArray[np.int64]
    """Shape (steps, n, joints)."""
    reward: NDArray[np.float64]
    """Shape (steps, n, joints), in units of the scale of returns."""
    ended: NDArray[np.int64]
    """How episodes are after each step, see :func:`~pneumarm.task.environment.ending`, shape (steps, n)."""
    best: NDArray[np.float64]
    """Highest action values, shape (steps + 1, n, joints), in units of the scale of returns."""
    target: NDArray[np.float64]
    """G, shape (steps, n, joints)."""
    is_reached: NDArray[np.bool_]
    """Workspace, shape (n,)."""
    values: NDArray[np.float32]
    """Workspace, shape (9,)."""
    odds: NDArray[np.float32]
    """Workspace, shape (9,)."""
    order: NDArray[np.int64]
    """Workspace, shape (steps,)."""


def value_batch(steps: int, inputs: int, joints: int, n: int) -> ValueBatch:
    """Return workspace for ``steps`` of ``n`` arms."""
    each = (steps, n, joints)
    return ValueBatch(
        inputs=np.zeros((steps + 1, inputs, n), np.float32),
        actions=np.zeros(each, np.int64),
        reward=np.zeros(each),
        ended=np.zeros((steps, n), np.int64),
        best=np.zeros((steps + 1, n, joints)),
        target=np.zeros(each),
        is_reached=np.zeros(n, np.bool_),
        values=np.zeros(ACTIONS, np.float32),
        odds=np.zeros(ACTIONS, np.float32),
        order=np.zeros(steps, np.int64),
    )


class ValueRule(NamedTuple):
    """How action values are learned."""

    discount: float
    """gamma."""
    decay: float
    """lambda."""
    epochs: int
    """How often each step of a batch is learned from."""
    largest: float
    """Longest gradient."""
    scale: float
    """Return that a value of 1 stands for."""


def network_sizes(window: Window, hidden: int) -> tuple[int, int, int]:
    """Return inputs, hidden units and outputs of all networks as one."""
    outputs = ACTIONS * window.joints
    return window.state_size + window.joints + 1, hidden * outputs, outputs


def connections(window: Window, hidden: int) -> NDArray[np.float32]:
    """Return 1 for the weights that nine networks a joint have, 0 for the others, shape (size,).

    Hidden unit ``h`` of action ``a`` of joint ``j`` is at ``9 (hidden j + h) + a``, its output at ``9 j + a``. No
    network sees whether an action is the first of an episode.
    """
    inputs, units, outputs = sizes = network_sizes(window, hidden)
    mask = np.ones((inputs + 1) * units + (units + 1) * outputs, np.float32)
    first, last = split(mask, sizes)
    first[inputs - 1] = 0
    unit, output = np.arange(units), np.arange(outputs)
    joint, action = unit // (ACTIONS * hidden), unit % ACTIONS
    last[:-1] = (ACTIONS * joint + action)[:, None] == output
    return mask


def to_networks(flat: NDArray[np.float32], window: Window, hidden: int) -> Networks:
    """Return the weights ``flat`` as the networks of an agent."""
    joints, inputs = window.joints, window.state_size + window.joints
    first, last = split(flat, network_sizes(window, hidden))
    shape = (joints, hidden, ACTIONS)
    unit = np.arange(first.shape[1])
    own = last[unit, ACTIONS * (unit // (ACTIONS * hidden)) + unit % ACTIONS]
    return Networks(
        first[:inputs].reshape(inputs, *shape).transpose(1, 3, 0, 2).copy(),
        first[-1].reshape(shape).transpose(0, 2, 1).copy(),
        own.reshape(shape).transpose(0, 2, 1).copy(),
        last[-1].reshape(joints, ACTIONS).copy(),
    )


@kernel
def collect_values(mind, rule, exploration, net, fleet, batch):  # type: ignore[no-untyped-def]
    """Fill ``batch``, exploring with an epsilon and a temperature; return episodes, successes and sum of rewards."""
    environment, task, part = mind.environment, mind.environment.task, 1.0 / rule.scale
    steps, n, joints = batch.reward.shape
    episodes, successes, total = 0, 0, 0.0
    for k in range(steps + 1):
        write_policy_inputs(mind.inputs, fleet.x, fleet.actions, batch.inputs[k])
        forward(net.layers, batch.inputs[k], net.units)
        for e in range(n):
            for joint in range(joints):
                for action in range(ACTIONS):
                    batch.values[action] = net.units[-1][ACTIONS * joint + action, e] * np.float32(rule.scale)
                batch.best[k, e, joint] = batch.values[greedy(batch.values)] * part
                if k < steps:
                    batch.actions[k, e, joint] = choose(
                        batch.values, exploration[0], exploration[1], batch.odds, fleet.random[e]
                    )
        if k == steps:
            break
        take_all(environment, mind.limits, fleet, batch.actions[k], batch.is_reached)
        for e in range(n):
            is_reached = batch.is_reached[e]
            total += gained_by(task, fleet, e, is_reached)
            for joint in range(joints):
                batch.reward[k, e, joint] = part * paid(task.reward, is_reached, fleet.switched[e, joint])
            batch.ended[k, e] = ending(task, is_reached, fleet.taken[e])
            if batch.ended[k, e] != GOES_ON:
                episodes += 1
                successes += 1 if is_reached else 0
                begin_one(environment, fleet, e)
    return episodes, successes, total


@inner
def lambda_returns(reward, ended, best, discount, decay, target):  # type: ignore[no-untyped-def]
    """Set ``target`` to G, see the top of this module; shapes as in :class:`ValueBatch`."""
    steps, n, joints = reward.shape
    for e in range(n):
        for joint in range(joints):
            later = best[steps, e, joint]
            for back in range(steps):
                k = steps - 1 - back
                if ended[k, e] == REACHED:
                    ahead = 0.0
                elif ended[k, e] == CUT_OFF:
                    ahead = best[k, e, joint]
                else:
                    ahead = (1.0 - decay) * best[k + 1, e, joint] + decay * later
                later = reward[k, e, joint] + discount * ahead
                target[k, e, joint] = later


@kernel
def improve_values(rule, net, batch, rate, count, random):  # type: ignore[no-untyped-def]
    """Learn from ``batch`` with the learning ``rate``; return how many updates there are now."""
    steps, n, joints = batch.reward.shape
    lambda_returns(batch.reward, batch.ended, batch.best, rule.discount, rule.decay, batch.target)
    values, errors, part = net.units[-1], net.errors[-1], 1.0 / n
    for k in range(steps):
        batch.order[k] = k
    for _ in range(rule.epochs):
        for k in range(steps - 1, 0, -1):
            other = integer(random, k + 1)
            batch.order[k], batch.order[other] = batch.order[other], batch.order[k]
        for place in range(steps):
            k = batch.order[place]
            forward(net.layers, batch.inputs[k], net.units)
            for row in range(errors.shape[0]):
                for e in range(n):
                    errors[row, e] = np.float32(0.0)
            for e in range(n):
                for joint in range(joints):
                    row = ACTIONS * joint + batch.actions[k, e, joint]
                    errors[row, e] = part * (values[row, e] - batch.target[k, e, joint])
            backward(net, batch.inputs[k])
            count += 1
            adam(net, rate, rule.largest, count)
    return count
