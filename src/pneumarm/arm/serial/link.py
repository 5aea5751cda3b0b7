"""One request at a time over a line: asked again until it is answered, and given up when the board is gone."""

import logging
from dataclasses import dataclass
from typing import NamedTuple

from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.pace import Pace
from pneumarm.arm.serial.protocol import ANSWER, DEAD_MAN_MS, SEQUENCES, Frame, Reply, Request, Splitter, encode
from pneumarm.errors import ArmFailure, LineLost

DEAD_MAN = DEAD_MAN_MS / 1e3
"""Time after which a board that hears nothing vents the arm by itself [s]."""
GIVE_UP = 0.9 * DEAD_MAN
"""Silence after which a link is lost [s]: just within the dead-man, which counts from the request before. Boards,
lines and computers are busy elsewhere for less; that is noticed after a control period, and counted."""
FEWEST = 3
"""... but never after fewer attempts: a host that was stopped itself has not listened."""
_log = logging.getLogger("pneumarm")
MOMENT = 1e-9
"""Times closer than this [s] are the same: a clock that is computed may end a step of its numbers early."""
ADVICE = f"it vents all muscles by itself after {DEAD_MAN:g} s. Look at plug and power"


@dataclass
class LinkCounts:
    """What happened on a link so far."""

    requests: int = 0
    """Requests answered."""
    retries: int = 0
    """Attempts besides the first of each request, because no answer came."""
    silences: int = 0
    """Requests that went without an answer for a control period or longer."""
    foreign: int = 0
    """Replies to something else than what was asked: late, or doubled."""
    corrupt: int = 0
    """Frames that could not be taken."""
    losses: int = 0
    """Times that the line was lost and the arm taken up again."""


class Answer(NamedTuple):
    """A reply, and the host's times [s] around it."""

    frame: Frame
    sent: float
    """When the very attempt was sent that it answers."""
    received: float


class Link:
    """Asks a board, one request under way.

    A request that is not answered in time is sent again, as a request of its own: with the next sequence. All
    requests say what shall be, none what shall be changed, so that doing one twice does no harm; and of each answer
    it is known which attempt it belongs to, and so when the board can have read, and that it fed the dead-man.
    The attempt before is stale from then on, in case it still comes; an answer to it is as good. Replies of other
    sequences are dropped.

    A board that is silent for a control period is counted, and told of the first time. A line that fails, or a board
    that is silent for :data:`GIVE_UP`, makes the link ``lost``: nothing more is sent until :meth:`begin`.

    Args:
        line: carries the bytes.
        period: control period [s].
        name: what messages call the arm.
        sequence: the number of the last request before the first one.

    """

    def __init__(self, line: Line, period: float, name: str, sequence: int = 0) -> None:
        self.line = line
        self.counts = LinkCounts()
        self.lost: str | None = None
        """Why nothing can be asked any more; None while all is well."""
        self.broken = False
        """Whether it is lost because the line itself failed, so that it has to be opened again."""
        self._failure: type[ArmFailure] = LineLost
        self._period = period
        self._name = name
        self._sequence = sequence
        self._pace = Pace(period)
        self._splitter = Splitter()

    def begin(self) -> None:
        """Take the link up again after it was lost; CONNECT comes next."""
        self.lost = None
        self.broken = False
        self._pace = Pace(self._period)

    def ask(self, request: Request, *values: int) -> Answer:
        """Return the answer to ``request``.

        Raises:
            LineLost: the line fails, or nothing is heard for too long.

        """
        return self._asked(request, values, None)

    def knock(self, request: Request, *values: int, wait: float) -> Answer:
        """Return the answer to ``request``, which is sent once and waited for for ``wait`` [s].

        Raises:
            LineLost: the line fails, or nothing is heard.

        """
        return self._asked(request, values, wait)

    def _asked(self, request: Request, values: tuple[int, ...], wait: float | None) -> Answer:
        if self.lost is not None:
            raise self._failure(f"{self._name}: {self.lost}")
        try:
            return self._ask(request, values, wait)
        except OSError as error:
            self.broken = True
            raise self.lose(f"the line to the board is gone ({error}); {ADVICE}") from error
        finally:
            self.counts.corrupt = self._splitter.corrupt

    def _ask(self, request: Request, values: tuple[int, ...], wait: float | None) -> Answer:
        sent: dict[int, float] = {}  # when each attempt was sent, by its sequence
        kinds = (ANSWER[request], Reply.REFUSED)
        begun = self.line.now()
        while True:
            self._sequence = (self._sequence + 1) % SEQUENCES
            asked = sent[self._sequence] = self.line.now()
            self.line.write(encode(request, self._sequence, *values))
            timeout = self._pace.timeout if wait is None else wait
            until, due = asked + timeout, begun + self._period
            if wait is None and asked < due - MOMENT < until:
                until = due  # no later is it noticed that the board is late
            answer = self._listen(kinds, sent, until)
            silence = self.line.now() - begun
            if wait is None and silence >= self._period - MOMENT > asked - begun:
                self._note_silence()
            if answer is not None:
                self.counts.requests += 1
                self._pace.answered(answer.received - answer.sent)
                return answer
            if wait is not None or (silence >= GIVE_UP and len(sent) >= FEWEST):
                raise self.lose(f"the board has not answered for {silence:.2f} s; {ADVICE}")
            self.counts.retries += 1

    def _listen(self, kinds: tuple[Reply, Reply], sent: dict[int, float], until: float) -> Answer | None:
        """Return the first answer of these ``kinds`` to an attempt ``sent``, None where none comes ``until`` [s]."""
        while True:
            data = self.line.read(max(until - self.line.now(), 0.0))
            received = self.line.now()
            answer = None
            for reply in self._splitter.feed(data):
                if answer is None and reply.kind in kinds and reply.sequence in sent:
                    answer = Answer(reply, sent[reply.sequence], received)
                else:
                    self.counts.foreign += 1
            if answer is not None or received >= until - MOMENT:
                return answer

    def _note_silence(self) -> None:
        """Count that the board is late; say so the first time, for it says nothing of that itself."""
        self.counts.silences += 1
        if self.counts.silences == 1:
            _log.warning("%s: the board is late, and asked again for up to %g s", self._name, GIVE_UP)

    def lose(self, why: str, failure: type[ArmFailure] = LineLost) -> ArmFailure:
        """Ask nothing more until :meth:`begin`, and return the ``failure`` to raise now and until then."""
        self.lost, self._failure = why, failure
        return failure(f"{self._name}: {why}")
