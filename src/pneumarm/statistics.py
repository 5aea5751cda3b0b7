"""Means, rates and their confidence intervals, as results and reports give them."""

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


def summarise(reward: ArrayLike, success: ArrayLike, actions: ArrayLike, switches: ArrayLike) -> dict[str, Any]:
    """Return the means over episodes (n,) as ``results.json`` holds them, with their 95 % intervals.

    ``switches`` may be (n, joints); its mean is a list then, where there are several joints.
    """
    estimates = {
        "reward": mean_estimate(reward),
        "success_rate": rate_estimate(success),
        "actions": mean_estimate(actions),
    }
    columns = np.asarray(switches, np.float64).reshape(len(np.asarray(reward)), -1).T
    per_joint = [mean_estimate(column) for column in columns]
    figures = {name: estimate.mean for name, estimate in estimates.items()}
    intervals: dict[str, Any] = {name: [estimate.low, estimate.high] for name, estimate in estimates.items()}
    switched = [estimate.mean for estimate in per_joint]
    ranges = [[estimate.low, estimate.high] for estimate in per_joint]
    one = len(per_joint) == 1
    return {
        "episodes": len(np.asarray(reward)),
        **figures,
        "switches": switched[0] if one else switched,
        "intervals": {**intervals, "switches": ranges[0] if one else ranges},
    }
