"""A host as the thesis' was at first: it takes what the driver gives, without headers or time stamps (A.1.4)."""

from dataclasses import replace

from pneumarm.arm.seam import ArmSpec, Reading
from pneumarm.arm.serial.arm import SerialArm
from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.link import Answer, Link
from pneumarm.arm.serial.protocol import SEQUENCES, Reply, Request, encode

_SOON = 0.004  # s; a controller answers within 2 ms


class HeadlessLink(Link):
    """A link that takes for the answer to READ whatever is in the buffer, and the last one where there is nothing.

    All other requests are asked as they should be: only readings show what the protocol is for.
    """

    repeated = 0
    """Readings for which the last ones were taken again."""
    _last: Answer | None = None

    def ask(self, request: Request, *values: int) -> Answer:
        """Return what came, or what came before."""
        if request is not Request.READ or self._last is None:
            answer = super().ask(request, *values)
            if request is Request.READ:
                self._last = answer
            return answer
        now = self.line.now()
        self._sequence = (self._sequence + 1) % SEQUENCES
        self.line.write(encode(request, self._sequence))
        came = [frame for frame in self._splitter.feed(self.line.read(_SOON)) if frame.kind == Reply.READING]
        if came:
            self._last = Answer(came[-1], now, self.line.now())
        else:
            self.repeated += 1
        return self._last


class HeadlessArm(SerialArm):
    """An arm behind a :class:`HeadlessLink`, whose readings are taken to be of the moment they are asked for."""

    def __init__(self, line: Line, spec: ArmSpec) -> None:
        super().__init__(line, spec)
        self.link: HeadlessLink = HeadlessLink(line, spec.period, spec.name)
        self.rearm()

    def read(self) -> Reading:
        """Return what came, or what came before, as if it were of now."""
        now = self._line.now()
        return replace(super().read(), time=now)
