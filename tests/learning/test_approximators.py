"""Function approximators: their features, their gradients, and what they make of a known function (4.2.6)."""

from collections.abc import Callable

import numpy as np
import pytest
from textbook import Student, function, mountain_car, random_walk

from pneumarm.learning.values.approximators.coding import Coding, spread_evenly
from pneumarm.learning.values.approximators.function import (
    ValueFunction,
    add_trace,
    follow,
    forget_traces,
    look,
    update,
    value,
    value_function,
    write_features,
)
from pneumarm.learning.values.approximators.kanerva import kanerva
from pneumarm.learning.values.approximators.network import draw_weights, network, network_shape
from pneumarm.learning.values.approximators.radial import radial
from pneumarm.learning.values.approximators.table import table
from pneumarm.learning.values.approximators.tiles import tiles
from pneumarm.learning.values.learner import SARSA

LINEAR: dict[str, Callable[[], Coding]] = {
    "table": lambda: table((20, 20)),
    "tiles": lambda: tiles((6, 6), 8, 4096),
    "hashed tiles": lambda: tiles((6, 6), 8, 256),
    "radial": lambda: radial(2, 150, 0.08),
    "kanerva": lambda: kanerva((20, 20), 200, 3.0),
}


def features(coding: Coding, z: list[float]) -> dict[int, float]:
    places, amounts = np.zeros(coding.most, np.int64), np.zeros(coding.most, np.float32)
    count = write_features(coding, np.array(z, np.float32), places, amounts)
    return dict(zip(places[:count].tolist(), amounts[:count].tolist(), strict=True))


@pytest.mark.parametrize("name", LINEAR)
def test_features_are_of_unit_length_and_near(name: str) -> None:
    coding, random = LINEAR[name](), np.random.default_rng(0)
    for z in [[0.0, 0.0], [1.0, 1.0], [1.7, -0.3], *random.random((200, 2)).tolist()]:
        active = features(coding, z)
        assert all(0 <= place < coding.size for place in active)
        if name != "hashed tiles":
            assert sum(amount**2 for amount in active.values()) == pytest.approx(1, abs=1e-5)
    here, there = features(coding, [0.1, 0.1]), features(coding, [0.9, 0.85])
    assert name == "hashed tiles" or not here.keys() & there.keys()
    if name != "table":
        near = features(coding, [0.115, 0.1])
        assert sum(here[place] * near.get(place, 0) for place in here) > 0.6


@pytest.mark.parametrize("name", sorted(LINEAR.keys() - {"hashed tiles"}))
def test_a_step_size_is_a_share_of_the_error(name: str) -> None:
    values, z = function(LINEAR[name](), 2), np.array([0.3, 0.8], np.float32)
    assert update(values, 0, z, 1, 10.0, 0.25, 0.0) == 10.0
    look(values, 0, z)
    assert value(values, 0, 1) == pytest.approx(2.5, rel=1e-5)
    assert value(values, 0, 0) == 0


def test_tiles_lie_where_the_book_says() -> None:
    """Two tilings of 2 x 2 cells, shifted by half a cell and by three halves, which is as much."""
    active = features(tiles((2, 2), 2, 1000), [0.3, 0.3])
    assert sorted(active) == [0, 9 + 4]  # cells (0, 0) of the first and (1, 1) of the second, of 3 x 3 each


def test_prototypes_are_active_within_their_reach() -> None:
    coding = kanerva((10, 10), 400, 4.0)
    code = np.round(np.array([0.42, 0.77]) * 10)
    distance = np.abs(coding.centres - code).sum(axis=1)
    assert set(features(coding, [0.42, 0.77])) == set(np.flatnonzero(distance <= 4).tolist())
    alone = kanerva((10, 10), 400, 0.0)
    assert features(alone, [0.42, 0.77])  # the nearest, however far


def test_points_fill_the_space_evenly() -> None:
    points = spread_evenly(1000, 5)
    assert ((points >= 0) & (points < 1)).all()
    counts = np.histogramdd(points, bins=[3, 3, 1, 1, 3], range=[(0, 1)] * 5)[0]
    assert 25 <= counts.min() <= counts.max() <= 50  # 37 each


def test_a_sample_average_needs_no_learning_rate() -> None:
    values = function(table((4,)))
    values = values._replace(visits=np.zeros_like(values.weights))
    targets = np.random.default_rng(1).normal(size=50)
    for target in targets:
        update(values, 0, np.array([0.6], np.float32), 0, float(target), 99.0, 0.0)
    assert values.weights[0, 0].tolist() == pytest.approx([0, 0, targets.mean(), 0], abs=1e-5)


def a_network(groups: int, outputs: int = 3, inputs: int = 4, hidden: int = 6, scale: float = 5.0) -> ValueFunction:
    shape = 1, *network_shape(inputs, hidden, outputs, groups)
    weights = draw_weights(shape, 0.8, np.random.default_rng(3))
    return value_function(network(), weights, inputs=inputs, groups=groups, scale=scale)


@pytest.mark.parametrize("groups", [1, 3])
def test_gradients_of_networks(groups: int) -> None:
    """The trace of a step is the gradient, against finite differences."""
    net, z = a_network(groups), np.array([0.3, -0.8, 0.5, 1.0], np.float32)
    look(net, 0, z)
    add_trace(net, 0, z, 1, 1.0)
    trace, small = net.traces[0].copy(), 0.01
    for place in np.ndindex(*net.weights.shape[1:]):
        ends = []
        for step in (small, -small):
            net.weights[(0, *place)] += step
            look(net, 0, z)
            ends.append(value(net, 0, 1) / net.scale)
            net.weights[(0, *place)] -= step
        assert trace[place] == pytest.approx((ends[0] - ends[1]) / 2 / small, abs=2e-3)
    before = net.weights.copy()
    follow(net, 0, 2.0, 0.1, 0.5)
    np.testing.assert_allclose(net.weights[0], before[0] + 0.1 * 2.0 / 5.0 * trace, atol=1e-6)
    np.testing.assert_allclose(net.traces[0], 0.5 * trace, atol=1e-6)
    forget_traces(net, 0)
    assert not net.traces.any()


def test_one_network_for_all_actions_unlearns() -> None:
    """Section 4.2.6: what is learned of one action changes the others, unless each has a network of its own."""
    moved = {}
    for groups in (1, 3):
        net, z = a_network(groups), np.array([0.3, -0.8, 0.5, 1.0], np.float32)
        before = [_value(net, z, output) for output in range(3)]
        for _ in range(200):
            update(net, 0, z, 0, 4.0, 0.05, 0.0)
        after = [_value(net, z, output) for output in range(3)]
        assert after[0] == pytest.approx(4.0, abs=0.05)
        moved[groups] = np.abs(np.subtract(after, before)[1:]).max()
    assert moved[3] == 0
    assert moved[1] > 0.1


def _value(values: ValueFunction, z: np.ndarray, output: int = 0) -> float:
    look(values, 0, z)
    return float(value(values, 0, output))


@pytest.mark.parametrize("name", [*LINEAR, "network"])
def test_a_known_function_is_learned(name: str) -> None:
    """sin(2 pi u) v: all but a table of few cells come within 0.1 of it; hashing costs."""
    inputs = 4 if name == "network" else 2
    values = a_network(1, 1, inputs, 20, 1.0) if name == "network" else function(LINEAR[name]())
    random = np.random.default_rng(5)

    def seen(u: float, v: float) -> np.ndarray:
        z = [2 * u - 1, 2 * v - 1, 0, 1] if name == "network" else [u, v]
        return np.array(z, np.float32)

    for _ in range(25_000):
        u, v = random.random(2)
        update(values, 0, seen(u, v), 0, float(np.sin(2 * np.pi * u) * v), 0.1, 0.0)
    points = random.random((500, 2))
    errors = [_value(values, seen(u, v)) - np.sin(2 * np.pi * u) * v for u, v in points]
    limit = {"table": 0.1, "hashed tiles": 0.25, "network": 0.1}.get(name, 0.06)
    assert np.sqrt(np.mean(np.square(errors))) < limit


@pytest.mark.parametrize(
    "coding", [tiles((5,), 8, 1000), radial(1, 9, 0.1), kanerva((18,), 18, 2.0)], ids=["tiles", "radial", "kanerva"]
)
def test_approximators_know_the_random_walk(coding: Coding) -> None:
    """The values 1/6 to 5/6 lie on a line, which all of them can draw."""
    found = []
    for seed in range(3):
        problem = random_walk(5, seed)
        problem.coding = coding
        student = Student(problem, SARSA, 0.03, first=0.0)
        for _ in range(400):
            student.episode()
        found.append([_value(student.values, np.array(problem.seen(state), np.float32)) for state in range(5)])
    np.testing.assert_allclose(np.mean(found, axis=0), np.arange(1, 6) / 6, atol=0.07)


@pytest.mark.parametrize(
    "coding",
    [table((30, 30)), radial(2, 120, 0.06), kanerva((20, 20), 300, 3.0)],
    ids=["table", "radial", "kanerva"],
)
def test_approximators_drive_the_mountain_car(coding: Coding) -> None:
    student = Student(
        mountain_car(coding), SARSA, 0.3, decay=0.9, epsilon=0.0, is_replacing=True, longest=5000, seed=1
    )
    steps = [student.episode()[0] for _ in range(150)]
    assert 100 <= np.mean(steps[-30:]) < 200
