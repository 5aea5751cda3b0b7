"""Forecasts of references: what each forecaster is for is continued well by all of them together."""

import numpy as np
import pytest

from pneumarm.task.forecast import Forecast

PERIOD = 1 / 30
STEPS = np.array([1, 3, 6, 10])


def worst(reference, first: int, last: int, lateness: float = 0.0) -> float:
    """Return the largest error of forecasts from step ``first`` to ``last``, seen up to ``lateness`` steps late."""
    forecast, errors = Forecast(PERIOD), []
    for k in np.arange(last) + np.random.default_rng(0).uniform(0.0, lateness, last):
        forecast.see(reference(k), PERIOD * k)
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


@pytest.mark.parametrize("rate", [15, 60, 120])
@pytest.mark.parametrize("frequency", [0.25, 0.5, 1.0])
def test_a_sinusoid_goes_on_at_any_rate(frequency: float, rate: int):
    """What is remembered, and how far ahead it is judged, is a time, not a number of control periods."""
    forecast, steps = Forecast(1 / rate), np.array([rate // 15, rate // 3])
    for k in range(4 * rate):
        seen, *wanted = 200 * np.sin(2 * np.pi * frequency * (k + np.array([0, *steps])) / rate)
        forecast.see([seen], k / rate)
        if k >= rate:
            assert forecast.ahead(steps)[:, 0] == pytest.approx(wanted, abs=4.0)


@pytest.mark.parametrize("frequency", [0.1, 0.5, 1.0, 2.0])
def test_it_goes_on_where_readings_come_late(frequency: float):
    """By up to a tenth of a period, as under an operating system."""

    def wave(k: float) -> np.ndarray:
        return np.array([512 + 200 * np.sin(2 * np.pi * frequency * PERIOD * k)])

    assert worst(wave, 20, 150, lateness=0.1) < 0.02 * 200


def test_a_ramp_goes_on():
    assert worst(lambda k: np.array([3.0 * k]), 10, 60) < 1e-6
    assert worst(lambda k: np.array([3.0 * k]), 10, 60, lateness=0.3) < 1e-6


def test_a_reading_at_the_same_time_adds_nothing():
    forecast = Forecast(PERIOD)
    for k in range(5):
        for _ in range(2):
            forecast.see([3.0 * k], PERIOD * k)
    assert forecast.ahead(STEPS)[:, 0] == pytest.approx(3.0 * (4 + STEPS))


@pytest.mark.parametrize("seed", range(4))
def test_a_turn_that_comes_soon_after_a_late_one_makes_no_noise_a_wild_slope(seed: int):
    random, forecast = np.random.default_rng(seed), Forecast(PERIOD)

    def wave(k: float) -> float:
        return 500.0 + 200.0 * np.sin(np.pi * PERIOD * k)

    for turn in range(100):
        k = turn + (0.98 if turn % 10 == 5 else 0.0)
        forecast.see([wave(k) + random.normal(0, 1)], PERIOD * k)
        if turn > 30:
            assert abs(forecast.ahead(STEPS)[0, 0] - wave(k + 1)) < 20


def test_it_begins_anew_where_the_second_reading_comes_soon():
    forecast = Forecast(PERIOD)
    forecast.see([1.0], 0.0)
    forecast.see([2.0], 0.1 * PERIOD)
    assert forecast.ahead(STEPS)[:, 0] == pytest.approx(2.0)


def test_it_forecasts_over_a_turn_that_was_left_out():
    forecast = Forecast(PERIOD)
    for k in [*range(10), *range(13, 20)]:
        forecast.see([200 * np.sin(2 * np.pi * PERIOD * k)], PERIOD * k)
    coming = 200 * np.sin(2 * np.pi * PERIOD * (19 + STEPS))
    assert forecast.ahead(STEPS)[:, 0] == pytest.approx(coming, abs=10)


@pytest.mark.parametrize("frequency", [0.25, 0.5, 1.0, 2.0])
def test_a_sinusoid_that_has_just_begun_is_known_after_four_readings(frequency: float):
    def begins(k: int) -> np.ndarray:
        return np.array([512 + 200 * np.sin(2 * np.pi * frequency / 30 * max(k - 40, 0))])

    assert worst(begins, 44, 120) < 0.15 * 200


def test_after_a_jump_it_is_right_again_soon():
    assert worst(lambda k: np.array([100.0 if k < 50 else 400.0]), 60, 100) < 1.0


def test_it_stays_finite_whatever_is_asked_for():
    random, forecast = np.random.default_rng(0), Forecast(PERIOD)
    for k in range(300):
        forecast.see(random.choice([0.0, 1000.0, 512.0], size=2) + random.normal(0, 5, 2), PERIOD * k)
        assert np.abs(forecast.ahead(STEPS)).max() < 2e4
