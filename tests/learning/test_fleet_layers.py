"""Networks over many samples: against NumPy in double precision, and gradients against finite differences."""

import numpy as np
import pytest

from pneumarm.kernels import kernel
from pneumarm.learning.policy.proximal import exponential, log_softmax
from pneumarm.networks.layers import adam, backward, forward, initial_weights, split, trainable, workspace

SIZES = (7, 6, 5, 9)
SAMPLES = 37  # no multiple of anything


def reference(flat: np.ndarray, x: np.ndarray) -> np.ndarray:
    layers = split(flat, SIZES)
    for layer in layers[:-1]:
        x = np.tanh(layer[:-1].T @ x + layer[-1][:, None])
    return layers[-1][:-1].T @ x + layers[-1][-1][:, None]


@pytest.fixture
def weights() -> np.ndarray:
    random = np.random.default_rng(0)
    return initial_weights(SIZES, 1.0, random) + random.normal(0, 0.3, 136 - 5).astype(np.float32)[0]


def inputs() -> np.ndarray:
    return np.random.default_rng(1).normal(0, 1, (SIZES[0], SAMPLES)).astype(np.float32)


def test_forward(weights: np.ndarray) -> None:
    units = workspace(SIZES, SAMPLES)
    net = trainable(weights, SIZES, SAMPLES)
    forward(net.layers, inputs(), units)
    np.testing.assert_allclose(units[-1], reference(weights.astype(float), inputs().astype(float)), atol=2e-5)


def test_gradient_is_that_of_finite_differences(weights: np.ndarray) -> None:
    net, x = trainable(weights, SIZES, SAMPLES), inputs()
    forward(net.layers, x, net.units)
    by_output = np.random.default_rng(2).normal(0, 1, net.units[-1].shape)
    net.errors[-1][...] = by_output
    backward(net, x)
    exact, h = weights.astype(float), 1e-6
    for place in range(len(exact)):
        up, down = exact.copy(), exact.copy()
        up[place] += h
        down[place] -= h
        slope = ((reference(up, x) - reference(down, x)) * by_output).sum() / (2 * h)
        assert net.gradient[place] == pytest.approx(slope, rel=2e-3, abs=2e-3)


def test_adam_by_hand() -> None:
    sizes, largest, rate = (1, 1), 2.0, 0.1
    mask = np.array([1, 0], np.float32)
    net = trainable(np.array([1.0, 5.0], np.float32), sizes, 1, mask)
    w, m, v = 1.0, 0.0, 0.0
    for count, gradient in enumerate([4.0, -1.0, 0.5], 1):
        net.gradient[...] = [gradient, 100.0]  # of the masked weight, which must not count
        adam(net, rate, largest, count)
        g = gradient * min(1.0, largest / abs(gradient))
        m, v = 0.9 * m + 0.1 * g, 0.999 * v + 0.001 * g * g
        w -= rate * (m / (1 - 0.9**count)) / (np.sqrt(v / (1 - 0.999**count)) + 1e-7)
        assert net.flat[0] == pytest.approx(w, rel=1e-5)
    assert net.flat[1] == 5.0
    assert not net.gradient.any()


@kernel
def _exponential(values: np.ndarray) -> None:
    exponential(values)


def test_exponential() -> None:
    values = np.concatenate([np.linspace(-30, 0, 3001), [-1e9, -200.0]]).astype(np.float32)
    found = values.copy()
    _exponential(found)
    expected = np.exp(values.astype(float))
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-6)
    likely = expected > 1e-3
    np.testing.assert_allclose(found[likely], expected[likely], rtol=1e-5)
    assert found[3000] == 1


def test_log_softmax_of_two_joints_and_forbidden_actions() -> None:
    random = np.random.default_rng(3)
    logits, bias = random.normal(0, 3, (18, SAMPLES)), random.normal(0, 1, (18, SAMPLES))
    bias[4] = bias[12] = -1e9
    found, probability = logits.astype(np.float32), np.zeros((18, SAMPLES), np.float32)
    log_softmax(found, bias.astype(np.float32), probability)
    for first in (0, 9):
        z = (logits + bias)[first : first + 9]
        expected = np.exp(z - z.max(axis=0))
        expected /= expected.sum(axis=0)
        np.testing.assert_allclose(probability[first : first + 9], expected, atol=2e-6)
        np.testing.assert_allclose(probability[first : first + 9].sum(axis=0), 1, atol=1e-5)
    np.testing.assert_allclose(np.exp(found), probability, atol=2e-6)
    assert probability[4].max() < 1e-20
