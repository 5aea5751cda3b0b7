"""Targets worked by hand, and the gradient of the policy's loss against finite differences."""

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.learning import PolicySettings, TrainSettings
from pneumarm.learning.batched.values import connections, lambda_returns, network_sizes, to_networks
from pneumarm.learning.online.values import draw_networks
from pneumarm.learning.policy.agent import rule
from pneumarm.learning.policy.proximal import advantages, batch, policy_errors
from pneumarm.networks.layers import initial_weights, trainable, workspace


def test_advantages_by_hand() -> None:
    gamma, decay = 0.5, 0.5
    reward = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]], np.float32)
    value = np.array([[4.0, 4.0, 4.0], [8.0, 8.0, 8.0], [6.0, 6.0, 6.0]], np.float32)
    ended = np.array([[0, 1, 2], [0, 0, 0]])  # goes on, goal reached, cut off after the first step
    found = np.zeros((2, 3), np.float32)
    advantages(reward, ended, value, gamma, decay, found)
    last = 2 + 0.5 * 6 - 8  # r + gamma V(s') - V(s)
    np.testing.assert_allclose(found[1], last)
    assert found[0, 0] == pytest.approx(1 + 0.5 * 8 - 4 + 0.25 * last)
    assert found[0, 1] == pytest.approx(1 - 4)  # a goal is worth nothing further
    assert found[0, 2] == pytest.approx(1 + 0.5 * 4 - 4)  # a cut-off goes on as it was


def test_lambda_returns_by_hand() -> None:
    gamma, decay = 0.5, 0.25
    reward = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])[..., None]
    best = np.array([[4.0, 4.0, 4.0], [8.0, 8.0, 8.0], [6.0, 6.0, 6.0]])[..., None]
    ended = np.array([[0, 1, 2], [0, 0, 0]])
    found = np.zeros((2, 3, 1))
    lambda_returns(reward, ended, best, gamma, decay, found)
    last = 2 + 0.5 * 6
    np.testing.assert_allclose(found[1], last)
    assert found[0, 0, 0] == pytest.approx(1 + 0.5 * (0.75 * 8 + 0.25 * last))
    assert found[0, 1, 0] == pytest.approx(1)
    assert found[0, 2, 0] == pytest.approx(1 + 0.5 * 4)


def loss(logits: np.ndarray, bias: np.ndarray, done: dict[str, np.ndarray], clip: float, entropy: float) -> float:
    """Return what is minimised over the samples of a step, in double precision."""
    total = 0.0
    for e in range(logits.shape[1]):
        log_probability = 0.0
        for joint in range(logits.shape[0] // 9):
            z = (logits + bias)[9 * joint : 9 * joint + 9, e]
            log_p = z - z.max() - np.log(np.exp(z - z.max()).sum())
            log_probability += log_p[done["actions"][e, joint]]
            total += entropy * (np.exp(log_p) * log_p).sum()
        ratio = np.exp(log_probability - done["before"][e])
        total -= min(ratio * done["advantage"][e], np.clip(ratio, 1 - clip, 1 + clip) * done["advantage"][e])
    return total


def test_gradient_of_the_policy_is_that_of_finite_differences() -> None:
    joints, n, settings = 2, 40, PolicySettings(entropy=0.1)
    random = np.random.default_rng(0)
    rows = batch(1, 3, joints, n)
    sizes = (3, 18)
    net = trainable(initial_weights(sizes, 1.0, random), sizes, n)
    logits, bias = random.normal(0, 1, (18, n)), random.normal(0, 1, (18, n))
    done = {
        "actions": random.integers(0, 9, (n, joints)),
        "before": random.normal(-4.5, 0.8, n),
        "advantage": random.normal(0, 1, n),
    }
    net.units[-1][...] = logits
    rows.bias[0], rows.actions[0] = bias, done["actions"]
    rows.log_probability[0], rows.advantage[0] = done["before"], done["advantage"]
    policy_errors(rule(settings), net, rows, 0, 1.0)
    h, clipped = 1e-5, 0
    for e in range(n):
        for row in range(18):
            up, down = logits.copy(), logits.copy()
            up[row, e] += h
            down[row, e] -= h
            slope = (loss(up, bias, done, 0.2, 0.1) - loss(down, bias, done, 0.2, 0.1)) / (2 * h)
            assert net.errors[-1][row, e] == pytest.approx(slope, rel=1e-3, abs=1e-4)
        clipped += np.abs(net.errors[-1][:, e]).max() < 0.3
    assert 0 < clipped < n  # both kinds of samples were among them


def test_nine_networks_as_one_are_the_networks_of_an_agent() -> None:
    hidden, joints = 4, 2
    window = synthetic_simulation(joints).window
    sizes, mask = network_sizes(window, hidden), connections(window, hidden)
    like = draw_networks(window, TrainSettings(hidden=hidden), np.random.default_rng(0))
    weights_of_agent = sum(part.size for part in like)
    assert mask.sum() == weights_of_agent
    flat = np.where(mask, np.random.default_rng(1).normal(0, 0.4, mask.shape), 0).astype(np.float32)
    networks = to_networks(flat, window, hidden)
    assert [part.shape for part in networks] == [part.shape for part in like]
    x = np.random.default_rng(2).normal(0, 1, (sizes[0], 1)).astype(np.float32)
    from pneumarm.networks.layers import forward, split

    units = workspace(sizes, 1)
    forward(split(flat, sizes), x, units)
    for joint in range(joints):
        for action in range(9):
            inner = x[:-1, 0] @ networks.hidden_weights[joint, action] + networks.hidden_bias[joint, action]
            value = np.tanh(inner) @ networks.output_weights[joint, action] + networks.output_bias[joint, action]
            assert units[-1][9 * joint + action, 0] == pytest.approx(value, abs=1e-5)
