"""What a bad line does to frames."""

import random

from cobs import cobs

from tests.firmware import wire


def mutated(frame: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """Return ``frame`` with bits turned, bytes changed, lost, inserted, swapped, or mixed with another frame."""
    data = bytearray(frame)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kind = rng.randrange(8)
        at = rng.randrange(len(data)) if data else 0
        if kind == 0:
            for _ in range(rng.randint(1, 4)):
                if data:
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif kind == 1 and data:
            data[at] = rng.randrange(256)
        elif kind == 2:
            data[at:at] = rng.randbytes(rng.randint(1, 4))
        elif kind == 3:
            del data[at : at + rng.randint(1, 4)]
        elif kind == 4:
            del data[at:]
        elif kind == 5 and data:
            data[at], data[-1 - at] = data[-1 - at], data[at]
        elif kind == 6:
            data[at:] = rng.choice(others)[at:]
        else:
            data[at:at] = rng.choice(others)[: rng.randint(1, 8)]
    return bytes(data)


def fits(chunk: bytes) -> bytes | None:
    """Return what lies between two 0x00, decoded, where a request has its type and length, whatever its CRC."""
    try:
        decoded = bytes(cobs.decode(chunk))
    except cobs.DecodeError:
        return None
    name = next((name for name, number in wire.REQUEST.items() if decoded[:1] == bytes([number])), None)
    return decoded if name is not None and len(decoded) == 5 + wire.layout(name).size else None


def is_request(chunk: bytes) -> bytes | None:
    """Return the content of what lies between two 0x00 where it is a request; judged by other people's COBS."""
    decoded = fits(chunk)
    if decoded is None or len(chunk) >= wire.CONSTANT["LONGEST_FRAME"]:
        return None
    content, crc = decoded[:-2], int.from_bytes(decoded[-2:], "little")
    return content if wire.crc(content) == crc and wire.is_said_twice(content) else None


def random_request(rng: random.Random, sequence: int) -> bytes:
    """Return the frame of any request, its values at random."""
    name = rng.choice(list(wire.REQUEST))
    return wire.enclosed(
        bytes([wire.REQUEST[name]]) + (sequence & 0xFFFF).to_bytes(2, "little") + any_payload(name, rng)
    )


def any_payload(name: str, rng: random.Random) -> bytes:
    """Return any payload of a request or reply that may be in a frame."""
    payload = rng.randbytes(wire.layout(name).size)
    if name == "EXCHANGE":
        return bytes(wire.twice(payload[0]))
    return payload[:-2] + wire.summed(payload[:-2]) if name == "PULSE" else payload
