"""The host's side of the line to a chip, as small as a test wants it."""

from typing import Any

from tests.firmware import wire
from tests.firmware.chip import FREQUENCY, Chip
from tests.firmware.wire import CONSTANT, Reply

SESSION = 0x1234ABCD
LIMIT = 900
"""Limit of all pressures [counts] where a test names none."""
LONGEST_REPLY = 0.004
"""Time after which no reply comes any more [s]."""


class Host:
    """Sends requests with rising sequences; keeps the last reply's timing.

    Args:
        chip: the board; it has booted when this returns.

    """

    def __init__(self, chip: Chip) -> None:
        self.chip = chip
        self.sequence = 0
        self.number = 0
        """Of the last PULSE."""
        self.begun = 0
        """Cycle at which the first bit of the last request began."""
        self.ended = 0
        """Cycle at which the last bit of its reply had come."""
        self._rest = b""
        chip.run(0.005)
        chip.received()

    def send(self, data: bytes, wait: float = LONGEST_REPLY) -> list[Reply]:
        """Send bytes, wait [s], and return all replies that came."""
        self.begun = self.chip.cycle
        self.chip.write(data)
        self.chip.run(wait)
        came = self.chip.received()
        if came:
            self.ended = came[-1][0]
        *frames, self._rest = (self._rest + bytes(byte for _, byte in came)).split(b"\0")
        return [wire.reply(frame) for frame in frames if frame]  # zeros between frames mean nothing

    def forget(self) -> None:
        """Forget what came and was not taken apart, such as a reply that a reset broke off."""
        self.chip.received()
        self._rest = b""

    def ask(self, name: str, *values: int, sequence: int | None = None, wait: float = LONGEST_REPLY) -> Any:
        """Send a request, and return its reply, or None where none came: Any spares the tests a check each time."""
        if sequence is None:
            self.sequence = sequence = (self.sequence + 1) & 0xFFFF
        replies = self.send(wire.request(name, sequence, *values), wait)
        assert len(replies) <= 1, replies
        if replies:
            assert replies[0].sequence == sequence
        return replies[0] if replies else None

    def connect(self) -> Reply:
        """Begin the session."""
        return self.ask("CONNECT", CONSTANT["VERSION"], SESSION)

    def configure(self, conversions: int = 5, velocity_ms: int = 16, limit: int = LIMIT) -> Reply:
        """Set how to measure, and one limit for all muscles."""
        return self.ask("CONFIGURE", conversions, velocity_ms, *[limit] * CONSTANT["MUSCLES"])

    def arm(self) -> Reply:
        """Arm in the session that :meth:`connect` begins."""
        return self.ask("ARM", SESSION)

    def exchange(self, *codes: str, wait: float = LONGEST_REPLY) -> Reply:
        """Set the valves of the muscles named; those not named are closed."""
        return self.ask("EXCHANGE", wire.valves(*codes), wait=wait)

    def pulse(self, *pulses: tuple[str, int], number: int | None = None, wait: float = LONGEST_REPLY) -> Reply:
        """Open the muscles' valves, each for a length [PULSE_UNIT_US]; those not named are closed.

        It is a new command, unless a ``number`` says otherwise.
        """
        self.number = (self.number + 1) % 256 if number is None else number
        codes, lengths = zip(*pulses, strict=True)
        closed = [0] * (CONSTANT["MUSCLES"] - len(pulses))
        return self.ask("PULSE", self.number, wire.valves(*codes), *lengths, *closed, wait=wait)

    def ready(self, **configuration: int) -> "Host":
        """Connect, configure and arm."""
        assert self.connect().name == "HELLO"
        assert self.configure(**configuration).name == "STATUS"
        assert self.arm().has("ARMED")
        return self

    def since_begun(self, cycle: int) -> float:
        """Return the time [ms] from the last request's first bit to a cycle."""
        return 1e3 * (cycle - self.begun) / FREQUENCY
