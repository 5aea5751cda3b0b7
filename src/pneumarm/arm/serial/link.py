"""One request at a time over a line: sent again until it is answered, and given up when the controller is gone."""

from dataclasses import dataclass
from typing import NamedTuple

from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.protocol import DEAD_MAN_MS, REPLIES, SEQUENCES, Frame, Request, Splitter, encode
from pneumarm.errors import ArmFailure

GIVE_UP = DEAD_MAN_MS / 1e3
"""Silence after which a link is lost [s]: by then the controller has vented the arm by itself."""
SHORTEST_TIMEOUT = 0.004
"""A request is never sent again sooner [s]: a reply takes 1 to 2 ms."""


@dataclass
class LinkCounts:
    """What happened on a link so far."""

    requests: int = 0
    """Requests answered."""
    retries: int = 0
    """Requests sent again, because no answer came."""
    silences: int = 0
    """Requests that went without an answer for two control periods."""
    foreign: int = 0
    """Replies to something else than what was asked: late, or doubled."""
    corrupt: int = 0
    """Frames that could not be taken."""


class Answer(NamedTuple):
    """A reply, and the host's times [s] around it."""

    frame: Frame
    sent: float
    received: float


class Link:
    """Asks a controller, one request under way.

    A request that is not answered in time is sent again with the same sequence: the controller does not act on it
    twice. Replies of another sequence are dropped. A line that fails, or a controller that is silent for
    :data:`GIVE_UP`, makes the link ``lost``: nothing more is sent until :meth:`begin`.

    Args:
        line: carries the bytes.
        period: control period [s]; a request is sent again within it.
        name: what messages call the arm.
        sequence: the number of the last request before the first one.

    """

    def __init__(self, line: Line, period: float, name: str, sequence: int = 0) -> None:
        self.line = line
        self.counts = LinkCounts()
        self.lost: str | None = None
        """Why nothing can be asked any more; None while all is well."""
        self._timeout = max(0.4 * period, SHORTEST_TIMEOUT)
        self._silence = 2 * period
        self._name = name
        self._sequence = sequence
        self._splitter = Splitter()

    def begin(self) -> None:
        """Take the link up again after it was lost; CONNECT comes next."""
        self.lost = None

    def ask(self, request: Request, *values: int, give_up: float = GIVE_UP) -> Answer:
        """Return the answer to ``request``.

        Raises:
            ArmFailure: the line fails, or nothing is heard for ``give_up`` [s].

        """
        if self.lost is not None:
            raise ArmFailure(f"{self._name}: {self.lost}; connect it again before anything else")
        self._sequence = (self._sequence + 1) % SEQUENCES
        frame = encode(request, self._sequence, *values)
        try:
            return self._ask(frame, give_up)
        except OSError as error:
            raise self._lose(f"the line to the controller is gone ({error})") from error
        finally:
            self.counts.corrupt = self._splitter.corrupt

    def _ask(self, frame: bytes, give_up: float) -> Answer:
        begun = sent = self.line.now()
        self.line.write(frame)
        silent = False
        while True:
            now = self.line.now()
            if not silent and now - begun >= self._silence:
                silent = True
                self.counts.silences += 1
            if now - begun >= give_up:
                raise self._lose(f"the controller has not answered for {now - begun:.2f} s")
            if now - sent >= self._timeout:
                self.counts.retries += 1
                sent = now
                self.line.write(frame)
            data = self.line.read(max(min(sent + self._timeout, begun + give_up) - now, 0.0))
            received = self.line.now()
            answer = None
            for reply in self._splitter.feed(data):
                if reply.kind in REPLIES and reply.sequence == self._sequence and answer is None:
                    answer = Answer(reply, sent, received)
                else:
                    self.counts.foreign += 1
            if answer is not None:
                self.counts.requests += 1
                return answer

    def _lose(self, why: str) -> ArmFailure:
        self.lost = why
        return ArmFailure(
            f"{self._name}: {why}; it vents all muscles by itself after {GIVE_UP:g} s. Look at plug and power"
        )
