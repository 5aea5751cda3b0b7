"""The protocol in Python against its page, and against other people's COBS and CRC."""

import random
import tracemalloc

import numpy as np
import pytest
from cobs import cobs
from crc import Calculator, Crc16
from hypothesis import given
from hypothesis import strategies as st
from tests.firmware import wire
from tests.firmware.mutations import any_payload, mutated

from pneumarm.arm.serial import protocol
from pneumarm.arm.serial.protocol import (
    ANSWER,
    Cause,
    Code,
    Flag,
    Reason,
    Reply,
    Request,
    Sensors,
    Splitter,
    decode,
    encode,
    pack_valves,
    said_twice,
    stuff,
    summed,
    unpack_valves,
    unstuff,
)

X25 = Calculator(Crc16.X25)
KINDS = {**wire.REQUEST, **wire.REPLY}


def random_values(name: str, rng: random.Random) -> tuple[int, ...]:
    """Return any payload of a frame, as its values."""
    return wire.layout(name).unpack(any_payload(name, rng))


def test_constants_are_those_of_the_page() -> None:
    assert {name: getattr(protocol, name) for name in wire.CONSTANT} == wire.CONSTANT


@pytest.mark.parametrize(
    ("kind", "page"),
    [
        (Request, wire.REQUEST),
        (Reply, wire.REPLY),
        (Code, wire.CODE),
        (Flag, wire.FLAG),
        (Reason, wire.REASON),
        (Cause, wire.CAUSE),
    ],
)
def test_names_and_numbers_are_those_of_the_page(kind: type, page: dict[str, int]) -> None:
    assert {member.name: member.value for member in kind} == page


def test_each_request_has_the_answer_of_the_page() -> None:
    page = {row["name"]: row["reply"] for row in wire.tables()["Requests"]}
    assert {request.name: reply.name for request, reply in ANSWER.items()} == page


@pytest.mark.parametrize("name", KINDS)
def test_frames_are_those_of_the_page(name: str) -> None:
    rng = random.Random(name)
    for sequence in (0, 1, 255, 256, 65535):
        values = random_values(name, rng)
        content = bytes([KINDS[name]]) + sequence.to_bytes(2, "little") + wire.layout(name).pack(*values)
        frame = encode(KINDS[name], sequence, *values)
        assert frame == wire.enclosed(content)
        assert decode(frame[:-1]) == (KINDS[name], sequence, values)
        assert frame.index(0) == len(frame) - 1 < protocol.LONGEST_FRAME


def test_fields_of_a_reading_have_their_names() -> None:
    rng = random.Random(1)
    values = wire.layout("READING").unpack(rng.randbytes(wire.layout("READING").size))
    named = wire.reply(encode(Reply.READING, 7, *values)[:-1]).values
    assert Sensors.of(values)._asdict() == named
    assert Sensors.of(values).packed() == values


def test_stuffing_and_crc_of_all_lengths() -> None:
    rng = random.Random(0)
    for length in range(601):
        for content in (bytes(length), b"\7" * length, bytes(rng.choice((0, 1, 255)) for _ in range(length))):
            assert stuff(content) == cobs.encode(content)
            assert unstuff(stuff(content)) == content
        if length % 20 == 0:
            assert protocol.crc(content) == X25.checksum(content) == wire.crc(content)
    for zero in (0, 1, 253, 254, 255, 508, 599):
        content = b"\7" * zero + b"\0" + b"\7" * (599 - zero)
        assert stuff(content) == cobs.encode(content)
        assert unstuff(stuff(content)) == content


@given(st.lists(st.sampled_from([1, 2, 3, 7, 255]) | st.integers(1, 255), max_size=300).map(bytes))
def test_unstuffing_agrees_also_on_what_is_none(data: bytes) -> None:
    try:
        expected: bytes | None = bytes(cobs.decode(data)) if data else None
    except cobs.DecodeError:
        expected = None
    assert unstuff(data) == expected


@given(st.binary(max_size=300), st.lists(st.integers(0, 400), max_size=10), st.integers(0, 2**32))
def test_a_stream_gives_the_same_frames_however_it_is_cut(garbage: bytes, cuts: list[int], seed: int) -> None:
    rng = random.Random(seed)
    frames = [encode(Request.EXCHANGE, rng.randrange(65536), *said_twice(rng.randrange(256))) for _ in range(5)]
    stream = b"".join(frames[:2]) + garbage + b"\0" + b"".join(frames[2:])
    whole, pieces = Splitter(), Splitter()
    expected = list(whole.feed(stream))
    ends = sorted(min(cut, len(stream)) for cut in cuts)
    found = []
    for begin, end in zip([0, *ends], [*ends, len(stream)], strict=True):
        found += list(pieces.feed(stream[begin:end]))
    assert found == expected
    assert whole.corrupt == pieces.corrupt
    assert expected[:2] + expected[-3:] == [decode(frame[:-1]) for frame in frames]


def oracle(chunk: bytes) -> bytes | None:
    """Return the content between two 0x00 where the page calls it a frame."""
    try:
        content = wire.content_of(chunk)
    except ValueError:
        return None
    name = next((name for name, number in KINDS.items() if number == content[0]), None)
    right = name is not None and len(content) == 3 + wire.layout(name).size
    return content if right and wire.is_said_twice(content) else None


def damage(count: int, seed: int) -> tuple[int, int]:
    """Feed damaged frames of all kinds; return how many were damaged, and how many of those were taken."""
    rng, splitter = random.Random(seed), Splitter()
    others = [b"\1\2\3\0"] * 64
    damaged = foreign = 0
    names = list(KINDS)
    for i in range(count):
        name = rng.choice(names)
        values = random_values(name, rng)
        frame = encode(KINDS[name], i & 0xFFFF, *values)
        others[i % len(others)] = frame
        stream = mutated(frame, rng, others) + b"\0"
        expected = [oracle(chunk) for chunk in stream.split(b"\0") if chunk and len(chunk) < protocol.LONGEST_FRAME]
        found = list(splitter.feed(stream))
        assert [(f.kind, f.sequence) for f in found] == [
            (c[0], int.from_bytes(c[1:3], "little")) for c in expected if c is not None
        ]
        sent = {other[:-1] for other in others}
        taken = [chunk for chunk in stream.split(b"\0") if chunk and oracle(chunk) is not None and chunk not in sent]
        damaged += any(chunk and chunk not in sent for chunk in stream.split(b"\0"))
        foreign += len(taken)
    return damaged, foreign


def test_damaged_frames() -> None:
    damaged, foreign = damage(20_000, seed=1)
    assert damaged > 15_000
    assert foreign == 0


@pytest.mark.soak
def test_million_damaged_frames_to_the_host_and_the_board() -> None:
    damaged, foreign = damage(1_000_000, seed=2)
    print(f"a million damaged frames to the Python decoder: {damaged} damaged, {foreign} of them taken")
    assert foreign <= 3 + 3 * damaged / 65_536  # what a CRC of 16 bits lets through by chance


def test_an_exchange_says_its_valves_twice() -> None:
    """Of all 65,536 payloads, each with its right CRC, the 256 whose bytes are each other's complement are taken."""
    taken = []
    for payload in range(1 << 16):
        content = bytes([Request.EXCHANGE, 1, 2]) + payload.to_bytes(2, "little")
        if (frame := decode(stuff(content + protocol.crc(content).to_bytes(2, "little")))) is not None:
            taken.append(frame.values)
    assert taken == sorted(map(said_twice, range(256)), key=lambda values: values[1])


def test_a_pulse_s_values_are_summed_up() -> None:
    """With its right CRC, a payload that differs from its sum in any bit, or in the order of its bytes, is none."""
    good = wire.layout("PULSE").pack(*summed(7, wire.valves("OUT", "IN"), 300, 400, 0, 0))
    payloads = [
        bytes(b ^ (at == place) << bit for at, b in enumerate(good)) for place in range(12) for bit in range(8)
    ]
    payloads += [good[:2] + good[4:6] + good[2:4] + good[6:], good[1::-1] + good[2:], good]
    taken = []
    for payload in payloads:
        content = bytes([Request.PULSE, 1, 2]) + payload
        if decode(stuff(content + protocol.crc(content).to_bytes(2, "little"))) is not None:
            taken.append(payload)
    assert taken == [good]


def test_a_stream_without_an_end_takes_no_memory() -> None:
    splitter = Splitter()
    tracemalloc.start()
    try:
        for _ in range(1000):
            assert list(splitter.feed(b"\7" * 1000)) == []
        assert tracemalloc.get_traced_memory()[0] < 10_000
    finally:
        tracemalloc.stop()
    frame = encode(Request.READ, 1)
    assert [one.kind for one in splitter.feed(b"\0" + frame)] == [Request.READ]
    assert splitter.corrupt == 1


def test_every_byte_of_valves() -> None:
    for packed in range(256):
        codes = [packed >> 2 * muscle & 3 for muscle in range(protocol.MUSCLES)]
        valves = unpack_valves(packed, joints=2)
        if any(code not in wire.CODE.values() for code in codes):
            assert valves is None
        else:
            assert valves is not None
            assert pack_valves(valves) == packed


def test_muscles_that_are_not_there_are_closed() -> None:
    assert pack_valves(np.array([[1, -1]], np.int8)) == wire.valves("IN", "OUT", "CLOSED", "CLOSED")
