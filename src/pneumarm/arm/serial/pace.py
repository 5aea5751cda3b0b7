"""When to ask again: learned from how a link answered so far."""

SHORTEST = 1e-3
"""No attempt is waited for less long [s]: so long a request and its reply are on the line."""
MARGIN = 1.25
"""An attempt is waited for at least so many times the smoothed round trip."""
_MEAN, _DEVIATION = 1 / 8, 1 / 4
"""Weights of a new round trip in their means (Jacobson, Congestion avoidance and control, 1988)."""


class Pace:
    """How long to wait for an answer before asking again.

    After the smoothed round trip and four mean deviations, or :data:`MARGIN` times the round trip, between
    :data:`SHORTEST` and a third of the control period, so that at least two more attempts fit into a period and, on a
    line that answers within a millisecond or two, as many as there is time for.

    Args:
        period: control period [s].

    """

    def __init__(self, period: float) -> None:
        self._longest = max(period / 3, SHORTEST)
        self._round_trip: float | None = None
        self._deviation = 0.0

    @property
    def timeout(self) -> float:
        """Time after which to ask again [s]."""
        if self._round_trip is None:
            return self._longest
        timeout = max(self._round_trip + 4 * self._deviation, MARGIN * self._round_trip, SHORTEST)
        return min(timeout, self._longest)

    def answered(self, round_trip: float) -> None:
        """Learn from an answer, ``round_trip`` [s] after its attempt."""
        if round_trip > self._longest:
            return  # nobody would wait for one that is slower
        if self._round_trip is None:
            self._round_trip, self._deviation = round_trip, round_trip / 2
        error = round_trip - self._round_trip
        self._round_trip += _MEAN * error
        self._deviation += _DEVIATION * (abs(error) - self._deviation)
