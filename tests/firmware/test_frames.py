"""The firmware's decoder, compiled for this machine, against other people's COBS and CRC."""

import random
import shutil
from typing import NamedTuple

import pytest
from cobs import cobs
from crc import Calculator, Crc16
from hypothesis import given
from hypothesis import strategies as st

from tests.firmware import wire
from tests.firmware.decoder import CORRUPT, TAKEN, Frames
from tests.firmware.mutations import fits, is_request, mutated, random_request

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler on this machine")
X25 = Calculator(Crc16.X25)
LONGEST = wire.CONSTANT["LONGEST_FRAME"]


@pytest.fixture(scope="module")
def frames() -> Frames:
    return Frames()


def test_crc_of_the_catalogue(frames: Frames) -> None:
    assert frames.crc(b"123456789") == wire.crc(b"123456789") == 0x906E


@given(st.binary(max_size=200))
def test_crc_is_x25(data: bytes) -> None:
    assert Frames().crc(data) == wire.crc(data) == X25.checksum(data)


@given(st.binary(min_size=1, max_size=LONGEST - 4))
def test_sender_writes_cobs(content: bytes) -> None:
    frame = Frames().send(content)
    assert frame == wire.enclosed(content)
    assert frame.count(0) == 1


@given(st.lists(st.sampled_from([1, 2, 3, 7, 255]) | st.integers(1, 255), max_size=250).map(bytes))  # 0 ends frames
def test_cobs_decoder_agrees_also_on_what_is_none(data: bytes) -> None:
    try:
        expected = bytes(cobs.decode(data))
    except cobs.DecodeError:
        expected = b""
    assert Frames().cobs_decode(data) == expected


def agree(frames: Frames, stream: bytes) -> tuple[int, int]:
    """Feed a stream that ends with 0x00; return how many were taken and corrupt, having compared each."""
    *chunks, rest = stream.split(b"\0")
    assert rest == b""
    expected = [is_request(chunk) for chunk in chunks if chunk]
    found = list(frames.receive(stream))
    assert len(found) == len(expected)
    for (event, content), oracle in zip(found, expected, strict=True):
        assert event == (CORRUPT if oracle is None else TAKEN)
        assert oracle is None or content.startswith(oracle)
    taken = sum(oracle is not None for oracle in expected)
    return taken, len(expected) - taken


@given(st.lists(st.binary(max_size=80), max_size=8), st.integers(0, 2**32))
def test_streams_of_garbage_and_frames(garbage: list[bytes], seed: int) -> None:
    rng = random.Random(seed)
    frames = Frames()
    stream = b"".join(piece + b"\0" + random_request(rng, rng.randrange(65536)) for piece in garbage) + b"\0"
    taken, _ = agree(frames, stream)
    assert taken >= len(garbage)


class Tally(NamedTuple):
    """What became of damaged frames."""

    as_sent: int
    """Requests that came through as they were once sent."""
    plausible: int
    """Others with the type and length of a request: the CRC alone stands between them and the valves."""
    foreign: int
    """Those of them that it let through."""
    moving: int
    """Those of these that would have moved a valve: EXCHANGE or PULSE, fresh, all codes known."""


def fuzz(count: int, seed: int) -> Tally:
    """Feed damaged frames to the decoder, and tell what it did with them; it agrees with the oracle on each."""
    frames, rng = Frames(), random.Random(seed)
    others = [random_request(rng, i) for i in range(64)]
    as_sent = plausible = foreign = moving = 0
    for i in range(count):
        frame = random_request(rng, i)
        others[i % len(others)] = frame
        damaged = mutated(frame, rng, others) + b"\0"
        taken, _ = agree(frames, damaged)
        for chunk in damaged.split(b"\0"):
            if chunk + b"\0" in others:
                as_sent += 1
                taken -= 1
            elif fits(chunk) is not None:
                plausible += 1
        foreign += taken
        if taken:
            contents = [is_request(chunk) for chunk in damaged.split(b"\0") if chunk + b"\0" not in others]
            moving += sum(content is not None and _moves(content, i) for content in contents)
    return Tally(as_sent, plausible, foreign, moving)


def _moves(content: bytes, sequence: int) -> bool:
    ahead = (int.from_bytes(content[1:3], "little") - sequence) & 0xFFFF
    place = {wire.REQUEST["EXCHANGE"]: 3, wire.REQUEST["PULSE"]: 4}.get(content[0])
    return (
        place is not None
        and ahead <= 0x7FFF
        and all(content[place] >> 2 * m & 3 in wire.CODE.values() for m in range(4))
    )


def test_damaged_frames() -> None:
    tally = fuzz(5_000, seed=1)
    assert tally.as_sent < 1_500  # damage does damage
    assert tally.foreign == 0


@pytest.mark.soak
def test_million_damaged_frames() -> None:
    tally = fuzz(1_000_000, seed=2)
    print(f"a million damaged frames: {tally}")
    assert tally.moving == 0
    # A CRC of 16 bits lets one of 65,536 through; thrice that is beyond luck.
    assert tally.foreign <= 3 + 3 * tally.plausible / 65_536
