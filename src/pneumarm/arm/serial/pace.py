"""When to ask again, and when to give a link up: learned from how it answered so far."""

import math

SHORTEST = 1e-3
"""No attempt is waited for less long [s]: so long a request and its reply are on the line."""
MARGIN = 1.25
"""An attempt is waited for at least so many times the smoothed round trip."""
SOONEST = 0.03
"""No link is given up sooner [s], however short the period is: a computer is busy elsewhere for 10 ms at times."""
SURE = 1e-6
"""A link is given up when a living one would be so silent with this probability."""
FEWEST = 3
"""... but never after fewer attempts: a host that was stopped itself has not listened."""
_MEAN, _DEVIATION = 1 / 8, 1 / 4
"""Weights of a new round trip in their means (Jacobson, Congestion avoidance and control, 1988)."""
_REMEMBERED = 64.0
"""Attempts of which the share of answered ones is taken."""
_FORGETS = 0.999
"""The slowest answer weighs less after each request by this factor."""


class Pace:
    """How long to wait for an answer before asking again, and when to stop asking.

    *Asking again*: after the smoothed round trip and four mean deviations, or :data:`MARGIN` times the round trip,
    between :data:`SHORTEST` and a third of the control period, so that at least two more attempts fit into a period
    and, on a line that answers within a millisecond or two, as many as there is time for.

    *Giving up*: as soon as k attempts without an answer are less likely than :data:`SURE` on this link,
    ``(1 - p)^k`` with p the share of attempts that it answered lately; but not before most of a period has passed,
    nor before thrice the time of its slowest answer lately. A healthy link that falls silent is so given up within
    two periods, a bad one is kept for longer.

    Args:
        period: control period [s].

    """

    def __init__(self, period: float) -> None:
        self._longest = max(period / 3, SHORTEST)
        self._patience = max(0.9 * period, SOONEST)
        self._round_trip: float | None = None
        self._deviation = 0.0
        self._slowest = 0.0
        self._attempts = self._answered = 0.0

    @property
    def timeout(self) -> float:
        """Time after which to ask again [s]."""
        if self._round_trip is None:
            return self._longest
        timeout = max(self._round_trip + 4 * self._deviation, MARGIN * self._round_trip, SHORTEST)
        return min(timeout, self._longest)

    @property
    def share(self) -> float:
        """Estimated share of attempts that are answered."""
        return (self._answered + 1) / (self._attempts + 2)

    def answered(self, round_trip: float, took: float, attempts: int) -> None:
        """Learn from an answer, ``round_trip`` [s] after its attempt and ``took`` [s] after the first of them all."""
        if round_trip <= self._longest:  # nobody would wait for one that is slower
            self._learn(round_trip)
        self._slowest = max(took, _FORGETS * self._slowest)
        kept = max(1 - attempts / _REMEMBERED, 0.0)
        self._attempts = kept * self._attempts + attempts
        self._answered = kept * self._answered + 1

    def _learn(self, round_trip: float) -> None:
        if self._round_trip is None:
            self._round_trip, self._deviation = round_trip, round_trip / 2
        error = round_trip - self._round_trip
        self._round_trip += _MEAN * error
        self._deviation += _DEVIATION * (abs(error) - self._deviation)

    def hopeless(self, silence: float, attempts: int) -> bool:
        """Return whether a link is gone that gave no answer to ``attempts`` in a ``silence`` [s]."""
        if attempts < FEWEST or silence < max(self._patience, 3 * self._slowest):
            return False
        return attempts * math.log1p(-self.share) < math.log(SURE)
