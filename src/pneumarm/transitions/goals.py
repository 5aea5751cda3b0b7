"""Goals that an arm can hold, learned from what it was seen to do.

Of one joint they are the angles between two percentiles of those recorded. Joints that pull on each other cannot hold
every combination of such angles: a cable that passes another joint runs out, a weight becomes too heavy. So for every
pair of joints goals also lie between percentiles of weighted sums of their angles,

    low <= cos(alpha) theta_i / h_i + sin(alpha) theta_j / h_j <= high

in six directions alpha between the axes, h being half the range of a joint: a polygon around the combinations that
were seen while both joints were slow. Where all combinations were seen, it leaves out next to nothing.

A joint with one muscle swings far beyond where it can stand: with the muscle empty or full nothing is left that could
pull it on. So its goals also lie between where it stood then.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.transitions.quantiles import Quantiles
from pneumarm.transitions.rows import Rows

_DIRECTIONS = np.radians([22.5, 45.0, 67.5, 112.5, 135.0, 157.5])
_SLOW = 0.3  # share of the readings in which a joint counts as slow
_SHARES = 0.002, 0.998  # of slow readings: a uniform square loses 0.2 % at a corner
_STRETCH = 0.2  # s in which a joint that stands hardly moves; one that turns round does
_END = 0.03  # of the range of pressures, within which a muscle counts as empty or full
_FULLEST = 0.005, 0.995  # shares of the pressures that this range spans
_ENOUGH = 8  # readings at an end, to know where it is
_TRIES = 1000  # draws until a goal counts as good whatever it is


class Goals(NamedTuple):
    """Goals for an arm with ``joints`` joints, uniform within all limits."""

    range: NDArray[np.float64]
    """Lowest and highest angle of each joint, shape (joints, 2) [counts]."""
    ways: NDArray[np.float64]
    """Weights of the angles in each limited sum, shape (k, joints) [1/counts]."""
    limits: NDArray[np.float64]
    """Lowest and highest value of each sum, shape (k, 2)."""

    @classmethod
    def of(cls, goals: "Goals | ArrayLike") -> Self:
        """Return ``goals``, or where that is a range (joints, 2) all goals within it."""
        if isinstance(goals, cls):
            return goals
        range_ = np.asarray(goals, np.float64)
        return cls(range_, np.zeros((0, len(range_))), np.zeros((0, 2)))

    @property
    def middle(self) -> NDArray[np.float64]:
        """The middle of the ranges, shape (joints,) [counts]."""
        return self.range.mean(axis=1)

    def contain(self, angle: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of the angles (..., joints) [counts] are goals, shape (...)."""
        sums = angle @ self.ways.T
        joint = (angle >= self.range[:, 0]) & (angle <= self.range[:, 1])
        pair = (sums >= self.limits[:, 0]) & (sums <= self.limits[:, 1])
        return np.asarray(joint.all(axis=-1) & pair.all(axis=-1))

    def draw(self, random: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Return ``count`` goals (count, joints) [counts]."""
        low, high = self.range.T
        goals = random.uniform(low, high, (count, len(low)))
        for _ in range(_TRIES):
            refused = ~self.contain(goals)
            if not refused.any():
                break
            goals[refused] = random.uniform(low, high, (int(refused.sum()), len(low)))
        return goals

    def within(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return angles (..., joints) [counts], those beyond a limit of sums moved straight towards the middle."""
        away = angle - self.middle
        sums, centre = away @ self.ways.T, self.ways @ self.middle
        room = np.where(sums > 0, self.limits[:, 1] - centre, self.limits[:, 0] - centre)
        beyond = np.max(np.divide(sums, room, out=np.zeros_like(sums), where=room != 0), axis=-1, initial=1.0)
        return self.middle + away / beyond[..., None]


def seen_goals(blocks: Callable[[], Iterable[Rows]], range_: NDArray[np.float64]) -> Goals:
    """Return the goals within ``range_`` (joints, 2) [counts] that the rows of ``blocks()`` have seen, read twice."""
    joints = len(range_)
    half = np.ptp(range_, axis=1) / 2
    if joints == 1 or not (half > 0).all():
        return Goals.of(range_)
    pairs = [(i, j) for i in range(joints) for j in range(i + 1, joints)]
    ways = np.zeros((len(pairs) * len(_DIRECTIONS), joints))
    for number, (i, j) in enumerate(pairs):
        of_pair = slice(number * len(_DIRECTIONS), (number + 1) * len(_DIRECTIONS))
        ways[of_pair, i], ways[of_pair, j] = np.cos(_DIRECTIONS) / half[i], np.sin(_DIRECTIONS) / half[j]
    speeds = Quantiles(joints)
    for block in blocks():
        speeds.add(_moved(block)[0])
    if not speeds.total:
        return Goals.of(range_)
    slow, sums = speeds([_SLOW])[0], Quantiles(len(ways))
    middle = range_.mean(axis=1)
    for block in blocks():
        moved, angle = _moved(block)
        sums.add((angle[(moved <= slow).all(axis=1)] - middle) @ ways.T)
    if not sums.total:
        return Goals.of(range_)
    return Goals(range_, ways, sums(_SHARES).T + (ways @ middle)[:, None])


def held_range(
    blocks: Callable[[], Iterable[Rows]], range_: NDArray[np.float64], period: float
) -> NDArray[np.float64]:
    """Return what of ``range_`` (joints, 2) [counts] joints with one muscle hold, by ``blocks()``, read twice.

    An end of it is the median angle of a slow joint whose muscle is empty, or full, where that was seen.
    """
    joints, steps = len(range_), max(2, round(_STRETCH / period))
    spreads, pressures = Quantiles(joints), Quantiles(joints)
    for block in blocks():
        _, spread, pressure = _stretches(block, steps)
        spreads.add(spread)
        pressures.add(pressure)
    if not spreads.total:
        return range_
    slow, (low, high) = spreads([_SLOW])[0], pressures(_FULLEST)
    near = _END * (high - low)
    stood = [[Quantiles(1), Quantiles(1)] for _ in range(joints)]
    for block in blocks():
        angle, spread, pressure = _stretches(block, steps)
        for joint, ends in enumerate(stood):
            still, now = spread[:, joint] <= slow[joint], pressure[:, joint]
            for end, there in zip(
                ends, (now <= low[joint] + near[joint], now >= high[joint] - near[joint]), strict=True
            ):
                end.add(angle[still & there, joint][:, None])
    held = np.array(range_, np.float64)
    for joint, ends in enumerate(stood):
        lowest, highest = (float(end([0.5])[0, 0]) if end.total >= _ENOUGH else np.nan for end in ends)
        held[joint] = np.fmax(held[joint, 0], lowest), np.fmin(held[joint, 1], highest)
    return np.where((held[:, :1] < held[:, 1:]), held, range_)


def _stretches(block: Rows, steps: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return angles after ``steps``, how far apart those since then are, and pressures of muscle 1, (n, joints)."""
    if len(block) <= steps:
        none = np.zeros((0, block.angle.shape[1]))
        return none, none, none
    joined = (block.sequence[steps:] == block.sequence[:-steps]) & (block.step[steps:] - block.step[:-steps] == steps)
    angle = np.asarray(block.angle, np.float64)
    spread = np.ptp(np.lib.stride_tricks.sliding_window_view(angle, steps + 1, axis=0), axis=-1)
    return angle[steps:][joined], spread[joined], np.asarray(block.pressure[steps:, :, 0], np.float64)[joined]


def _moved(block: Rows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far the joints moved in each step and where they were after it, both (n, joints) [counts]."""
    following = (np.diff(block.sequence) == 0) & (np.diff(block.step) == 1)
    angle = np.asarray(block.angle, np.float64)
    return np.abs(np.diff(angle, axis=0))[following], angle[1:][following]
