"""The protocol as its page says it, and frames made from that with other people's COBS: an oracle for the firmware.

Nothing here comes from the firmware or from the package; all numbers are read from ``firmware/PROTOCOL.md``.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from cobs import cobs

from tests.firmware.build import FIRMWARE

Row = dict[str, str]


def _rows(lines: list[str]) -> Iterator[list[str]]:
    for line in lines:
        if line.startswith("|") and not set(line) <= set("|- "):
            yield [cell.strip() for cell in line.strip().strip("|").split("|")]


@cache
def tables() -> dict[str, list[Row]]:
    """Return the page's tables by the heading above them."""
    page = (FIRMWARE / "PROTOCOL.md").read_text(encoding="utf-8")
    found = {}
    for section in page.split("\n## ")[1:]:
        heading, *lines = section.split("\n")
        header, *rows = list(_rows(lines)) or [[]]
        if rows:
            found[heading] = [dict(zip(header, row, strict=True)) for row in rows]
    return found


@cache
def numbers(heading: str) -> dict[str, int]:
    """Return the column ``value`` or ``type`` of a table by name."""
    return {row["name"]: int(row.get("value") or row["type"], 0) for row in tables()[heading]}


CONSTANT = numbers("Constants")
REQUEST = numbers("Requests")
REPLY = numbers("Replies")
CODE = numbers("Valve codes")
FLAG = numbers("Flags")
REASON = numbers("Reasons of refusal")
CAUSE = numbers("Reset causes")
CYCLES_PER_BYTE = 10 * 16_000_000 // CONSTANT["BAUD"]


@cache
def fields(name: str) -> list[tuple[str, str, int]]:
    """Return the fields of a payload: name, letter of ``struct``, how many."""
    text = next(row["payload"] for kind in ("Requests", "Replies") for row in tables()[kind] if row["name"] == name)
    letters = {"u8": "B", "u16": "H", "u32": "I", "i16": "h"}
    found = re.findall(r"(\w+) ([ui]\d+)(?: x (\d+))?", text)
    return [(field, letters[kind], int(count or 1)) for field, kind, count in found]


@cache
def layout(name: str) -> struct.Struct:
    """Return the layout of a payload."""
    return struct.Struct("<" + "".join(f"{count}{letter}" for _, letter, count in fields(name)))


def _table() -> list[int]:
    values = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
        values.append(value)
    return values


_TABLE = _table()


def crc(data: bytes) -> int:
    """Return CRC-16/X-25."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _TABLE[(value ^ byte) & 0xFF]
    return value ^ 0xFFFF


def enclosed(content: bytes) -> bytes:
    """Return the frame of ``content``."""
    return bytes(cobs.encode(content + crc(content).to_bytes(2, "little"))) + b"\0"


def twice(codes: int) -> tuple[int, int]:
    """Return the payload of an EXCHANGE: the valves and all their bits turned."""
    return codes, codes ^ 0xFF


def summed(payload: bytes) -> bytes:
    """Return Fletcher's sum of the beginning of a PULSE's payload, as its last two bytes."""
    sums = [sum(payload[: i + 1]) for i in range(len(payload))]
    return bytes([sums[-1] % 256, sum(sums) % 256])


def is_said_twice(content: bytes) -> bool:
    """Return whether content of the right length says twice what it has to."""
    payload = content[3:]
    if content[0] == REQUEST["EXCHANGE"]:
        return tuple(payload) == twice(payload[0])
    return content[0] != REQUEST["PULSE"] or payload[-2:] == summed(payload[:-2])


def request(name: str, sequence: int, *values: int) -> bytes:
    """Return the frame of a request; an EXCHANGE's complement and a PULSE's sum are added where they are left out."""
    if name == "EXCHANGE" and len(values) == 1:
        values = twice(*values)
    if name == "PULSE" and len(values) == 2 + CONSTANT["MUSCLES"]:
        payload = layout(name).pack(*values, 0)[:-2]
        payload += summed(payload)
    else:
        payload = layout(name).pack(*values)
    return enclosed(struct.pack("<BH", REQUEST[name], sequence & 0xFFFF) + payload)


@dataclass(frozen=True)
class Reply:
    """A reply taken apart; its payload's fields are attributes, arrays as tuples."""

    name: str
    sequence: int
    values: dict[str, Any]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(f"{self.name} has no {name}") from None

    def has(self, flag: str) -> bool:
        """Return whether a flag is set."""
        return bool(self.values["flags"] & FLAG[flag])

    @property
    def why(self) -> str:
        """The name of a refusal's reason."""
        return next(name for name, value in REASON.items() if value == self.values["reason"])


def content_of(frame: bytes) -> bytes:
    """Return the content of a frame without its 0x00.

    Raises:
        ValueError: this is no frame.

    """
    try:
        decoded = bytes(cobs.decode(frame))
    except cobs.DecodeError as error:
        raise ValueError(str(error)) from error
    if len(decoded) < 5 or crc(decoded[:-2]) != int.from_bytes(decoded[-2:], "little"):
        raise ValueError("the CRC does not match")
    return decoded[:-2]


def reply(frame: bytes) -> Reply:
    """Take a reply apart, given without its 0x00.

    Raises:
        ValueError: this is no reply.

    """
    content = content_of(frame)
    kind, sequence = struct.unpack("<BH", content[:3])
    name = next((name for name, number in REPLY.items() if number == kind), None)
    if name is None or len(content) != 3 + layout(name).size:
        raise ValueError(f"no reply: {content.hex()}")
    values, unpacked = {}, list(layout(name).unpack(content[3:]))
    for field, _, count in fields(name):
        values[field] = unpacked.pop(0) if count == 1 else tuple(unpacked.pop(0) for _ in range(count))
    return Reply(name, sequence, values)


def valves(*codes: str) -> int:
    """Return the byte of valve codes, muscle 1 of joint 1 first; muscles not named are closed."""
    return sum(CODE[code] << 2 * muscle for muscle, code in enumerate(codes))


def pins_of(codes: int) -> int:
    """Return the levels of D4 to D11, bit 0 first, that a byte of valve codes stands for."""
    levels = {CODE["CLOSED"]: 0b10, CODE["IN"]: 0b11, CODE["OUT"]: 0b00}
    return sum(levels[codes >> 2 * muscle & 3] << 2 * muscle for muscle in range(CONSTANT["MUSCLES"]))


VENTED = valves(*["OUT"] * CONSTANT["MUSCLES"])
