"""Forecasts of references: what each forecaster is for is continued well by all of them together."""

import numpy as np
import pytest

from pneumarm.task.forecast import Forecast

STEPS = np.array([1, 3, 6, 10])


def worst(reference, first: int, last: int) -> float:
    """Return the largest error of forecasts made from step ``first`` to ``last``."""
    forecast, errors = Forecast(1 / 30), []
    for k in range(last):
        forecast.see(reference(k))
        if k >= first:
            wanted = np.array([reference(k + step) for step in STEPS])
            errors.append(np.abs(forecast.ahead(STEPS) - wanted).max())
    return max(errors)


def test_a_constant_stays():
    assert worst(lambda k: np.array([500.0]), 0, 40) == 0


@pytest.mark.parametrize("frequency", [0.1, 0.5, 1.0, 2.0])
def test_a_sinusoid_goes_on(frequency: float):
    amplitude = 200.0

    def wave(k: int) -> np.ndarray:
        return 512 + amplitude * np.sin(2 * np.pi * frequency * k / 30 + np.array([0.3, 2.0]))

    assert worst(wave, 20, 150) < 0.02 * amplitude


def test_a_ramp_goes_on():
    assert worst(lambda k: np.array([3.0 * k]), 10, 60) < 1e-6


@pytest.mark.parametrize("frequency", [0.25, 0.5, 1.0, 2.0])
def test_a_sinusoid_that_has_just_begun_is_known_after_four_readings(frequency: float):
    def begins(k: int) -> np.ndarray:
        return np.array([512 + 200 * np.sin(2 * np.pi * frequency / 30 * max(k - 40, 0))])

    assert worst(begins, 44, 120) < 0.15 * 200


def test_after_a_jump_it_is_right_again_soon():
    assert worst(lambda k: np.array([100.0 if k < 50 else 400.0]), 60, 100) < 1.0


def test_it_stays_finite_whatever_is_asked_for():
    random, forecast = np.random.default_rng(0), Forecast(1 / 30)
    for _ in range(300):
        forecast.see(random.choice([0.0, 1000.0, 512.0], size=2) + random.normal(0, 5, 2))
        assert np.abs(forecast.ahead(STEPS)).max() < 2e4
