"""Quantiles and tail probabilities that the analysis needs, without SciPy at run time.

Student's t and Fisher's F follow from the regularised incomplete beta function I_x(a, b), which has the continued
fraction of Abramowitz and Stegun, 26.5.8, evaluated by Lentz' method.
"""

import functools
import math
from statistics import NormalDist

_TINY, _EPSILON, _MOST = 1e-300, 1e-15, 10_000


def half_normal_quantile(probability: float) -> float:
    """Return z with P(|Z| <= z) = ``probability`` for a standard normal Z."""
    return NormalDist().inv_cdf(0.5 + probability / 2)


def incomplete_beta(x: float, a: float, b: float) -> float:
    """Return I_x(a, b), the distribution function of the beta distribution, for 0 <= ``x`` <= 1 and a, b > 0."""
    if x <= 0 or x >= 1:
        return 0.0 if x <= 0 else 1.0
    if x > (a + 1) / (a + b + 2):  # where the fraction would converge slowly
        return 1.0 - incomplete_beta(1.0 - x, b, a)
    log_front = (
        math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x) - math.log(a)
    )
    fraction, c, d = 1.0, 1.0, 0.0
    for i in range(_MOST):
        m = i // 2
        if i == 0:
            numerator = 1.0
        elif i % 2 == 0:
            numerator = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        else:
            numerator = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        d = 1.0 / _besides_zero(1.0 + numerator * d)
        c = _besides_zero(1.0 + numerator / c)
        fraction *= c * d
        if abs(1.0 - c * d) < _EPSILON:
            break
    return math.exp(log_front) * (fraction - 1.0)


def _besides_zero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


def f_tail(ratio: float, numerator: float, denominator: float) -> float:
    """Return P(F > ``ratio``) for F with so many degrees of freedom."""
    if ratio <= 0:
        return 1.0
    return incomplete_beta(denominator / (denominator + numerator * ratio), denominator / 2, numerator / 2)


def t_tail(t: float, freedom: float) -> float:
    """Return P(T > ``t``) for Student's T with ``freedom`` degrees."""
    beyond = incomplete_beta(freedom / (freedom + t * t), freedom / 2, 0.5) / 2
    return beyond if t > 0 else 1.0 - beyond


@functools.lru_cache(maxsize=256)
def t_quantile(probability: float, freedom: float) -> float:
    """Return t with P(|T| <= t) = ``probability`` for Student's T with ``freedom`` degrees, which may be broken."""

    def covered(t: float) -> float:
        return 1.0 - incomplete_beta(freedom / (freedom + t * t), freedom / 2, 0.5)

    low, high = 0.0, 1.0
    while covered(high) < probability:
        high *= 2
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if covered(middle) < probability else (low, middle)
    return (low + high) / 2
