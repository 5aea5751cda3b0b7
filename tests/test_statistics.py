import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pneumarm.statistics import (
    binned,
    mean_estimate,
    moving_mean,
    moving_rate,
    rate_estimate,
    running_median,
    slope,
    wilson,
)

numbers = st.floats(-1e3, 1e3, allow_nan=False)
series = st.integers(1, 60).flatmap(lambda n: arrays(np.float64, n, elements=numbers))


def test_wilson_interval_of_a_textbook_example():
    # 81 of 263: Newcombe, Stat. Med. 17 (1998), table I, method 3 gives 0.2553 to 0.3662.
    low, high = wilson(81, 263)
    assert (round(float(low), 4), round(float(high), 4)) == (0.2553, 0.3662)


@given(st.integers(1, 5000), st.floats(0, 1))
def test_wilson_interval_holds_the_rate_and_stays_within_0_and_1(trials, share):
    successes = round(share * trials)
    low, high = wilson(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1
    assert high > low


def test_mean_interval_covers_the_true_mean_95_times_in_100():
    random = np.random.default_rng(0)
    samples = random.exponential(3.0, (4000, 200))
    found = [mean_estimate(row) for row in samples]
    covered = np.mean([e.low <= 3.0 <= e.high for e in found])
    assert 0.92 < covered < 0.965  # a little under 95 % because an exponential is skewed


def test_few_samples_have_a_mean_but_no_interval():
    estimate = mean_estimate([1.0, 2.0])
    assert estimate.mean == 1.5
    assert math.isnan(estimate.low)
    assert math.isnan(mean_estimate([]).mean)
    assert math.isnan(rate_estimate([]).mean)


@given(series, st.integers(1, 80), st.data())
def test_moving_mean_is_the_mean_of_the_counted_samples_in_each_window(x, window, data):
    counted = data.draw(arrays(bool, len(x)))
    moving = moving_mean(x, window, counted)
    expected = []
    for i in range(len(x)):
        part = slice(max(0, i - window // 2), max(0, i - window // 2 + window))
        inside = x[part][counted[part]]
        if len(inside):
            expected.append(
                (i, inside.mean(), inside.std(ddof=1) / math.sqrt(len(inside)) if len(inside) > 1 else None)
            )
    assert moving.position.tolist() == [i for i, _, _ in expected]
    assert np.allclose(moving.mean, [m for _, m, _ in expected], atol=1e-8)
    for k, (_, _, error) in enumerate(expected):
        half = moving.high[k] - moving.mean[k]
        assert math.isnan(half) if error is None else half == pytest.approx(1.959964 * error, abs=2e-3)


@given(arrays(bool, st.integers(0, 60)), st.integers(1, 30))
def test_moving_rate_lies_within_its_interval(x, window):
    moving = moving_rate(x, window)
    assert len(moving.mean) == len(x)
    assert ((moving.low >= 0) & (moving.low <= moving.mean) & (moving.mean <= moving.high) & (moving.high <= 1)).all()


def test_slope_is_that_of_polyfit():
    random = np.random.default_rng(1)
    x = random.normal(40, 3, 500)
    y = 0.7 * x + random.normal(0, 1, 500)
    assert slope(x, y) == pytest.approx(np.polyfit(x, y, 1)[0])
    assert math.isnan(slope([2.0, 2.0], [1.0, 3.0]))
    assert math.isnan(slope([1.0], [1.0]))


def test_classes_find_a_spread_that_grows():
    random = np.random.default_rng(2)
    x = random.uniform(-1, 1, 20_000)
    found = binned(x, random.normal(0, 1 + np.abs(x)))
    assert np.allclose(found.std, 1 + np.abs(found.centre), rtol=0.12)
    assert np.abs(found.mean).max() < 0.2
    assert found.samples.sum() == len(x)


def test_running_median_of_a_line_is_the_line():
    x = np.random.default_rng(3).permutation(np.arange(300.0))
    where, median = running_median(x, 2 * x + 1)
    assert np.allclose(median, 2 * where + 1)
    assert len(running_median([1.0], [1.0])[0]) == 0
