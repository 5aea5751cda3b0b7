"""The protocol between host and microcontroller: what ``firmware/PROTOCOL.md`` says, as numbers and frames.

A frame is ``COBS(type u8, sequence u16, payload, crc u16) 0x00``; see the page for what each part is for.
"""

import struct
from binascii import crc_hqx
from collections.abc import Iterator
from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

VERSION = 3
OLDEST_VERSION = 2
BAUD = 500_000
JOINTS = 2
MUSCLES = 4
EXTRAS = 2
DEAD_MAN_MS = 250
OVER_PRESSURE_SAMPLES = 3
WATCHDOG_MS = 120
VELOCITY_SCALE = 64
MOST_VELOCITY_MS = 32
LONGEST_FRAME = 64
PULSE_UNIT_US = 8
LONGEST_PULSE = 31_250
HOLD = 0xFFFF

SEQUENCES = 1 << 16
"""Sequence numbers before they begin again."""
NEWEST_AHEAD = SEQUENCES // 2 - 1
"""A request so far ahead of the last accepted one, or less, is fresh."""
PULSES_SINCE = 3
"""Version of the protocol from which on a board times pulses."""
HIGHEST_COUNT = 1023
"""Of the 10-bit converter."""


class Request(IntEnum):
    """What the host asks for."""

    CONNECT = 0x01
    CONFIGURE = 0x02
    ARM = 0x03
    DISARM = 0x04
    EXCHANGE = 0x05
    READ = 0x06
    PULSE = 0x07


class Reply(IntEnum):
    """What the board answers."""

    HELLO = 0x81
    STATUS = 0x82
    READING = 0x85
    REFUSED = 0xFF


class Code(IntEnum):
    """Two bits for the valves of a muscle."""

    CLOSED = 0
    IN = 1
    OUT = 2


class Flag(IntFlag):
    """The board's state."""

    ARMED = 0x0001
    CONFIGURED = 0x0002
    REPEATED = 0x0004
    DEAD_MAN = 0x0008
    CONVERTER = 0x0010
    STALE_SEEN = 0x0020
    CORRUPT_SEEN = 0x0040
    OVERRUN_SEEN = 0x0080
    OVER_PRESSURE_1 = 0x0100
    OVER_PRESSURE_2 = 0x0200
    OVER_PRESSURE_3 = 0x0400
    OVER_PRESSURE_4 = 0x0800


OVER_PRESSURE = (Flag.OVER_PRESSURE_1, Flag.OVER_PRESSURE_2, Flag.OVER_PRESSURE_3, Flag.OVER_PRESSURE_4)
"""The latch of each muscle."""
ANY_OVER_PRESSURE = Flag(sum(OVER_PRESSURE))
LATCHES = Flag.DEAD_MAN | Flag.CONVERTER | ANY_OVER_PRESSURE


class Reason(IntEnum):
    """Why a request is refused."""

    NOT_CONNECTED = 1
    WRONG_VERSION = 2
    WRONG_SESSION = 3
    NOT_CONFIGURED = 4
    NOT_ARMED = 5
    STILL_ARMED = 6
    CAUSE_REMAINS = 7
    BAD_VALUE = 8


class Cause(IntFlag):
    """Why the board restarted."""

    POWER_ON = 1
    EXTERNAL = 2
    BROWN_OUT = 4
    WATCHDOG = 8


PAYLOAD: dict[int, struct.Struct] = {
    Request.CONNECT: struct.Struct("<BI"),
    Request.CONFIGURE: struct.Struct(f"<BB{MUSCLES}H"),
    Request.ARM: struct.Struct("<I"),
    Request.DISARM: struct.Struct("<"),
    Request.EXCHANGE: struct.Struct("<BB"),
    Request.READ: struct.Struct("<"),
    Request.PULSE: struct.Struct(f"<BB{MUSCLES}HH"),
    Reply.HELLO: struct.Struct("<BIIBH"),
    Reply.STATUS: struct.Struct("<IHB"),
    Reply.READING: struct.Struct(f"<IHB{JOINTS}H{MUSCLES}H{JOINTS}h{EXTRAS}H"),
    Reply.REFUSED: struct.Struct("<BHB"),
}
"""Layout of each payload."""
ANSWER = {
    Request.CONNECT: Reply.HELLO,
    Request.CONFIGURE: Reply.STATUS,
    Request.ARM: Reply.STATUS,
    Request.DISARM: Reply.STATUS,
    Request.EXCHANGE: Reply.READING,
    Request.READ: Reply.READING,
    Request.PULSE: Reply.READING,
}
"""The reply to each request that is not refused."""
REQUESTS = frozenset(map(int, Request))
REPLIES = frozenset(map(int, Reply))
_HEAD = struct.Struct("<BH")
_CRC = struct.Struct("<H")


class Frame(NamedTuple):
    """A frame taken apart."""

    kind: int
    sequence: int
    values: tuple[int, ...]


class Hello(NamedTuple):
    """Who answers, and why it restarted."""

    version: int
    firmware: int
    session: int
    reset_cause: int
    boots: int


class Status(NamedTuple):
    """State of the board."""

    time: int
    """Board's clock [us], 32 bits."""
    flags: int
    valves: int


class Sensors(NamedTuple):
    """The values of a READING, for all joints and muscles that the protocol provides for."""

    time: int
    """Board's clock at the sampling [us], 32 bits."""
    flags: int
    valves: int
    angle: tuple[int, ...]
    """[counts]"""
    pressure: tuple[int, ...]
    """[counts]"""
    velocity: tuple[int, ...]
    """[counts/ms] times VELOCITY_SCALE."""
    extra: tuple[int, ...]
    """[counts]"""

    @classmethod
    def of(cls, values: tuple[int, ...]) -> "Sensors":
        """Return the values of a READING by name."""
        a, p, v = 3 + JOINTS, 3 + JOINTS + MUSCLES, 3 + 2 * JOINTS + MUSCLES
        return cls(values[0], values[1], values[2], values[3:a], values[a:p], values[p:v], values[v:])

    def packed(self) -> tuple[int, ...]:
        """Return the values in the order of the frame."""
        return (*self[:3], *self.angle, *self.pressure, *self.velocity, *self.extra)


class Refused(NamedTuple):
    """A request that did nothing."""

    reason: int
    flags: int
    valves: int


def said_twice(valves: int) -> tuple[int, int]:
    """Return the values of an EXCHANGE that sets the byte ``valves``: itself and its complement."""
    return valves, valves ^ 0xFF


def summed(*values: int) -> tuple[int, ...]:
    """Return the values of a PULSE: number, valves, a length a muscle, and Fletcher's sum of them."""
    total = totals = 0
    for byte in PAYLOAD[Request.PULSE].pack(*values, 0)[:-2]:
        total += byte
        totals += total
    return (*values, total % 256 | totals % 256 << 8)


def _is_said_twice(kind: int, values: tuple[int, ...]) -> bool:
    """Return whether the ``values`` of a frame say twice what its ``kind`` has to."""
    if kind == Request.EXCHANGE:
        return values == said_twice(values[0])
    return kind != Request.PULSE or values == summed(*values[:-1])


def encode(kind: int, sequence: int, *values: int) -> bytes:
    """Return the frame of a request or reply, its 0x00 included."""
    content = _HEAD.pack(kind, sequence) + PAYLOAD[kind].pack(*values)
    return stuff(content + _CRC.pack(crc(content))) + b"\0"


def decode(frame: bytes) -> Frame | None:
    """Return what is in ``frame``, which came without its 0x00; None where it is not exactly a frame."""
    content = unstuff(frame)
    if content is None or len(content) < _HEAD.size + _CRC.size:
        return None
    layout = PAYLOAD.get(content[0])
    if layout is None or len(content) != _HEAD.size + layout.size + _CRC.size:
        return None
    if _CRC.unpack(content[-_CRC.size :])[0] != crc(content[: -_CRC.size]):
        return None
    kind, sequence = _HEAD.unpack_from(content)
    values = layout.unpack(content[_HEAD.size : -_CRC.size])
    return Frame(kind, sequence, values) if _is_said_twice(kind, values) else None


_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def crc(content: bytes) -> int:
    """Return CRC-16/X-25 of ``content``.

    It is the mirror image of the CRC that the standard library computes in C: bits are mirrored before and after.
    """
    mirrored = crc_hqx(content.translate(_MIRRORED), 0xFFFF)
    return (_MIRRORED[mirrored & 0xFF] << 8 | _MIRRORED[mirrored >> 8]) ^ 0xFFFF


def stuff(content: bytes) -> bytes:
    """Return ``content`` without zeros: each becomes the distance to the next (consistent overhead byte stuffing)."""
    stuffed = bytearray()
    for part in content.split(b"\0"):
        while len(part) >= 0xFE:
            stuffed += b"\xff" + part[:0xFE]
            part = part[0xFE:]
        stuffed += bytes([len(part) + 1]) + part
    if content and content[-1] and not part:
        del stuffed[-1]  # a full block at the very end needs no empty one after it
    return bytes(stuffed)


def unstuff(frame: bytes) -> bytes | None:
    """Return the content of ``frame``, which has no zeros; None where its distances do not fit."""
    content, place = bytearray(), 0
    while place < len(frame):
        end = place + frame[place]
        if frame[place] == 0 or end > len(frame):
            return None
        content += frame[place + 1 : end]
        if frame[place] != 0xFF and end < len(frame):
            content.append(0)
        place = end
    return bytes(content) if frame else None


class Splitter:
    """Finds the frames in a stream of bytes, however it was cut."""

    def __init__(self) -> None:
        self.corrupt = 0
        """Number of frames that could not be taken."""
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Frame]:
        """Yield the frames that ``data`` completes; what is longer than any frame is dropped up to the next 0x00."""
        *ended, rest = data.split(b"\0")
        for part in ended:
            whole = bytes(self._rest + part)
            self._rest.clear()
            if whole:
                frame = decode(whole) if len(whole) < LONGEST_FRAME else None
                if frame is None:
                    self.corrupt += 1
                else:
                    yield frame
        self._rest += rest[: max(LONGEST_FRAME - len(self._rest), 0)]


_OF_VALVE = {-1: Code.OUT, 0: Code.CLOSED, 1: Code.IN}
_TO_VALVE = {int(code): valve for valve, code in _OF_VALVE.items()}


def pack_valves(valves: NDArray[np.int8]) -> int:
    """Return the byte of ``valves`` (joints, 2) of -1, 0, +1; muscles that are not there are closed."""
    return sum(_OF_VALVE[valve] << 2 * muscle for muscle, valve in enumerate(valves.ravel().tolist()))


def unpack_valves(packed: int, joints: int) -> NDArray[np.int8] | None:
    """Return the valves (joints, 2) in a byte, None where it holds a code that is none."""
    codes = [packed >> 2 * muscle & 3 for muscle in range(MUSCLES)]
    if any(code not in _TO_VALVE for code in codes):
        return None
    return np.array([_TO_VALVE[code] for code in codes[: 2 * joints]], np.int8).reshape(joints, 2)


def pulse_lengths(command: NDArray[np.float64], period: float) -> tuple[int, ...]:
    """Return for how long [PULSE_UNIT_US] each muscle's valve is to be open, HOLD where until the next command.

    Args:
        command: pulses (joints, 2), shares of the control period.
        period: the control period [s].

    """
    units = 1e6 * period / PULSE_UNIT_US
    shares = np.abs(command).ravel().tolist()
    lengths = [HOLD if share >= 1 else max(round(share * units), 1) if share else 0 for share in shares]
    return (*lengths, *[0] * (MUSCLES - len(lengths)))
