"""A policy over a joint's nine actions, and its improvement by proximal policy optimisation.

    repeat: act by the policy pi for some steps in all arms at once; then, several times over,
        delta_k = r_{k+1} + gamma V(s_{k+1}) - V(s_k)
        A_k     = delta_k + gamma lambda A_{k+1}                     advantage
        V       towards A_k + V(s_k)
        pi      along grad min(rho A, clip(rho, 1 - c, 1 + c) A) + h grad H(pi),   rho = pi / pi as it acted

A goal is terminal, its value is 0. A cut-off episode looks ahead to a state worth as much as its last one: it has
stood still for long.

Sources: J. Schulman et al., "Proximal policy optimization algorithms", arXiv:1707.06347 (2017); "High-dimensional
continuous control using generalized advantage estimation", ICLR 2016.

Differences from them:

1. Logits carry a fixed bonus for the action that is being held, so that the first policy already holds its actions
   and pays for few switches.
2. A minibatch is the same step of all arms: independent samples that lie side by side.
3. Joints choose independently given the state; rho is the product of theirs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.kernels import inner, kernel, part
from pneumarm.learning.policy.inputs import write_policy_inputs
from pneumarm.networks.layers import adam, backward, forward
from pneumarm.networks.tansig import FASTMATH
from pneumarm.random import integer, uniform
from pneumarm.task.environment import CUT_OFF, GOES_ON, REACHED, ending
from pneumarm.task.fleet import begin_one, gained_by, is_useful, take_all

FORBIDDEN = np.float32(-1e9)
"""Added to the logit of an action that may not be taken."""
_SQUARINGS = 5
_SHORTEST = np.float32(-60.0)  # exp(-60) is as good as 0, and no squaring underflows
_NEVER = np.float32(1e-20)  # less probable is a forbidden action only


class Experience(NamedTuple):
    """What ``n`` arms did in ``steps`` steps. Made by :func:`batch`."""

    inputs: NDArray[np.float32]
    """Shape (steps + 1, inputs, n)."""
    bias: NDArray[np.float32]
    """What is added to the logits, shape (steps, 9 joints, n)."""
    actions: NDArray[np.int64]
    """Shape (steps, n, joints)."""
    log_probability: NDArray[np.float32]
    """Log probabilities of the actions as they were chosen, shape (steps, n)."""
    reward: NDArray[np.float32]
    """Shape (steps, n), in units of the scale of returns."""
    ended: NDArray[np.int64]
    """How episodes are after each step, see :func:`~pneumarm.task.environment.ending`, shape (steps, n)."""
    value: NDArray[np.float32]
    """Shape (steps + 1, n), in units of the scale of returns."""
    advantage: NDArray[np.float32]
    """Shape (steps, n)."""
    target: NDArray[np.float32]
    """Targets of the values, shape (steps, n)."""
    is_reached: NDArray[np.bool_]
    """Workspace, shape (n,)."""
    order: NDArray[np.int64]
    """Workspace, shape (steps,)."""


def batch(steps: int, inputs: int, joints: int, n: int) -> Experience:
    """Return workspace for ``steps`` of ``n`` arms."""
    each, float_ = (steps, n), np.float32
    return Experience(
        inputs=np.zeros((steps + 1, inputs, n), float_),
        bias=np.zeros((steps, ACTIONS * joints, n), float_),
        actions=np.zeros((steps, n, joints), np.int64),
        log_probability=np.zeros(each, float_),
        reward=np.zeros(each, float_),
        ended=np.zeros(each, np.int64),
        value=np.zeros((steps + 1, n), float_),
        advantage=np.zeros(each, float_),
        target=np.zeros(each, float_),
        is_reached=np.zeros(n, np.bool_),
        order=np.arange(steps),
    )


class Rule(NamedTuple):
    """How the policy is improved."""

    hold: float
    """Bonus of the action that is held, on its logit."""
    discount: float
    """gamma."""
    decay: float
    """lambda."""
    clip: float
    """c."""
    entropy: float
    """h."""
    epochs: int
    """How often each step of a batch is learned from."""
    largest: float
    """Longest gradient."""
    scale: float
    """Return that a value of 1 stands for."""


@part(fastmath=FASTMATH)
def exponential(values):  # type: ignore[no-untyped-def]
    """Replace ``values`` (n,), none of them positive, by their exponentials within 2e-6, eight or sixteen at once.

    A Taylor polynomial of exp(v / 32) and five squarings.
    """
    for e in range(values.shape[0]):
        v = values[e] if values[e] > _SHORTEST else _SHORTEST
        t = v * np.float32(1 / 32)
        p = np.float32(1 / 720) + t * np.float32(1 / 5040)
        p = np.float32(1 / 120) + t * p
        p = np.float32(1 / 24) + t * p
        p = np.float32(1 / 6) + t * p
        p = np.float32(1 / 2) + t * p
        p = np.float32(1.0) + t * (np.float32(1.0) + t * p)
        for _ in range(_SQUARINGS):
            p *= p
        values[e] = p


@inner(fastmath=FASTMATH)
def log_softmax(logits, bias, probability):  # type: ignore[no-untyped-def]
    """Replace ``logits`` (9 joints, n) plus ``bias`` by log probabilities; set ``probability`` to these."""
    n = logits.shape[1]
    for first in range(0, logits.shape[0], ACTIONS):
        for e in range(n):
            best = np.float32(-np.inf)
            for row in range(first, first + ACTIONS):
                logits[row, e] += bias[row, e]
                best = max(best, logits[row, e])
            for row in range(first, first + ACTIONS):
                logits[row, e] -= best
                probability[row, e] = logits[row, e]
        for row in range(first, first + ACTIONS):
            exponential(probability[row])
        for e in range(n):
            total = np.float32(0.0)
            for row in range(first, first + ACTIONS):
                total += probability[row, e]
            log_total, part = np.log(total), np.float32(1.0) / total
            for row in range(first, first + ACTIONS):
                logits[row, e] -= log_total
                probability[row, e] *= part


@part
def write_bias(limits, hold, x, actions, still, bias, e):  # type: ignore[no-untyped-def]
    """Set column ``e`` of ``bias`` (9 joints, n) for an arm in ``x`` (inputs,) after its ``actions`` (joints,)."""
    for joint in range(actions.shape[0]):
        for action in range(ACTIONS):
            added = np.float32(hold) if actions[joint] == action else np.float32(0.0)
            if not is_useful(limits, x, actions, still, joint, action):
                added = FORBIDDEN
            bias[ACTIONS * joint + action, e] = added


@inner
def act_all(limits, inputs, rule, policy, fleet, batch, k):  # type: ignore[no-untyped-def]
    """Choose the actions of step ``k`` in all arms."""
    x = batch.inputs[k]
    write_policy_inputs(inputs, fleet.x, fleet.actions, x)
    forward(policy.layers, x, policy.units)
    logits, probability, bias = policy.units[-1], policy.errors[-1], batch.bias[k]
    for e in range(fleet.goal.shape[0]):
        write_bias(limits, rule.hold, fleet.x[:, e], fleet.actions[e], fleet.still[e], bias, e)
    log_softmax(logits, bias, probability)
    for e in range(fleet.goal.shape[0]):
        log_probability = np.float32(0.0)
        for joint in range(fleet.goal.shape[1]):
            row = ACTIONS * joint
            left, action = np.float32(uniform(fleet.random[e])), 0
            left -= probability[row, e]
            while action < ACTIONS - 1 and left >= 0.0:
                action += 1
                left -= probability[row + action, e]
            while probability[row + action, e] < _NEVER:  # rounding has left more than nothing of the draw
                action -= 1
            batch.actions[k, e, joint] = action
            log_probability += logits[row + action, e]
        batch.log_probability[k, e] = log_probability


@kernel
def collect_batch(environment, limits, inputs, rule, policy, fleet, batch):  # type: ignore[no-untyped-def]
    """Fill ``batch``, going on with the episodes of ``fleet``; return episodes, successes and sum of rewards."""
    task, part = environment.task, 1.0 / rule.scale
    episodes, successes, total = 0, 0, 0.0
    for k in range(batch.reward.shape[0]):
        act_all(limits, inputs, rule, policy, fleet, batch, k)
        take_all(environment, limits, fleet, batch.actions[k], batch.is_reached)
        for e in range(batch.reward.shape[1]):
            is_reached = batch.is_reached[e]
            reward = gained_by(task, fleet, e, is_reached)
            total += reward
            batch.reward[k, e] = reward * part
            batch.ended[k, e] = ending(task, is_reached, fleet.taken[e])
            if batch.ended[k, e] != GOES_ON:
                episodes += 1
                successes += 1 if is_reached else 0
                begin_one(environment, fleet, e)
    write_policy_inputs(inputs, fleet.x, fleet.actions, batch.inputs[batch.reward.shape[0]])
    return episodes, successes, total


@inner
def estimate_advantages(rule, value, batch):  # type: ignore[no-untyped-def]
    """Set the advantages, normalised, and the targets of the values, by the network ``value``."""
    steps, n = batch.reward.shape
    for k in range(steps + 1):
        forward(value.layers, batch.inputs[k], value.units)
        for e in range(n):
            batch.value[k, e] = value.units[-1][0, e]
    advantages(batch.reward, batch.ended, batch.value, rule.discount, rule.decay, batch.advantage)
    mean, square = 0.0, 0.0
    for k in range(steps):
        for e in range(n):
            a = batch.advantage[k, e]
            batch.target[k, e] = a + batch.value[k, e]
            mean += a
            square += a * a
    mean /= steps * n
    part = 1.0 / np.sqrt(max(square / (steps * n) - mean * mean, 1e-12))
    for k in range(steps):
        for e in range(n):
            batch.advantage[k, e] = (batch.advantage[k, e] - mean) * part


@inner
def advantages(reward, ended, value, discount, decay, advantage):  # type: ignore[no-untyped-def]
    """Set ``advantage`` (steps, n), see the top of this module; ``value`` is (steps + 1, n)."""
    steps, n = reward.shape
    for e in range(n):
        later = 0.0
        for back in range(steps):
            k = steps - 1 - back
            ahead = 0.0 if ended[k, e] == REACHED else (value[k, e] if ended[k, e] == CUT_OFF else value[k + 1, e])
            delta = reward[k, e] + discount * ahead - value[k, e]
            later = delta if ended[k, e] != GOES_ON else delta + discount * decay * later
            advantage[k, e] = later


@inner(fastmath=FASTMATH)
def policy_errors(rule, policy, batch, k, part):  # type: ignore[no-untyped-def]
    """Set the derivatives of step ``k``'s loss, times ``part``, by the logits; ``policy.units[-1]`` holds these."""
    logits, probability = policy.units[-1], policy.errors[-1]
    log_softmax(logits, batch.bias[k], probability)
    low, high = np.float32(1.0 - rule.clip), np.float32(1.0 + rule.clip)
    for e in range(logits.shape[1]):
        log_probability = np.float32(0.0)
        for joint in range(batch.actions.shape[2]):
            log_probability += logits[ACTIONS * joint + batch.actions[k, e, joint], e]
        ratio = np.exp(log_probability - batch.log_probability[k, e])
        advantage = batch.advantage[k, e]
        is_clipped = (advantage > 0.0 and ratio > high) or (advantage < 0.0 and ratio < low)
        push = np.float32(0.0) if is_clipped else np.float32(part) * advantage * ratio
        for joint in range(batch.actions.shape[2]):
            first = ACTIONS * joint
            entropy = np.float32(0.0)
            for row in range(first, first + ACTIONS):
                entropy -= probability[row, e] * max(logits[row, e], _SHORTEST)
            for row in range(first, first + ACTIONS):
                p = probability[row, e]
                flatter = np.float32(part * rule.entropy) * p * (max(logits[row, e], _SHORTEST) + entropy)
                probability[row, e] = push * p + flatter
            probability[first + batch.actions[k, e, joint], e] -= push


@kernel
def improve_policy(rule, policy, value, batch, rates, count, random):  # type: ignore[no-untyped-def]
    """Learn from ``batch`` with the learning ``rates`` of policy and values; return the number of updates so far."""
    estimate_advantages(rule, value, batch)
    steps, n = batch.reward.shape
    part = 1.0 / n
    for k in range(steps):
        batch.order[k] = k
    for _ in range(rule.epochs):
        for k in range(steps - 1, 0, -1):
            other = integer(random, k + 1)
            batch.order[k], batch.order[other] = batch.order[other], batch.order[k]
        for place in range(steps):
            k = batch.order[place]
            x = batch.inputs[k]
            forward(policy.layers, x, policy.units)
            policy_errors(rule, policy, batch, k, part)
            backward(policy, x)
            forward(value.layers, x, value.units)
            for e in range(n):
                value.errors[-1][0, e] = np.float32(part) * (value.units[-1][0, e] - batch.target[k, e])
            backward(value, x)
            count += 1
            adam(policy, rates[0], rule.largest, count)
            adam(value, rates[1], rule.largest, count)
    return count
