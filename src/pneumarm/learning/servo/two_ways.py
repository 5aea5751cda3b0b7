"""Which of two ways of treating a joint keeps it nearer to its goal: what was seen of both on this arm.

No simulation tells which it is, but the arm does: by how far from its goal the joint is on average while it is
treated one way and the other. The first way is what is done before anything is known. The second is tried where the
first leaves the joint further off than is hoped of the second.
"""

from collections.abc import Sequence

_TRIED = 1.0  # s that one way is tried for
_BEFORE = 0.5  # share of it that may be owed to what was before
_LEARNED = 0.3  # share of what is known of a way that a try of it replaces ...
_FORGOTTEN = 0.02  # ... and one of the other


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
        self._hoped, self._most, self._learned = hoped, most, learned
        self._off = list(known) or [0.0, hoped]
        self._turns = max(4, round(_TRIED / period))
        self._errors: list[float] = []

    @property
    def known(self) -> tuple[float, ...]:
        """Mean errors of both ways [tolerances]."""
        return tuple(self._off)

    @property
    def second(self) -> bool:
        """Whether the second way is the better one."""
        return bool(self._off[True] < self._off[False])

    @property
    def is_tried(self) -> bool:
        """Whether errors are being noted: once begun, also while the joint is thrown far from its goal."""
        return bool(self._errors)

    def see(self, error: float) -> None:
        """Note the ``error`` [tolerances] of a joint that is treated in the better way."""
        self._errors.append(min(abs(error), self._most))
        if len(self._errors) == self._turns:
            late = self._errors[round(_BEFORE * self._turns) :]
            way, mean = self.second, sum(late) / len(late)
            self._off[way] += self._learned * (mean - self._off[way])
            self._off[not way] += _FORGOTTEN * (self._hoped - self._off[not way])
            self.leave()

    def leave(self) -> None:
        """Note that it has another goal: what was begun to be noted says nothing."""
        self._errors.clear()
