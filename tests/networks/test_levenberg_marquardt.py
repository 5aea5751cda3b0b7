"""Levenberg-Marquardt: its Jacobian, its step, its damping, and what it finds."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pneumarm.networks import LevenbergMarquardt, Network, levenberg_marquardt, nguyen_widrow
from pneumarm.networks.levenberg_marquardt import NormalEquations, Problem, damped_step, next_damping
from pneumarm.networks.products import solve_positive

Floats = NDArray[np.float64]


def random_network(inputs: int, hidden: int, outputs: int, seed: int) -> Network:
    g = np.random.default_rng(seed)
    return Network(
        g.normal(size=(inputs, hidden)),
        g.normal(size=hidden),
        g.normal(size=(hidden, outputs)),
        g.normal(size=outputs),
    )


def data(rows: int, inputs: int, outputs: int, seed: int = 0) -> tuple[NDArray[np.float32], Floats]:
    g = np.random.default_rng(seed)
    return g.uniform(-1, 1, (rows, inputs)).astype(np.float32), g.normal(size=(rows, outputs))


def dense_jacobian(problem: Problem, weights: Floats, x: NDArray[Any]) -> Floats:
    """Central differences of all outputs of all rows, (rows * outputs, weights)."""
    step = 1e-5
    columns = []
    for place in range(len(weights)):
        shift = np.zeros_like(weights)
        shift[place] = step
        ahead, behind = problem.unpack(weights + shift)(x), problem.unpack(weights - shift)(x)
        columns.append(((ahead - behind) / (2 * step)).ravel())
    return np.array(columns).T


@given(st.integers(1, 4), st.integers(1, 5), st.integers(1, 3), st.integers(1, 40), st.sampled_from([0.0, 0.3]))
@settings(max_examples=25, deadline=None)
def test_normal_equations_are_those_of_finite_differences(
    inputs: int, hidden: int, outputs: int, rows: int, decay: float
) -> None:
    network = random_network(inputs, hidden, outputs, seed=rows)
    x, y = data(rows, inputs, outputs)
    problem = Problem(x, y, network, decay, block=16)
    weights = problem.pack(network)
    found = problem.normal_equations(weights)
    jacobian = dense_jacobian(problem, weights, x)
    residue = (network(x) - y).ravel()
    curvature = jacobian.T @ jacobian / rows + decay * np.eye(len(weights))
    np.testing.assert_allclose(found.curvature, curvature, atol=1e-5 * np.abs(curvature).max())
    gradient = jacobian.T @ residue / rows + decay * weights
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-7 * (1 + np.abs(gradient).max()))
    error = residue @ residue / rows + decay * weights @ weights
    assert found.error == pytest.approx(error, rel=1e-12)
    assert problem.error(weights) == pytest.approx(error, rel=1e-12)


def test_weights_survive_packing() -> None:
    network = random_network(3, 4, 2, seed=1)
    x, y = data(5, 3, 2)
    problem = Problem(x, y, network)
    np.testing.assert_array_equal(problem.unpack(problem.pack(network))(x), network(x))


@pytest.mark.parametrize("rows", [1, 511, 512, 513, 1500])
def test_the_block_size_changes_only_the_rounding(rows: int) -> None:
    network = random_network(5, 4, 2, seed=3)
    x, y = data(rows, 5, 2)
    reference = Problem(x, y, network, block=rows).normal_equations(Problem(x, y, network).pack(network))
    for block in (1, 100, 512, 4096):
        problem = Problem(x, y, network, block=block)
        found = problem.normal_equations(problem.pack(network))
        largest = np.abs(reference.curvature).max()
        np.testing.assert_allclose(found.curvature, reference.curvature, atol=2e-6 * largest)
        np.testing.assert_allclose(found.gradient, reference.gradient, atol=1e-12)


def test_a_step_is_the_least_squares_solution_of_the_extended_system() -> None:
    g = np.random.default_rng(4)
    jacobian, residue, damping = g.normal(size=(30, 6)), g.normal(size=30), 0.7
    equations = NormalEquations(jacobian.T @ jacobian / 30, jacobian.T @ residue / 30, 0.0)
    extended = np.vstack([jacobian, np.sqrt(30 * damping) * np.eye(6)])
    expected = np.linalg.lstsq(extended, -np.append(residue, np.zeros(6)), rcond=None)[0]
    step = damped_step(equations, damping)
    assert step is not None
    np.testing.assert_allclose(step, expected, rtol=1e-10)


def test_a_step_by_hand() -> None:
    """(4 + 1) d = -10 along one weight, (1 + 1) d = 3 along the other."""
    step = damped_step(NormalEquations(np.diag([4.0, 1.0]), np.array([10.0, -3.0]), 0.0), damping=1.0)
    np.testing.assert_allclose(step, [-2.0, 1.5])


def test_an_indefinite_matrix_gives_no_step() -> None:
    equations = NormalEquations(np.diag([1.0, -2.0]), np.ones(2), 0.0)
    assert damped_step(equations, damping=0.5) is None
    assert damped_step(equations, damping=3.0) is not None


def test_damping_falls_after_good_steps_and_grows_ever_faster_after_failures() -> None:
    assert next_damping(1.0, 8.0, gain=1.0) == (0.1, 2.0)
    assert next_damping(1.0, 2.0, gain=0.5) == (1.0, 2.0)
    damping, growth = 1.0, 2.0
    history = []
    for _ in range(3):
        damping, growth = next_damping(damping, growth, gain=-1.0)
        history.append(damping)
    assert history == [2.0, 8.0, 64.0]


@given(st.integers(1, 110))
@settings(max_examples=20, deadline=None)
def test_cholesky_solves(size: int) -> None:
    g = np.random.default_rng(size)
    root = g.normal(size=(size, size))
    matrix, right = root @ root.T + np.eye(size), g.normal(size=size)
    solution = right.copy()
    assert solve_positive(matrix.copy(), solution)
    np.testing.assert_allclose(matrix @ solution, right, atol=1e-8)


def test_a_known_network_is_found_again() -> None:
    x = np.random.default_rng(5).uniform(-1, 1, (3000, 3)).astype(np.float32)
    truth = random_network(3, 4, 2, seed=6)
    fits = [levenberg_marquardt(x, truth(x), nguyen_widrow(3, 4, 2, seed)) for seed in range(4)]
    best = min(fits, key=lambda fit: fit.mse[-1])
    assert best.mse[-1] < 1e-8 * truth(x).var()
    fresh = np.random.default_rng(7).uniform(-1, 1, (100, 3))
    np.testing.assert_allclose(best.network(fresh), truth(fresh), atol=1e-3)


def test_the_error_falls_at_every_epoch_and_is_that_of_the_network() -> None:
    x, y = data(800, 4, 2, seed=8)
    fit = levenberg_marquardt(x, y, nguyen_widrow(4, 5, 2, 0), LevenbergMarquardt(epochs=12, tolerance=0))
    assert (np.diff(fit.mse) < 0).all()
    assert fit.epochs == 12
    assert not fit.converged
    assert fit.mse[-1] == pytest.approx(((fit.network(x) - y) ** 2).sum(axis=1).mean(), rel=1e-9)


def test_it_stops_when_the_error_no_longer_falls() -> None:
    x, y = data(300, 2, 1, seed=9)
    fit = levenberg_marquardt(x, y, nguyen_widrow(2, 2, 1, 0), LevenbergMarquardt(epochs=2000, tolerance=1e-4))
    assert fit.converged
    assert fit.epochs < 2000
    falls = -np.diff(fit.mse) / fit.mse[:-1]
    assert (falls[-3:] < 1e-4).all()


def test_it_stops_at_a_perfect_fit() -> None:
    x, _ = data(50, 2, 1)
    fit = levenberg_marquardt(x, np.zeros((50, 1)), nguyen_widrow(2, 3, 1, 0), LevenbergMarquardt(epochs=500))
    assert fit.converged
    assert fit.mse[-1] < 1e-20


def test_anchored_weights_decay_towards_the_start() -> None:
    x, y = data(80, 3, 2)
    start = random_network(3, 4, 2, seed=2)
    free, held, fixed = (
        levenberg_marquardt(x, y, start, LevenbergMarquardt(epochs=20, decay=decay, anchored=True)).network
        for decay in (0.0, 1.0, 1e9)
    )

    def away(network: Network) -> float:
        return sum(
            float(np.square(getattr(network, name) - getattr(start, name)).sum())
            for name in ("hidden_weights", "hidden_bias", "output_weights", "output_bias")
        )

    assert away(fixed) < 1e-12
    assert 0 < away(held) < away(free)
    problem = Problem(x, y, start, 0.5, anchored=True)
    weights = problem.pack(start) + 0.1
    shifts = 1e-5 * np.eye(len(weights))
    slope = [(problem.error(weights + s) - problem.error(weights - s)) / 2e-5 for s in shifts]
    np.testing.assert_allclose(2 * problem.normal_equations(weights).gradient, slope, rtol=1e-4, atol=1e-5)


def test_decay_keeps_weights_small() -> None:
    x, y = data(200, 3, 1, seed=10)
    start = nguyen_widrow(3, 8, 1, 0)
    norms = []
    for decay in (0.0, 1e-3, 1e-1):
        fit = levenberg_marquardt(x, y, start, LevenbergMarquardt(epochs=40, decay=decay))
        norms.append(float(np.sum(fit.network.hidden_weights**2) + np.sum(fit.network.output_weights**2)))
    assert norms[0] > norms[1] > norms[2]


def test_the_same_on_any_thread() -> None:
    x, y = data(5000, 6, 3, seed=11)

    def one(output: int) -> Floats:
        return levenberg_marquardt(x, y[:, [output]], nguyen_widrow(6, 5, 1, 0), LevenbergMarquardt(epochs=5)).mse

    alone = [one(output) for output in range(3)]
    with ThreadPoolExecutor(3) as threads:
        together = list(threads.map(one, range(3)))
    np.testing.assert_array_equal(alone, together)


def test_it_does_as_well_as_scipy_from_the_same_start() -> None:
    optimize = pytest.importorskip("scipy.optimize")
    x, y = data(400, 3, 1, seed=12)
    start = nguyen_widrow(3, 4, 1, 0)
    problem = Problem(x, y, start)
    oracle = optimize.least_squares(lambda w: (problem.unpack(w)(x) - y).ravel(), problem.pack(start), method="lm")
    fit = levenberg_marquardt(x, y, start, LevenbergMarquardt(epochs=500, tolerance=1e-8))
    assert fit.mse[-1] <= 2 * oracle.cost / 400 * 1.02


def test_progress_is_told() -> None:
    x, y = data(100, 2, 1)
    told: list[tuple[int, float]] = []
    fit = levenberg_marquardt(
        x, y, nguyen_widrow(2, 3, 1, 0), LevenbergMarquardt(epochs=4, tolerance=0), lambda *a: told.append(a)
    )
    assert told == list(enumerate(fit.mse.tolist()))[1:]


def test_wrong_shapes_are_refused() -> None:
    x, y = data(10, 2, 1)
    with pytest.raises(ValueError, match=r"expected x \(n, 3\) and y \(n, 1\), got \(10, 2\)"):
        levenberg_marquardt(x, y, nguyen_widrow(3, 2, 1, 0))
    linear = Network(np.zeros((2, 0)), np.zeros(0), np.zeros((0, 1)), np.zeros(1), np.zeros((2, 1)))
    with pytest.raises(ValueError, match="direct"):
        levenberg_marquardt(x, y, linear)


def test_nguyen_widrow_shares_the_inputs_out() -> None:
    network = nguyen_widrow(18, 10, 1, seed=0)
    length = 0.7 * 10 ** (1 / 18)
    np.testing.assert_allclose(np.linalg.norm(network.hidden_weights, axis=0), length)
    np.testing.assert_allclose(np.sort(network.hidden_bias), length * np.linspace(-1, 1, 10))
    other = nguyen_widrow(18, 10, 1, seed=1)
    assert not np.array_equal(network.hidden_weights, other.hidden_weights)
    np.testing.assert_array_equal(network.hidden_weights, nguyen_widrow(18, 10, 1, seed=0).hidden_weights)
