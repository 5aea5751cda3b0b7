"""Action values and their update: by finite differences, and by two steps worked by hand."""

import numpy as np
import pytest

from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.online.values import (
    Networks,
    action_values,
    backpropagate,
    draw_networks,
    forget_traces,
    learner,
    network_shapes,
    pack,
    td_target,
    unpack,
    update,
)
from pneumarm.simulation.layout import layout_of
from pneumarm.transitions.window import Window


def state(window: Window, seed: int = 0) -> np.ndarray:
    """Return a vector (sigma, 0, goal, 1, 0...) as the loop makes it."""
    place = layout_of(window)
    x = np.zeros(place.size, np.float32)
    random = np.random.default_rng(seed)
    x[: place.command] = random.uniform(-1, 1, place.command)
    x[place.goal : place.one] = random.uniform(-1, 1, window.joints)
    x[place.one] = 1
    return x


def values(networks: Networks, window: Window, settings: TrainSettings, joint: int, x: np.ndarray) -> np.ndarray:
    """Return the action values in float64 from the definition of the networks."""
    place = layout_of(window)
    inputs = np.concatenate([x[: place.command], x[place.goal : place.one]]).astype(np.float64)
    w1, b1, w2, b2 = (array[joint].astype(np.float64) for array in networks)
    hidden = np.tanh(np.einsum("i,aih->ah", inputs, w1) + b1)
    return settings.return_scale * ((hidden * w2).sum(axis=1) + b2)


SIZES = [(Window(), 5), (Window(), 10), (Window(1, 1), 1), (Window(1, 4), 7), (Window(2), 5), (Window(3, 2), 16)]


@pytest.mark.parametrize(("window", "hidden"), SIZES)
def test_values_are_those_of_nine_networks_a_joint(window: Window, hidden: int) -> None:
    settings = TrainSettings(hidden=hidden)
    networks = draw_networks(window, settings, np.random.default_rng(3))
    one = learner(pack(networks, window), settings)
    for joint in range(window.joints):
        got, x = np.zeros(9, np.float32), state(window)
        action_values(one, joint, x, got)
        np.testing.assert_allclose(got, values(networks, window, settings, joint, x), atol=2e-3)


@pytest.mark.parametrize(("window", "hidden"), SIZES)
def test_packing_loses_nothing(window: Window, hidden: int) -> None:
    networks = draw_networks(window, TrainSettings(hidden=hidden), np.random.default_rng(0))
    for before, after in zip(networks, unpack(pack(networks, window), window, hidden), strict=True):
        np.testing.assert_array_equal(before, after)


def test_initial_weights_fill_their_range() -> None:
    networks = draw_networks(Window(), TrainSettings(initial_weight=0.3), np.random.default_rng(0))
    everything = np.concatenate([array.ravel() for array in networks])
    assert np.abs(everything).max() <= 0.3
    assert everything.std() == pytest.approx(0.3 / np.sqrt(3), rel=0.05)
    assert (networks.output_bias != 0).all()


@pytest.mark.parametrize(("window", "hidden"), SIZES)
@pytest.mark.parametrize("decay", [0.0, 0.4])
def test_update_follows_the_gradient(window: Window, hidden: int, decay: float) -> None:
    """One update moves every weight by beta delta times the derivative of Q, by central differences."""
    settings = TrainSettings(hidden=hidden, learning_rate=0.01, trace_decay=decay)
    networks = draw_networks(window, settings, np.random.default_rng(1))
    weights = pack(networks, window)
    joint, action, x, target = window.joints - 1, 4, state(window), 17.0
    one = learner(weights, settings)
    delta = update(one, joint, x, action, target)
    assert delta == pytest.approx(target - values(networks, window, settings, joint, x)[action], abs=2e-3)

    moved = unpack(weights, window, hidden)
    for name, before, after in zip(Networks._fields, networks, moved, strict=True):
        expected = np.zeros(before.shape)
        for index in np.ndindex(before.shape):
            if index[:2] != (joint, action):
                continue
            h = 1e-2
            ends = []
            for sign in (1, -1):
                shifted = before.astype(np.float64)
                shifted[index] += sign * h
                ends.append(values(networks._replace(**{name: shifted}), window, settings, joint, x)[action])
            slope = (ends[0] - ends[1]) / (2 * h) / settings.return_scale
            expected[index] = settings.learning_rate * delta / settings.return_scale * slope
        np.testing.assert_allclose(after - before, expected, atol=2e-6)
    assert np.count_nonzero(weights) == np.count_nonzero(pack(moved, window))  # nothing grew in the padding


def bias_only(biases: list[float], **settings: float | str) -> tuple[np.ndarray, TrainSettings]:
    """Return weights of which all are 0 except the output biases: a table of nine values, 50 b each."""
    window = Window()
    networks = network_shapes(window, 5)
    networks.output_bias[0, : len(biases)] = biases
    return pack(networks, window), TrainSettings(**settings)  # type: ignore[arg-type]


def table(weights: np.ndarray) -> np.ndarray:
    return 50 * unpack(weights, Window(), 5).output_bias[0]


def test_two_steps_of_sarsa_by_hand() -> None:
    """Q(0) = 5, Q(1) = 10; r = -1 leads to action 1, then a switch of action reaches the goal: r = 50 - 8."""
    weights, settings = bias_only([0.1, 0.2])
    one, x = learner(weights, settings), state(Window())
    delta = update(one, 0, x, 0, td_target(-1.0, 0.98, 10.0, False))
    assert delta == pytest.approx(-1 + 0.98 * 10 - 5, abs=1e-4)  # 3.8
    assert table(weights)[0] == pytest.approx(5 + 0.05 * 3.8, abs=1e-4)
    delta = update(one, 0, x, 1, td_target(42.0, 0.98, 123.0, True))  # a goal is worth 0, whatever the networks say
    assert delta == pytest.approx(32, abs=1e-4)
    np.testing.assert_allclose(table(weights)[:3], [5.19, 11.6, 0], atol=1e-4)


def test_two_steps_with_traces_by_hand() -> None:
    """With lambda = 0.3 the second error also moves the first action, by gamma lambda = 0.294 of it."""
    weights, settings = bias_only([0.1, 0.2], trace_decay=0.3)
    one, x = learner(weights, settings), state(Window())
    update(one, 0, x, 0, td_target(-1.0, 0.98, 10.0, False))
    update(one, 0, x, 1, td_target(42.0, 0.98, 0.0, True))
    np.testing.assert_allclose(table(weights)[:2], [5.19 + 0.05 * 32 * 0.294, 11.6], atol=1e-4)
    forget_traces(one, 0)
    before = table(weights).copy()
    update(one, 0, x, 2, 10.0)
    np.testing.assert_allclose((table(weights) - before)[:3], [0, 0, 0.5], atol=1e-4)


def test_same_action_twice_accumulates_its_trace() -> None:
    weights, settings = bias_only([0.0], trace_decay=0.5, discount=1.0)
    one, x = learner(weights, settings), state(Window())
    update(one, 0, x, 0, 0.0)  # no error, but a trace of 1
    update(one, 0, x, 0, 10.0)  # trace 0.5 + 1
    assert table(weights)[0] == pytest.approx(0.05 * 10 * 1.5, abs=1e-5)


def test_networks_of_other_joints_stay() -> None:
    window, settings = Window(2), TrainSettings(trace_decay=0.3)
    weights = pack(draw_networks(window, settings, np.random.default_rng(0)), window)
    before = weights.copy()
    update(learner(weights, settings), 1, state(window), 3, 30.0)
    np.testing.assert_array_equal(weights[0], before[0])
    assert (weights[1] != before[1]).any()


def test_repeated_updates_reach_the_target() -> None:
    window, settings = Window(), TrainSettings()
    weights = pack(draw_networks(window, settings, np.random.default_rng(0)), window)
    one, x = learner(weights, settings), state(window)
    for _ in range(500):
        update(one, 0, x, 7, -30.0)
    assert backpropagate(one, 0, x, 7) == pytest.approx(-30, abs=0.05)
