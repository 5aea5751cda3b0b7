"""Having settled, by readings that scatter."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.moving.settling import reading_noise, settled_at

TOLERANCE, DWELL, REACHED = 1.0, 0.3, 0.4
RATES = 20.0, 45.0, 90.0


def movement(rate: float, rest: float, swing: float, frequency: float = 2.5) -> tuple[NDArray[np.float64], ...]:
    """Return times and errors of an arm that comes from 20 degrees, and rests and swings from ``REACHED`` on."""
    times = np.arange(0.0, 2.0, 1 / rate)
    coming = 20.0 * np.maximum(1 - times / REACHED, 0.0)
    return times, coming + rest + swing * np.sin(2 * np.pi * frequency * times)


def share(rate: float, noise: float, rest: float, swing: float = 0.0) -> float:
    """Return how often such an arm is found to have settled."""
    times, true = movement(rate, rest, swing)
    random, found = np.random.default_rng(0), 0
    for _ in range(200):
        off = true + noise * random.standard_normal(len(true)).clip(-3, 3)
        found += settled_at(times, off[:, None], TOLERANCE, DWELL) is not None
    return found / 200


@pytest.mark.parametrize("rate", RATES)
def test_readings_that_hardly_scatter_speak_for_themselves(rate: float) -> None:
    times, off = movement(rate, 0.9, 0.0)
    settled = settled_at(times, off[:, None], TOLERANCE, DWELL)
    assert settled == times[np.abs(off) <= TOLERANCE][0]
    off[-2] = 1.1
    assert settled_at(times, off[:, None], TOLERANCE, DWELL) is None


@pytest.mark.parametrize("noise", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("rate", RATES)
def test_an_arm_that_stands_at_its_goal_has_settled_however_its_readings_scatter(rate: float, noise: float) -> None:
    assert share(rate, noise, rest=0.3) > 0.9


@pytest.mark.parametrize("noise", [0.0, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("rate", RATES)
def test_an_arm_that_rests_elsewhere_or_swings_has_not_settled(rate: float, noise: float) -> None:
    assert share(rate, noise, rest=2.0) < 0.05
    assert share(rate, noise, rest=0.0, swing=2.5) < 0.05


def test_the_time_is_that_from_which_on_it_stays() -> None:
    times, true = movement(90.0, 0.0, 0.0)
    random, found = np.random.default_rng(1), []
    for _ in range(100):
        settled = settled_at(times, (true + 0.7 * random.standard_normal(len(true)))[:, None], TOLERANCE, DWELL)
        found.append(np.nan if settled is None else settled)
    assert np.nanmedian(found) == pytest.approx(REACHED, abs=0.1)


def test_one_joint_that_stays_away_is_enough() -> None:
    times = np.arange(0.0, 2.0, 0.02)
    off = np.zeros((len(times), 2))
    assert settled_at(times, off, TOLERANCE, DWELL) == 0.0
    off[:, 1] = 1.5
    assert settled_at(times, off, TOLERANCE, DWELL) is None


def test_scatter_is_that_of_the_noise_and_not_of_the_motion() -> None:
    times, off = movement(45.0, 0.0, 1.0)
    late = times > 1.0
    assert reading_noise(off[late]) < 0.05
    noisy = off + 0.5 * np.random.default_rng(0).standard_normal(len(off))
    assert reading_noise(noisy[late]) == pytest.approx(0.5, rel=0.3)
    assert reading_noise(np.zeros(3)) == 0.0


@pytest.mark.parametrize("far", [1e150, 6e302, -6e302])
def test_numbers_that_no_sensor_says_are_not_settled(far):
    times = np.arange(90) / 30
    off = far * (1 + 1e-3 * np.random.default_rng(0).normal(size=(90, 1)))
    assert settled_at(times, off, 1.0, 0.5) is None
