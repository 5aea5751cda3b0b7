"""Where a joint comes to rest at which pressures: a table recorded on the arm, and its inverse.

Two antagonistic muscles balance by the *ratio* of their pressures, (p1 - p2) / (p1 + p2); their sum, the
co-contraction, makes the joint stiff and shifts the balance but little. So the table is by ratio and sum. Pressures
are in bar.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_SMOOTHING = 0.1
"""Weight of the table's second differences against the measured angles."""
_LEAST_SLOPE = 1.0
"""The angle rises by at least so much from one ratio of the table to the next [counts]."""
_EMPTY = 1e-3
"""A sum of pressures below this has no ratio [bar]."""


@dataclass(frozen=True)
class StaticMap:
    """Angles at rest of one joint [counts] by sums and ratios of its two pressures."""

    sums: tuple[float, ...]
    """Rising [bar]."""
    ratios: tuple[float, ...]
    """Rising, from -1 to 1."""
    angles: tuple[tuple[float, ...], ...]
    """By sum, then by ratio, rising with the ratio [counts]."""
    highest: float
    """Highest pressure that a muscle is asked for [bar]."""

    def angle(self, first: float, second: float) -> float:
        """Return the angle [counts] at which the joint rests with the pressures ``first`` and ``second`` [bar]."""
        total = max(first + second, _EMPTY)
        ratio = min(max((first - second) / total, -1.0), 1.0)
        row, share = _place(self.sums, total)
        below = interpolate(ratio, self.ratios, self.angles[row])
        return below + share * (interpolate(ratio, self.ratios, self.angles[row + 1]) - below)

    def ratio(self, angle: float, total: float) -> float:
        """Return the ratio of pressures of the sum ``total`` [bar] at which the joint rests at ``angle`` [counts]."""
        row, share = _place(self.sums, total)
        below = interpolate(angle, self.angles[row], self.ratios)
        return below + share * (interpolate(angle, self.angles[row + 1], self.ratios) - below)

    def pressures(self, angle: float, total: float) -> tuple[float, float]:
        """Return the pressures [bar] for ``angle``: of the sum ``total``, or of a lower one to keep both possible."""
        for _ in range(3):  # a lower sum needs another ratio
            ratio = self.ratio(angle, total)
            too_high = total * (1 + abs(ratio)) / 2 / self.highest
            if too_high <= 1:
                break
            total /= too_high
        return total * (1 + ratio) / 2, total * (1 - ratio) / 2

    @property
    def ends(self) -> tuple[float, float]:
        """Angles at which one muscle has all pressure there is, the other next to none [counts]."""
        return self.angle(0.02 * self.highest, self.highest), self.angle(self.highest, 0.02 * self.highest)


def fit_map(
    pressures: ArrayLike, angles: ArrayLike, sums: Sequence[float], ratios: Sequence[float], highest: float
) -> StaticMap:
    """Return the map whose table comes nearest to what was measured, smoothly, and rises with the ratio.

    Args:
        pressures: of both muscles at rest, shape (n, 2) [bar].
        angles: at these, shape (n,) [counts].
        sums: of the table [bar].
        ratios: of the table.
        highest: pressure that a muscle is asked for [bar].

    """
    pressures, angles = np.asarray(pressures, np.float64), np.asarray(angles, np.float64)
    total = np.maximum(pressures.sum(axis=1), _EMPTY)
    by_sum = _hats(total, np.asarray(sums))
    by_ratio = _hats(np.clip((pressures[:, 0] - pressures[:, 1]) / total, -1, 1), np.asarray(ratios))
    design = (by_sum[:, :, None] * by_ratio[:, None, :]).reshape(len(angles), -1)
    smooth = [np.kron(_second_differences(len(sums)), np.eye(len(ratios)))]
    smooth.append(np.kron(np.eye(len(sums)), _second_differences(len(ratios))))
    # Rows that nothing was measured in follow the one next to them.
    smooth.append(np.kron(np.diff(np.eye(len(sums)), axis=0), np.diff(np.eye(len(ratios)), axis=0)))
    system = np.vstack([design, _SMOOTHING * np.vstack(smooth)])
    target = np.concatenate([angles, np.zeros(len(system) - len(angles))])
    table = np.linalg.lstsq(system, target, rcond=None)[0].reshape(len(sums), len(ratios))
    rising = _LEAST_SLOPE * np.arange(len(ratios))
    table = np.maximum.accumulate(table - rising, axis=1) + rising
    rows = tuple(tuple(float(one) for one in row) for row in table)
    return StaticMap(tuple(map(float, sums)), tuple(map(float, ratios)), rows, float(highest))


def interpolate(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """Return y at ``x`` between the points ``xs``, rising, and ``ys``; beyond them that of the nearest."""
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    i = bisect_right(xs, x) - 1
    return ys[i] + (ys[i + 1] - ys[i]) * (x - xs[i]) / (xs[i + 1] - xs[i])


def _place(nodes: Sequence[float], x: float) -> tuple[int, float]:
    """Return the interval of ``nodes`` that ``x`` lies in and how far in it, from 0 to 1; the nearest one beyond."""
    i = min(max(bisect_right(nodes, x) - 1, 0), len(nodes) - 2)
    return i, min(max((x - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0), 1.0)


def _hats(x: NDArray[np.float64], nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much of each of the ``nodes`` (m,) is in each ``x`` (n,) by linear interpolation, shape (n, m)."""
    return np.array([np.interp(x, nodes, unit) for unit in np.eye(len(nodes))]).T


def _second_differences(count: int) -> NDArray[np.float64]:
    return np.diff(np.eye(count), 2, axis=0)
