"""Which of two ways of treating a joint keeps it nearer to its goal: what was seen of both on this arm.

No simulation tells which it is, but the arm does: by how far from its goal the joint is on average while it is
treated one way and the other. The first way is what is done before anything is known. The second is tried where the
first leaves the joint further off than is hoped of the second.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.kernels import inner

_TRIED = 1.0  # s that one way is tried for
_BEFORE = 0.5  # share of it that may be owed to what was before
_LEARNED = 0.3  # share of what is known of a way that a try of it replaces ...
_FORGOTTEN = 0.02  # ... and one of the other


class WaysParameters(NamedTuple):
    """How two ways are compared, for kernels. Made by :func:`ways_parameters`."""

    hoped: float
    """Mean error that the second is hoped to have [tolerances]."""
    most: float
    """Most that an error counts [tolerances]."""
    learned: float
    """Share of what is known of a way that a try of it replaces."""
    forgotten: float
    """Share of what is known of the other way that it forgets."""
    turns: int
    """Control steps of a try, and the first of them that counts."""
    first: int


class Ways(NamedTuple):
    """What is known of both ways of several joints, and what was noted of the try under way."""

    off: NDArray[np.float64]
    """Mean errors, shape (joints, 2) [tolerances]."""
    total: NDArray[np.float64]
    """Sum of the errors that count, shape (joints,)."""
    seen: NDArray[np.int64]
    """Errors noted, shape (joints,)."""


def ways_parameters(period: float, hoped: float, most: float = 5.0, learned: float = _LEARNED) -> WaysParameters:
    """Return how two ways are compared at a control ``period`` [s]; the rest as of :class:`TwoWays`."""
    turns = max(4, round(_TRIED / period))
    return WaysParameters(hoped, most, learned, _FORGOTTEN, turns, round(_BEFORE * turns))


@inner
def is_second_better(ways, j):  # type: ignore[no-untyped-def]
    """Return whether the second way of joint ``j`` is the better one."""
    return ways.off[j, 1] < ways.off[j, 0]


@inner
def see_error(parameters, ways, j, error):  # type: ignore[no-untyped-def]
    """Note the ``error`` [tolerances] of joint ``j``, which is treated in the better way."""
    if ways.seen[j] >= parameters.first:
        ways.total[j] += min(abs(error), parameters.most)
    ways.seen[j] += 1
    if ways.seen[j] == parameters.turns:
        mean = ways.total[j] / float(parameters.turns - parameters.first)
        way = 1 if is_second_better(ways, j) else 0
        ways.off[j, way] += parameters.learned * (mean - ways.off[j, way])
        ways.off[j, 1 - way] += parameters.forgotten * (parameters.hoped - ways.off[j, 1 - way])
        end_try(ways, j)


@inner
def end_try(ways, j):  # type: ignore[no-untyped-def]
    """Forget the errors of joint ``j`` that were noted since the last try was over."""
    ways.total[j] = 0.0
    ways.seen[j] = 0


class TwoWays:
    """What is known of both ways; it is kept from movement to movement."""

    def __init__(
        self,
        period: float,
        hoped: float,
        known: Sequence[float] = (),
        most: float = 5.0,
        learned: float = _LEARNED,
    ) -> None:
        """Begin to learn, with a control ``period`` [s]; the second is ``hoped`` to be so many tolerances off.

        ``known`` is what was :attr:`known` before, if anything was; ``most`` tolerances of an error count at most. A
        try replaces the share ``learned`` of what is known of a way.
        """
        self._parameters = ways_parameters(period, hoped, most, learned)
        self._ways = ways_of([known], hoped)

    @property
    def known(self) -> tuple[float, ...]:
        """Mean errors of both ways [tolerances]."""
        return tuple(self._ways.off[0].tolist())

    @property
    def second(self) -> bool:
        """Whether the second way is the better one."""
        return bool(is_second_better(self._ways, 0))

    @property
    def is_tried(self) -> bool:
        """Whether errors are being noted: once begun, also while the joint is thrown far from its goal."""
        return bool(self._ways.seen[0])

    def see(self, error: float) -> None:
        """Note the ``error`` [tolerances] of a joint that is treated in the better way."""
        see_error(self._parameters, self._ways, 0, error)

    def leave(self) -> None:
        """Note that it has another goal: what was begun to be noted says nothing."""
        end_try(self._ways, 0)


def ways_of(known: Sequence[ArrayLike], hoped: float) -> Ways:
    """Return what is ``known`` of each joint; where it is nothing, the second way is ``hoped`` to be so far off."""
    off = np.array([one if np.size(one) else (0.0, hoped) for one in known], np.float64)
    return Ways(off, np.zeros(len(known)), np.zeros(len(known), np.int64))
