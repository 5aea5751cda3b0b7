"""The board's clock on the host's: unwrapped, and mapped by what is known of when its readings were made."""

from collections import deque
from typing import NamedTuple

WRAP = 1 << 32
"""The board's clock begins again after so many microseconds, 71.6 minutes."""
STRETCH = 1.0
"""Of the exchanges of a stretch [s] the quickest is kept: its reading is known best."""
STRETCHES = 30
"""So many stretches tell the rate: a ceramic resonator is off by up to 0.5 %, and drifts with its temperature."""
SURELY = 1e-4
"""No exchange is taken to be known better than if it had taken so long [s]."""
MOST_OFF = 0.02
"""No clock is taken to be wrong by more than this share."""


class _Exchange(NamedTuple):
    board: float
    """Unwrapped time of the reading [s]."""
    host: float
    """Middle between sending and receiving [s]."""
    round_trip: float
    """[s]"""


class BoardClock:
    """Maps times of the board to times of the host, from exchanges of which both are known.

    The reading of an exchange was made between sending the request and receiving the reply; the quicker the
    exchange, the better its time is known. A straight line through the quickest of each second gives rate and
    offset, each weighing by its quickness. Mapped times never go back.
    """

    def __init__(self) -> None:
        self._kept: deque[_Exchange] = deque(maxlen=STRETCHES)
        self._last: float | None = None
        self.rate = 1.0
        """Seconds of the host per second of the board."""
        self._origin = (0.0, 0.0)

    def map(self, raw: int, sent: float, received: float) -> float:
        """Return the host's time [s] of a reading made at ``raw`` [us] in an exchange between two host times [s]."""
        board = self._unwrapped(raw, received)
        self._keep(_Exchange(board, (sent + received) / 2, received - sent))
        mapped = self._origin[1] + self.rate * (board - self._origin[0])
        mapped = min(max(mapped, sent), received)  # it was made then, whatever the line says
        if self._last is not None:
            mapped = max(mapped, self._last)
        self._last = mapped
        return mapped

    def _unwrapped(self, raw: int, received: float) -> float:
        """Return the board's time [s] with the number of wraps that fits best to the host's clock.

        In a pause of hours it wraps several times; the host's clock tells how often, for it is wrong by far less
        than half a wrap.
        """
        time = 1e-6 * raw
        if self._kept:
            predicted = self._origin[0] + (received - self._origin[1]) / self.rate
            time += 1e-6 * WRAP * round((predicted - time) / (1e-6 * WRAP))
        return time

    def _keep(self, exchange: _Exchange) -> None:
        kept = self._kept
        if not kept or exchange.host // STRETCH > kept[-1].host // STRETCH:
            kept.append(exchange)
        elif exchange.round_trip <= kept[-1].round_trip:
            kept[-1] = exchange
        else:
            return
        # The middle is wrong by up to half a round trip: each weighs as much as it is known.
        weights = [1 / max(e.round_trip, SURELY) ** 2 for e in kept]
        total = sum(weights)
        board = sum(w * e.board for w, e in zip(weights, kept, strict=True)) / total
        host = sum(w * e.host for w, e in zip(weights, kept, strict=True)) / total
        spread = sum(w * (e.board - board) ** 2 for w, e in zip(weights, kept, strict=True)) / total
        together = sum(w * (e.board - board) * (e.host - host) for w, e in zip(weights, kept, strict=True))
        rate = together / total / spread if spread > STRETCH**2 / 64 else 1.0
        self.rate = min(max(rate, 1 - MOST_OFF), 1 + MOST_OFF)
        self._origin = (board, host)
