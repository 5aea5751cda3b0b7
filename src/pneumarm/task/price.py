"""What a movement costs: errors, and valves that open and close; with the derivatives.

    error:   log(1 + (max(|e| - flat, 0) / precision)^2) / 2 + far |e|          e in tolerances
    valves:  change (o (1 - o' same) + o (1 - held) + o' (1 - same)(1 - o))
    slack:   slack max(stiffness - q, 0) / (1 + (e / 5)^2)                      of each muscle, of joints that stay
    mean:    cocontraction max(stiffness - m, m - 1.6 stiffness, 0)             of joints that move

where o tells whether a valve opens in a period, held whether it is still open at its end, o' held of the period
before, and same whether it was the same valve. Counts have no slope, so o and held are smooth stand-ins:
o = 1.1 m / (m + 0.1) and held = max(m - 0.8, 0) / 0.2 of a pulse of m periods. A muscle is slack by what its
pressure, q of the range, is short of the stiffness that is wanted. That matters less far from the goal; no slope
goes through this weight, or staying away would pay. The mean m of both pressures changes slowly, and does not show in
the angle within the time that a gradient sees: soft joints swing, and stiff ones take too much air to move.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, part
from pneumarm.networks.tansig import FASTMATH

_ONE, _ZERO = np.float32(1.0), np.float32(0.0)
_SOFT, _LONG = np.float32(0.1), np.float32(0.8)
_NEAR = np.float32(1 / 5)  # of an error in tolerances
_TIGHT = np.float32(1.6)  # stiffnesses


class PriceParameters(NamedTuple):
    """Prices, see the module."""

    precision: float
    far: float
    flat: float
    change: float
    slack: float = 0.0
    cocontraction: float = 0.0
    stiffness: float = 0.0


def prices_of_errors(prices: PriceParameters, error: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the price of each ``error`` in tolerances."""
    size = np.abs(error)
    beyond = np.maximum(size - prices.flat, 0) / prices.precision
    return 0.5 * np.log1p(beyond**2) + prices.far * size


@inner(fastmath=FASTMATH)
def price_of_error(prices, error, slope):  # type: ignore[no-untyped-def]
    """Return the sum of the prices of the ``error`` (n,) in tolerances; set ``slope`` (n,) to its derivatives.

    The errors are replaced by their prices, as a loop that adds up does one number at a time.
    """
    for e in range(error.shape[0]):
        error[e], slope[e] = price_of_one_error(prices, error[e])
    total = _ZERO
    for e in range(error.shape[0]):
        total += error[e]
    return total


@part(fastmath=FASTMATH)
def price_of_one_error(prices, error):  # type: ignore[no-untyped-def]
    """Return the price of an ``error`` in tolerances and its slope."""
    far, flat, sharp = np.float32(prices.far), np.float32(prices.flat), _ONE / np.float32(prices.precision)
    size, sign = abs(error), _ONE if error > _ZERO else -_ONE
    beyond = max(size - flat, _ZERO) * sharp
    square = _ONE + beyond * beyond
    return np.float32(0.5) * np.log(square) + far * size, sign * (sharp * beyond / square + far)


@part
def price_of_slack(prices, error, share):  # type: ignore[no-untyped-def]
    """Return the price of a muscle's pressure, as a ``share`` of the range, and its slope by that.

    ``error`` is the joint's in tolerances.
    """
    short = np.float32(prices.stiffness) - share
    if short <= _ZERO:
        return _ZERO, _ZERO
    far = _NEAR * error
    price = np.float32(prices.slack) / (_ONE + far * far)
    return price * short, -price


@part
def price_of_cocontraction(prices, mean):  # type: ignore[no-untyped-def]
    """Return the price of the ``mean`` pressure of two muscles, as a share of the range, and its slope by that."""
    price, stiffness = np.float32(prices.cocontraction), np.float32(prices.stiffness)
    short, beyond = stiffness - mean, mean - _TIGHT * stiffness
    if short > _ZERO:
        return price * short, -price
    if beyond > _ZERO:
        return price * beyond, price
    return _ZERO, _ZERO


@part
def opening(size):  # type: ignore[no-untyped-def]
    """Return o of a pulse of ``size`` periods and its slope."""
    below = _ONE / (size + _SOFT)
    return (_ONE + _SOFT) * size * below, (_ONE + _SOFT) * _SOFT * below * below


@part
def holding(size):  # type: ignore[no-untyped-def]
    """Return held of a pulse of ``size`` periods and its slope."""
    if size > _LONG:
        return (size - _LONG) / (_ONE - _LONG), _ONE / (_ONE - _LONG)
    return _ZERO, _ZERO


@inner(fastmath=FASTMATH)
def price_of_changes(prices, command, before, slope, slope_before):  # type: ignore[no-untyped-def]
    """Return the price of the commands (n,) of one muscle after those ``before``; set the slopes by both, signed.

    The commands ``before`` are replaced by the changes, as in :func:`price_of_error`.
    """
    change, total = np.float32(prices.change), _ZERO
    for e in range(command.shape[0]):
        sign = _ONE if command[e] >= _ZERO else -_ONE
        sign_before = _ONE if before[e] >= _ZERO else -_ONE
        o, o_slope = opening(abs(command[e]))
        held, held_slope = holding(abs(command[e]))
        old, old_slope = holding(abs(before[e]))
        if command[e] * before[e] > _ZERO:
            changes = o * (_ONE - old) + o * (_ONE - held)
            by_o, by_old = (_ONE - old) + (_ONE - held), -o
        else:
            changes = o + o * (_ONE - held) + old * (_ONE - o)
            by_o, by_old = _ONE + (_ONE - held) - old, _ONE - o
        slope[e] = change * sign * (by_o * o_slope - o * held_slope)
        slope_before[e] = change * sign_before * by_old * old_slope
        before[e] = changes
    for e in range(before.shape[0]):
        total += before[e]
    return change * total
