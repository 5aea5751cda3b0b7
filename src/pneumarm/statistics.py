"""Statistics of results and reports: intervals, moving means, trends. Pure functions on arrays."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

Z = 1.959964
"""Two-sided 95 % of the normal distribution."""
FEWEST = 30
"""Fewest samples of which the mean is taken as normally distributed."""


class Estimate(NamedTuple):
    """A mean and its 95 % confidence interval; low and high are NaN where there are too few samples for one."""

    mean: float
    low: float
    high: float
    samples: int


def mean_estimate(values: ArrayLike) -> Estimate:
    """Return the mean of ``values`` (n,) and its interval mean ± 1.96 s/√n, the samples taken as independent."""
    x = np.asarray(values, np.float64)
    n = len(x)
    if n == 0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    mean = float(x.mean())
    half = Z * float(x.std(ddof=1)) / math.sqrt(n) if n >= FEWEST else math.nan
    return Estimate(mean, mean - half, mean + half, n)


def rate_estimate(successes: ArrayLike) -> Estimate:
    """Return the share of true values in ``successes`` (n,) and its Wilson score interval.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927); unlike the normal interval it holds near 100 %.
    """
    x = np.asarray(successes, bool)
    n = len(x)
    if n == 0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    low, high = wilson(float(x.sum()), float(n))
    return Estimate(float(x.mean()), float(low), float(high), n)


def wilson(successes: ArrayLike, trials: ArrayLike) -> tuple[Array, Array]:
    """Return the ends of the Wilson interval for ``successes`` out of ``trials`` (same shape, trials > 0)."""
    k, n = np.asarray(successes, np.float64), np.asarray(trials, np.float64)
    p, z2 = k / n, Z * Z
    centre = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = Z / (1 + z2 / n) * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
    # At 0 and at all successes the ends are 0 and 1 exactly; rounding must not put the rate outside.
    return np.minimum(np.maximum(centre - half, 0), p), np.maximum(np.minimum(centre + half, 1), p)


class Moving(NamedTuple):
    """A moving mean: where its window is centred, its value, the ends of its interval; each shape (m,)."""

    position: Array
    mean: Array
    low: Array
    high: Array


def moving_mean(values: ArrayLike, window: int, counted: ArrayLike | None = None) -> Moving:
    """Return the mean of ``values`` (n,) around every one of them, with 95 % intervals.

    A mean is over ``window`` samples about its position, fewer at the ends, where there are no more. Only the
    samples that are ``counted`` (n,) enter; where there are none the position is left out, where there is only one
    the interval is NaN.
    """
    x = np.asarray(values, np.float64)
    use = np.ones(len(x), bool) if counted is None else np.asarray(counted, bool)
    shift = x[use].mean() if use.any() else 0.0  # keeps the difference of squares below from cancelling
    kept = np.where(use, x - shift, 0.0)
    count = _window_sum(use.astype(np.float64), window)
    some = count > 0
    count = count[some]
    mean = _window_sum(kept, window)[some] / count
    square = _window_sum(kept * kept, window)[some] / count
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(count > 1, np.maximum(square - mean * mean, 0) * count / (count - 1), np.nan)
        half: Array = Z * np.sqrt(variance / count)
    level: Array = mean + shift
    return Moving(np.flatnonzero(some).astype(np.float64), level, level - half, level + half)


def moving_rate(successes: ArrayLike, window: int) -> Moving:
    """Return the share of true values around every sample, with Wilson intervals; windows as in moving_mean."""
    x = np.asarray(successes, np.float64)
    won, trials = _window_sum(x, window), _window_sum(np.ones(len(x)), window)
    low, high = wilson(won, trials)
    return Moving(np.arange(len(x), dtype=np.float64), won / trials, low, high)


def _window_sum(x: Array, window: int) -> Array:
    """Return the sum of ``x`` (n,) over ``window`` samples about each, cut at the ends."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    index = np.arange(len(x))
    first = np.maximum(index - window // 2, 0)
    end = np.minimum(index - window // 2 + window, len(x))
    summed: Array = total[end] - total[first]
    return summed


class Bins(NamedTuple):
    """Statistics of ``y`` by class of ``x``, each shape (classes,)."""

    centre: Array
    """Median of x in the class."""
    mean: Array
    std: Array
    samples: Array


def binned(x: ArrayLike, y: ArrayLike, bins: int = 12, fewest: int = 20) -> Bins:
    """Return the statistics of ``y`` (n,) in ``bins`` classes of equal width over the 0.5th to 99.5th percentile.

    The outermost classes are open; a class of fewer than ``fewest`` samples is left out.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if len(x) == 0:
        return Bins(*(np.empty(0) for _ in range(4)))
    low, high = np.percentile(x, (0.5, 99.5))
    edges = np.linspace(low, high, bins + 1)[1:-1]
    return by_group(np.searchsorted(edges, x), x, y, fewest)


def by_group(group: ArrayLike, x: ArrayLike, y: ArrayLike, fewest: int = 1) -> Bins:
    """Return the statistics of ``y`` (n,) for each value of ``group`` (n,) that at least ``fewest`` samples have."""
    group, x, y = np.asarray(group), np.asarray(x, np.float64), np.asarray(y, np.float64)
    members = [group == value for value in np.unique(group)]
    members = [m for m in members if m.sum() >= fewest]
    return Bins(
        np.array([np.median(x[m]) for m in members]),
        np.array([y[m].mean() for m in members]),
        np.array([y[m].std() for m in members]),
        np.array([m.sum() for m in members], np.float64),
    )


def slope(x: ArrayLike, y: ArrayLike) -> float:
    """Return the least-squares slope of ``y`` (n,) over ``x`` (n,); NaN where x does not vary."""
    a, b = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if len(a) < 2:
        return math.nan
    a = a - a.mean()
    spread = float(a @ a)
    return float(a @ (b - b.mean())) / spread if spread > 0 else math.nan


def running_median(x: ArrayLike, y: ArrayLike, bins: int = 15, fewest: int = 5) -> tuple[Array, Array]:
    """Return the median of ``y`` (n,) in classes of ``x`` (n,) with equally many samples, shapes (m,) and (m,)."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    pieces = min(bins, len(x) // fewest)
    if pieces == 0:
        return np.empty(0), np.empty(0)
    parts = np.array_split(np.argsort(x, kind="stable"), pieces)
    return np.array([np.median(x[p]) for p in parts]), np.array([np.median(y[p]) for p in parts])


def summarise(reward: ArrayLike, success: ArrayLike, actions: ArrayLike, switches: ArrayLike) -> dict[str, Any]:
    """Return the means over episodes (n,) as ``results.json`` holds them, with their 95 % intervals.

    There is no interval where there are too few episodes for one. ``switches`` may be (n, joints); its mean is a
    list then, where there are several joints.
    """
    estimates = {
        "reward": mean_estimate(reward),
        "success_rate": rate_estimate(success),
        "actions": mean_estimate(actions),
    }
    columns = np.asarray(switches, np.float64).reshape(len(np.asarray(reward)), -1).T
    per_joint = [mean_estimate(column) for column in columns]
    switched = [estimate.mean for estimate in per_joint]
    ranges = [_interval(estimate) for estimate in per_joint]
    one = len(per_joint) == 1
    return {
        "episodes": len(np.asarray(reward)),
        **{name: estimate.mean for name, estimate in estimates.items()},
        "switches": switched[0] if one else switched,
        "intervals": {
            **{name: _interval(estimate) for name, estimate in estimates.items()},
            "switches": ranges[0] if one else ranges,
        },
    }


def _interval(estimate: Estimate) -> list[float] | None:
    return None if math.isnan(estimate.low) else [estimate.low, estimate.high]
