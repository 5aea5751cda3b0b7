"""Max-Boltzmann exploration with the greedy action disabled."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.kernels import kernel
from pneumarm.learning.online.exploration import choose, greedy
from pneumarm.random import random_state

DRAWS = 200_000


@kernel
def _count(values, epsilon, temperature, random, counts, draws):  # type: ignore[no-untyped-def]
    odds = np.zeros(9, np.float32)
    for _ in range(draws):
        counts[choose(values, epsilon, temperature, odds, random)] += 1


def frequencies(values: NDArray[np.float32], epsilon: float, temperature: float) -> NDArray[np.float64]:
    counts = np.zeros(9)
    _count(values, epsilon, temperature, random_state(2), counts, DRAWS)
    return counts / DRAWS


@pytest.mark.parametrize(("epsilon", "temperature"), [(0.5, 20.0), (0.05, 1.0), (1.0, 5.0), (0.0, 1.0)])
def test_frequencies(epsilon: float, temperature: float) -> None:
    values = np.array([3, -20, 10, 9.5, 0, 2, 8, -50, 7], np.float32)
    odds = np.exp(values.astype(np.float64) / temperature)
    odds[2] = 0
    expected = epsilon * odds / odds.sum()
    expected[2] = 1 - epsilon
    deviation = np.sqrt(expected * (1 - expected) / DRAWS)
    got = frequencies(values, epsilon, temperature)
    assert (np.abs(got - expected) <= 4.5 * deviation + 1e-12).all()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_no_temperature_overflows(scale: float) -> None:
    values = np.array([1, 2, 3, 4, 5, 6, 7, 8, 9], np.float32) * np.float32(scale)
    got = frequencies(values, 1.0, 1.0)
    assert got[8] == 0
    assert got.sum() == pytest.approx(1)
    expected = 1.0 if scale > 1 else np.exp(7 * scale) / np.exp(scale * np.arange(8)).sum()
    assert got[7] == pytest.approx(expected, abs=0.01)


def test_equal_values_are_explored_alike() -> None:
    got = frequencies(np.zeros(9, np.float32), 0.8, 1.0)
    np.testing.assert_allclose(got, [0.2] + [0.1] * 8, atol=0.005)


def test_greedy_takes_the_first_of_equals_and_survives_nonsense() -> None:
    assert greedy(np.array([0, 5, 5, 1, 0, 0, 0, 0, 0], np.float32)) == 1
    assert greedy(np.full(9, np.nan, np.float32)) == 0
    assert 0 <= choose(np.full(9, np.nan, np.float32), 1.0, 1.0, np.zeros(9, np.float32), random_state(0)) < 9
