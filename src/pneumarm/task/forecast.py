"""Forecasts of a reference whose future is not known, from what was asked for so far.

Three forecasters run side by side, and that one is believed which has lately been nearest to what came:

    hold:            r_{k+p} = r_k
    swing:           differences d_{k+1} = w d_k - d_{k-1}, which continues a sinusoid about any middle, or a line
                     (w = 2); w by ridge regression, towards that of a sinusoid of 1 Hz
    autoregression:  differences d_{k+1} = w_1 d_k + ... + w_m d_{k-m+1}, the weights by ridge regression over the
                     last second or so, towards d_{k+1} = d_k; it continues sums of sinusoids and smooth moves

What was before a jump or a bend says nothing of what comes after it, and is forgotten.

Readings come milliseconds early or late, and the reference was asked for at those times. Taken for even ones they
spoil every difference: a swing of 1 Hz, seen with 1.5 ms of lateness, would be forecast 8 degrees of 20 off after a
quarter of a second. So r_k is interpolated at even times, a period apart and the last of them now, by a cubic through
the four readings around each. One that comes soon after another takes its place.
"""

from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_ORDER = 3
_MEMORY = 0.8  # s of differences that the weights are found from
_FORGETTING = 0.8  # of a forecaster's error, in a thirtieth of a second
_JUDGED = 1 / 6  # s ahead at which forecasters are judged, as well as a step ahead
_SURPRISE = 0.5  # error of all forecasters, in parts of the largest difference seen: a jump or a bend
_SWING = 0.7  # Hz, of which a reference is expected that has just begun to move
_DOUBT = 0.02  # in the swing that is expected, in parts of the largest difference squared
_RIDGE = 1e-6  # in parts of the largest difference squared
_FASTEST = 1.5  # largest forecast difference, in parts of the largest one seen
_SOON = 0.5  # periods; after a late turn the next one comes so soon that any noise between both would be a wild slope
_CUBIC = 4  # readings that a value between two of them is interpolated from


class Forecast:
    """The forecast of one reference; ``see`` it once every control ``period`` [s], about."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._swing = 2 * np.cos(2 * np.pi * _SWING * period)
        self._kept = _FORGETTING ** (30 * period)
        self._judged = np.array([1, max(round(_JUDGED / period), 1)])
        memory = max(round(_MEMORY / period), 2 * _ORDER) + _ORDER + 1  # enough for the weights at any rate
        self._times: deque[float] = deque(maxlen=memory)
        self._values: deque[Array] = deque(maxlen=memory)
        self._said: deque[tuple[float, Array]] = deque(maxlen=int(self._judged.max()))
        self._errors = np.zeros(0)

    def see(self, value: ArrayLike, time: float) -> None:
        """Take in what is asked for now, shape (joints,), at ``time`` [s]; nothing, where no time has passed."""
        if self._times and time <= self._times[-1]:
            return
        if self._times and time - self._times[-1] < _SOON * self._period:
            for seen in (self._times, self._values, self._said):
                seen.pop()
        value = np.atleast_1d(np.asarray(value, np.float64))
        if self._said and self._is_surprise(value, time):
            self._times = deque([self._times[-1]], self._times.maxlen)
            self._values = deque([self._values[-1]], self._values.maxlen)
        self._times.append(time)
        self._values.append(value)
        if self._errors.size == 0:
            self._errors = np.array([[0.0], [1e-3], [2e-3]]) + np.zeros(value.size)  # the plainer, the rather
        self._errors *= self._kept
        for place, steps in enumerate(self._judged):
            if len(self._said) >= steps:
                then, forecast = self._said[-steps]
                came = self._at(np.array([then + steps * self._period]))[0]
                self._errors += np.abs(forecast[:, place] - came) / steps
        self._said.append((time, self._all(self._judged)))

    def ahead(self, steps: NDArray[np.int64]) -> Array:
        """Return what will be asked for so many ``steps`` (previews,) from now, shape (previews, joints)."""
        best = self._errors.argmin(axis=0)
        return np.take_along_axis(self._all(steps), best[None, None], axis=0)[0]

    def _is_surprise(self, value: Array, time: float) -> bool:
        """Return whether ``value`` (joints,) at ``time`` [s] is one after which what was before says nothing."""
        then, forecast = self._said[-1]
        late = (time - then) / self._period  # of a step that was forecast; the last one changed by as much as it will
        came = value - (late - 1.0) * (value - self._values[-1])
        error = np.abs(forecast[:, 0] - came).min(axis=0)
        change = np.abs(np.diff(self._values, axis=0))
        return bool((error > _SURPRISE * change.max(axis=0, initial=0.0)).any())

    def _at(self, times: Array) -> Array:
        """Return what was asked for at ``times`` (n,) [s], between readings and a little beyond them, (n, joints)."""
        seen, values = np.array(self._times), np.stack(self._values)
        points = min(_CUBIC, len(seen))
        first = np.clip(np.searchsorted(seen, times) - points // 2, 0, len(seen) - points)
        near = first[:, None] + np.arange(points)
        return np.einsum("np,npj->nj", _lagrange(seen[near], times), values[near])

    def _even(self) -> Array:
        """Return what was asked for at even times, the last of them now, shape (times, joints)."""
        now = self._times[-1]
        count = 1 + round((now - self._times[0]) / self._period)
        return self._at(now - self._period * np.arange(min(count, len(self._times)), dtype=np.float64)[::-1])

    def _all(self, steps: NDArray[np.int64]) -> Array:
        """Return all forecasts, shape (forecasters, previews, joints)."""
        seen = self._even()
        hold = np.broadcast_to(seen[-1], (len(steps), seen.shape[1]))
        if len(seen) == 1:
            return np.stack([hold] * len(self._errors))
        change = np.diff(seen, axis=0)
        largest = np.abs(change).max(axis=0)
        unit = np.where(largest > 0.0, largest, 1.0)
        ways = _as_swing(change / unit, self._swing), _as_autoregression(change / unit)
        return np.stack([hold, *(_stepped(seen[-1], *way, unit, steps) for way in ways)])


def _lagrange(nodes: Array, at: Array) -> Array:
    """Return the weights (n, p) of values at ``nodes`` (n, p) in the polynomials through them, ``at`` (n,)."""
    points = nodes.shape[1]
    weights = np.ones(nodes.shape)
    for i in range(points):
        for j in range(points):
            if i != j:
                weights[:, i] *= (at - nodes[:, j]) / (nodes[:, i] - nodes[:, j])
    return weights


def _as_swing(change: Array, expected: float) -> tuple[Array, Array]:
    """Return the latest of the changes (n, joints) and their weights, both (2, joints), in a swing.

    ``expected`` is the weight of the latest change where little was seen.
    """
    middle = change[1:-1]
    weight = _DOUBT * expected + (middle * (change[2:] + change[:-2])).sum(axis=0)
    weight = np.clip(weight / (_DOUBT + (middle**2).sum(axis=0)), -2.0, 2.0)
    return change[[-1, max(-2, -len(change))]], np.stack([weight, np.full(weight.shape, -1.0)])


def _as_autoregression(change: Array) -> tuple[Array, Array]:
    """Return the latest of the changes (n, joints) and their weights, both (order, joints), in an autoregression."""
    rows = len(change) - _ORDER
    if rows < 2:
        return change[-1:], np.ones((1, change.shape[1]))
    before = np.stack([change[_ORDER - 1 - i : len(change) - 1 - i] for i in range(_ORDER)], axis=1)
    normal = np.einsum("roj,rpj->jop", before, before) + _RIDGE * np.eye(_ORDER)
    missed = np.einsum("roj,rj->jo", before, change[_ORDER:] - before[:, 0])
    weights = np.linalg.solve(normal, missed[..., None])[..., 0].T
    weights[0] += 1.0
    return change[::-1][:_ORDER], weights


def _stepped(now: Array, latest: Array, weights: Array, unit: Array, steps: NDArray[np.int64]) -> Array:
    """Return what comes (previews, joints) after ``now`` where changes, the ``latest`` first, go on by ``weights``.

    Changes are in parts of ``unit`` (joints,).
    """
    state, sums = latest.copy(), np.zeros((int(steps.max()) + 1, now.size))
    for k in range(len(sums) - 1):
        following = np.minimum(np.maximum((weights * state).sum(axis=0), -_FASTEST), _FASTEST)
        state[1:] = state[:-1]
        state[0] = following
        sums[k + 1] = sums[k] + following
    return now + sums[steps] * unit
