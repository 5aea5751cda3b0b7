"""Begin states of episodes: states of the arm at rest, taken from what was recorded (section 4.3.2)."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.kernels import part
from pneumarm.random import integer, uniform
from pneumarm.simulation.kernel import scaled_state
from pneumarm.simulation.simulation import Scaling
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Window, memories, observations

_STILL = 2.0  # counts of the thesis' sensors; readings of an arm at rest differ by so much
_LEAST = 1.0  # count of any sensor, as which noise is seen where counts are coarse
_TRIES = 32  # draws until the farthest sub-intervals count as empty


@dataclass(frozen=True)
class BeginStates:
    """Resting states with closed valves."""

    window: Window
    states: NDArray[np.float32]
    """Scaled state windows, shape (n, state_size)."""
    angle: NDArray[np.float64]
    """Their angles, shape (n, joints) [counts]."""

    def __len__(self) -> int:
        return len(self.states)


def begin_states(rows: Rows | Iterable[Rows], window: Window, scaling: Scaling, spec: ArmSpec) -> BeginStates:
    """Return the resting states in ``rows``, one block or a stream of blocks of whole sequences.

    At rest are the first rows of sequences that began so, and the windows within sequences in which all valves
    were closed and neither an angle nor a pressure differed by more than two counts would on the thesis' arm: by
    0.18 degrees and 0.012 bar, or by one count where that is more.

    Raises:
        UnusableInput: there is none.

    """
    found = [_resting(block, window, spec) for block in ([rows] if isinstance(rows, Rows) else rows)]
    sigma = np.concatenate(found) if found else np.zeros((0, window.state_size))
    if len(sigma) == 0:
        raise UnusableInput(
            "no state at rest with closed valves among the transitions, but episodes begin at rest; "
            "collect sequences that begin at rest"
        )
    sigma = sigma[np.argsort(sigma[:, 0], kind="stable")]
    angle = np.ascontiguousarray(sigma[:, 0 : window.joint_size : 4])
    return BeginStates(window, scaled_state(sigma, window, scaling), angle)


def _resting(rows: Rows, window: Window, spec: ArmSpec) -> NDArray[np.float64]:
    """Return the windows (m, state_size) of the resting states in one block, in sensor units."""
    h, observed = window.history, observations(rows, window)
    began = np.flatnonzero(rows.at_rest & (rows.step == 0))
    memory = memories(rows, window)
    parts = [_window([observed[began]] * h, memory[began], window)]
    if len(rows) > h:
        k = np.arange(h, len(rows))
        lags = k[:, None] - np.arange(h + 1)  # the oldest velocity needs one row more
        joined = (rows.sequence[lags[:, -1]] == rows.sequence[k]) & (rows.step[k] - rows.step[lags[:, -1]] == h)
        closed = (rows.command[lags[:, 1:]] == 0).all(axis=(1, 2, 3))
        still = np.ones(len(k), bool)
        for values, unit in (
            (rows.angle, spec.angle_unit),
            (rows.pressure.reshape(len(rows), -1), spec.pressure_unit),
        ):
            still &= (np.ptp(values[lags], axis=1) <= max(_STILL * unit, _LEAST)).all(axis=1)
        k = k[joined & closed & still]
        parts.append(_window([observed[k - lag] for lag in range(h)], memory[k], window))
    return np.concatenate(parts)


def _window(
    newest_first: list[NDArray[np.float64]], memory: NDArray[np.float64], window: Window
) -> NDArray[np.float64]:
    closed = np.zeros((len(memory), (window.history - 1) * window.command_size))
    return np.concatenate([*newest_first, closed, memory], axis=1)


class BeginParameters(NamedTuple):
    """Begin states as a kernel draws from them. Made by :func:`begin_parameters`."""

    states: NDArray[np.float32]
    """Shape (n, state_size) [scaled]."""
    angle: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    order: NDArray[np.int64]
    """Indices of the states by the angle of each joint, shape (joints, n)."""
    sorted: NDArray[np.float64]
    """The angles in this order, shape (joints, n) [counts]."""
    domain: NDArray[np.float64]
    """Lowest and highest angle of the sensor, shape (2,) [counts]."""
    weights: NDArray[np.float64]
    """Cumulative probabilities of the sub-intervals of a side, the farthest first, shape (bins,)."""
    by_length: bool
    """Whether sides are drawn by the lengths that the deviation leaves them."""
    shares: NDArray[np.float64]
    """What of the deviation each joint has, shape (joints,)."""


def begin_parameters(
    begin: BeginStates, domain: tuple[float, float], weights: tuple[float, ...] = (1.0,), by_length: bool = False
) -> BeginParameters:
    """Return ``begin`` for a kernel; ``weights`` are those of :class:`~pneumarm.learning.online.settings.Shaping`."""
    cumulative = np.cumsum(weights) / np.sum(weights)
    order = np.ascontiguousarray(np.argsort(begin.angle, axis=0, kind="stable").T)
    sorted_ = np.take_along_axis(begin.angle.T, order, axis=1)
    ends = np.array(domain, np.float64)
    return BeginParameters(
        begin.states, begin.angle, order, sorted_, ends, cumulative, by_length, np.ones(len(order))
    )


@part
def side_probability(goal, domain):  # type: ignore[no-untyped-def]
    """Return the probability of a begin state below ``goal`` in the ``domain`` of angles (thesis eq. 4.15, 4.16).

    ratio / (ratio + 1) with ratio = theta_g / (1023 - theta_g) is the share of the domain below the goal.
    """
    return (goal - domain[0]) / (domain[1] - domain[0])


@part
def draw_interval(domain, weights, goal, deviation, random):  # type: ignore[no-untyped-def]
    """Return a sub-interval of begin angles of a joint around its ``goal``, as its ends [counts] (section 4.3.2).

    Each side reaches as far as ``deviation`` and the ``domain`` of angles allow and is cut into equal parts, which
    are drawn by their cumulative ``weights`` (table 4.1).
    """
    is_below = uniform(random) < side_probability(goal, domain)
    draw, bins = uniform(random), weights.shape[0]
    bin_ = 0
    while bin_ < bins - 1 and draw >= weights[bin_]:
        bin_ += 1
    far, near = 1.0 - bin_ / bins, 1.0 - (bin_ + 1) / bins
    if is_below:
        side = max(domain[0], goal - deviation) - goal
        return goal + far * side, goal + near * side
    side = min(domain[1], goal + deviation) - goal
    return goal + near * side, goal + far * side


@part(entry=True)
def draw_goal_near(goal_range, weights, angle, deviation, random, goal):  # type: ignore[no-untyped-def]
    """Put a goal near to where the arm stands, at ``angle`` (joints,), into ``goal`` (joints,) (section 4.3.3).

    It lies in ``goal_range`` (joints, 2) and, if the arm does, within ``deviation``, all in [counts].
    """
    for joint in range(goal.shape[0]):
        here = min(max(angle[joint], goal_range[joint, 0]), goal_range[joint, 1])
        first, last = draw_interval(goal_range[joint], weights, here, deviation, random)
        goal[joint] = first + (last - first) * uniform(random)


@part
def draw_begin(begin, goal, deviation, random):  # type: ignore[no-untyped-def]
    """Return the index of a begin state for ``goal`` (joints,) within ``deviation`` [counts].

    The angle of one joint, of several a random one, lies in a drawn sub-interval, those of the others anywhere within
    the deviation. Where nothing was recorded another draw is made; where that fails time and again the state nearest
    to the goal is taken (the thesis does not say). With an infinite deviation all begin states are equally likely.
    """
    if deviation == np.inf:
        return integer(random, begin.states.shape[0])
    for _ in range(_TRIES):
        joint = integer(random, goal.shape[0]) if goal.shape[0] > 1 else 0
        lowest, highest, most = begin.domain[0], begin.domain[1], deviation * begin.shares[joint]
        if begin.by_length:
            lowest, highest = max(lowest, goal[joint] - most), min(highest, goal[joint] + most)
        low, high = draw_interval((lowest, highest), begin.weights, goal[joint], most, random)
        first = count_below(begin.sorted[joint], low)
        count = count_below(begin.sorted[joint], high) - first
        if count > 0:
            index = begin.order[joint, first + integer(random, count)]
            if distance(begin.angle[index], goal, begin.shares) <= deviation:
                return index
    nearest = 0
    for index in range(1, begin.states.shape[0]):
        if distance(begin.angle[index], goal, begin.shares) < distance(begin.angle[nearest], goal, begin.shares):
            nearest = index
    return nearest


@part
def distance(angle, goal, shares):  # type: ignore[no-untyped-def]
    """Return the largest difference of ``angle`` and ``goal`` over the joints (thesis eq. 4.13) [counts].

    That of a joint counts the more, the smaller its share of the deviation is (section 6.1.3).
    """
    largest = 0.0
    for joint in range(goal.shape[0]):
        largest = max(largest, abs(angle[joint] - goal[joint]) / shares[joint])
    return largest


@part
def count_below(sorted_, value):  # type: ignore[no-untyped-def]
    """Return how many of ``sorted_`` (n,) are below ``value``."""
    first, last = 0, sorted_.shape[0]
    while first < last:
        middle = (first + last) // 2
        if sorted_[middle] < value:
            first = middle + 1
        else:
            last = middle
    return first
