"""Whether a joint that swings about its goal is left alone or goes on being damped: what was seen to be nearer.

Where an arm has more lag than its simulation, a policy that is to damp a joint pumps it, and closed valves are what
lets it come to rest. A heavy joint whose policy does damp it is kept from rest by that, and stirred again by every
pulse that follows. No simulation tells the two apart, but the arm does: by how far from its goal the joint is on
average while it is treated one way and the other.
"""

_TRIED = 1.0  # s that one way is tried for
_BEFORE = 0.5  # share of it that may be owed to what was before
_HOPED = 0.7  # tolerances off on average: what is hoped of a way that was not tried, or long ago
_MOST = 5.0  # tolerances of an error that count
_LEARNED, _FORGOTTEN = 0.3, 0.02  # share of what is known of a way that a try of it replaces, and one of the other


class Swinging:
    """What is known of a joint that swings; it is kept from movement to movement."""

    def __init__(self, period: float) -> None:
        self._off = [0.0, _HOPED]  # mean errors [tolerances] where it is left alone, and where it is damped
        self._turns = max(4, round(_TRIED / period))
        self._errors: list[float] = []

    @property
    def damps(self) -> bool:
        """Whether it goes on being damped."""
        return bool(self._off[True] < self._off[False])

    @property
    def is_tried(self) -> bool:
        """Whether errors are being noted: once begun, also while the joint is thrown far from its goal."""
        return bool(self._errors)

    def see(self, error: float) -> None:
        """Note the ``error`` [tolerances] of a joint that swings, or has swung on its way to this goal."""
        self._errors.append(min(abs(error), _MOST))
        if len(self._errors) == self._turns:
            late = self._errors[round(_BEFORE * self._turns) :]
            way, mean = self.damps, sum(late) / len(late)
            self._off[way] += _LEARNED * (mean - self._off[way])
            self._off[not way] += _FORGOTTEN * (_HOPED - self._off[not way])
            self.leave()

    def leave(self) -> None:
        """Note that it has another goal: what was begun to be noted says nothing."""
        self._errors.clear()
