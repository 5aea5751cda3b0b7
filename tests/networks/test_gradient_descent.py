"""Gradient descent: what it finds, from where, and what it is not for."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.networks import gradient_descent, nguyen_widrow, two_layers

Floats = NDArray[np.float64]


def curved(rows: int, seed: int) -> tuple[Floats, Floats]:
    """Return inputs and targets that no linear model gets near to."""
    x = np.random.default_rng(seed).uniform(-1, 1, (rows, 3))
    return x, np.stack([np.sin(3 * x[:, 0]) * x[:, 1], np.abs(x[:, 2]) - 0.5], axis=1)


def errors(network, x: Floats, y: Floats) -> Floats:
    found: Floats = np.mean((network(x) - y) ** 2, axis=0) / y.var(axis=0)
    return found


def test_it_learns_what_is_curved_and_goes_on_from_there() -> None:
    x, y = curved(4000, 0)
    told: list[int] = []
    fit = gradient_descent(x, y, two_layers(3, 16, 2, 0), 40, 5e-3, 0, lambda number, mse: told.append(number))
    others = curved(1000, 1)
    assert (errors(fit.network, *others) < 0.05).all()
    assert told == list(range(1, 41))
    assert len(fit.mse) == 41
    assert fit.mse[-1] == pytest.approx(np.mean((fit.network(x) - y) ** 2, axis=0).sum(), rel=0.2)
    further = gradient_descent(x, y, fit.network, 20, 1e-3)
    assert further.mse[0] == pytest.approx(np.mean((fit.network(x) - y) ** 2, axis=0).sum(), rel=1e-4)
    assert further.mse[-1] < fit.mse[-1]


def test_it_is_reproducible_and_depends_on_its_seed() -> None:
    x, y = curved(300, 0)
    first, again, other = (gradient_descent(x, y, two_layers(3, 4, 2, 0), 3, 5e-3, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.network(x), again.network(x))
    assert (first.network(x) != other.network(x)).any()


def test_fewer_rows_than_a_batch_are_learned_too() -> None:
    x, y = curved(10, 0)
    fit = gradient_descent(x, y, two_layers(3, 8, 2, 0), 200, 5e-3)
    assert fit.mse[-1] < fit.mse[0] / 2


def test_one_hidden_layer_is_for_another() -> None:
    with pytest.raises(ValueError, match="two hidden layers"):
        gradient_descent(*curved(10, 0), nguyen_widrow(3, 4, 2, 0), 1, 5e-3)
