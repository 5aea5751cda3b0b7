"""The line to the real .hex: round trip, split, merged and damaged frames, lost bytes."""

import random
import struct

import pytest

from soak import Attack, amount
from tests.firmware import wire
from tests.firmware.build import missing
from tests.firmware.figures import armed, round_trip
from tests.firmware.host import Host
from tests.firmware.mutations import is_request, mutated, random_request
from tests.firmware.wire import CODE, CONSTANT, FLAG

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
MUSCLES = CONSTANT["MUSCLES"]


def test_round_trip() -> None:
    """With the longest medians, every valve changing, noise at all inputs, at all phases of the interrupts."""
    times = round_trip(exchanges=150)
    print(f"valves within {max(times.valves):.3f} ms, reply within {max(times.reply):.3f} ms of the first byte")
    assert max(times.valves) <= 0.5
    assert max(times.reply) <= 1.5


def test_frames_split_anywhere() -> None:
    with armed() as host:
        for cut in range(1, 8):
            frame = wire.request("EXCHANGE", host.sequence + 1, wire.valves("IN"))
            host.sequence += 1
            assert host.send(frame[:cut], wait=0.02) == []
            (reply,) = host.send(frame[cut:])
            assert reply.valves == wire.valves("IN")


def test_frames_one_after_the_other_are_all_answered() -> None:
    with armed() as host:
        names = list(CODE)
        frames = [wire.request("EXCHANGE", host.sequence + 1 + i, wire.valves(names[i % 3])) for i in range(8)]
        replies = host.send(b"".join(frames), wait=0.02)
        assert [reply.valves for reply in replies] == [wire.valves(names[i % 3]) for i in range(8)]
        assert not any(reply.has("OVERRUN_SEEN") or reply.has("CORRUPT_SEEN") for reply in replies)


def test_zeros_between_frames_mean_nothing() -> None:
    with armed() as host:
        frame = wire.request("READ", host.sequence + 1)
        (reply,) = host.send(b"\0\0\0" + frame + b"\0\0")
        host.sequence += 1
        assert not reply.has("CORRUPT_SEEN")


@pytest.mark.parametrize("length", [1, 7, 62, 63, 64, 65, 100, 200, 1000])
def test_garbage_of_any_length_costs_itself_only(length: int) -> None:
    rng = random.Random(length)
    with armed() as host:
        garbage = bytes(rng.randint(1, 255) for _ in range(length))
        replies = host.send(garbage + b"\0" + wire.request("READ", host.sequence + 1), wait=length * 20e-6 + 0.004)
        assert [reply.has("CORRUPT_SEEN") for reply in replies] == [True]
        host.sequence += 1
        assert not host.ask("READ").has("CORRUPT_SEEN")


def test_too_many_requests_at_once_are_lost_and_said_to_be() -> None:
    with armed() as host:
        frames = [wire.request("READ", host.sequence + 1 + i) for i in range(200)]
        replies = host.send(b"".join(frames), wait=0.2)
        assert 20 < len(replies) < 200
        assert any(reply.has("OVERRUN_SEEN") for reply in replies)
        host.sequence = 0x4000
        host.send(b"\0")  # ends the frame whose end was lost
        reply = host.ask("READ")
        assert reply.name == "READING"
        assert not host.ask("READ").has("OVERRUN_SEEN")


def test_reset_in_the_middle_of_a_reply_costs_that_reply_only() -> None:
    with armed() as host:
        host.chip.write(wire.request("READ", host.sequence + 1))
        host.chip.run(0.0008)
        begun = bytes(byte for _, byte in host.chip.received())
        assert begun
        assert not begun.endswith(b"\0")
        host.chip.reset()
        host.chip.run(0.01)
        ended, *others = (begun + bytes(byte for _, byte in host.chip.received())).split(b"\0")
        assert ended.startswith(begun)
        assert others == [b""]
        assert host.connect().reset_cause == wire.CAUSE["EXTERNAL"]


class Model:
    """What the board must do with what comes: the protocol, for EXCHANGE, PULSE and READ of an armed board."""

    def __init__(self, host: Host) -> None:
        self.last = (host.sequence, wire.REQUEST["ARM"])
        self.valves = 0
        self.number: int | None = None

    def take(self, content: bytes) -> int | None:
        """Return the sequence of the reply, or None where none may come."""
        kind, sequence = content[0], int.from_bytes(content[1:3], "little")
        ahead = (sequence - self.last[0]) & 0xFFFF
        if (sequence, kind) != self.last:
            if not 1 <= ahead <= 0x7FFF:
                return None
            self.last = (sequence, kind)
            if kind == wire.REQUEST["EXCHANGE"]:
                self.set(content[3])
            if kind == wire.REQUEST["PULSE"] and content[3] != self.number:
                self.set(content[4], content[3], struct.unpack_from(f"<{MUSCLES}H", content, 5))
        return sequence

    def set(self, codes: int, number: int | None = None, lengths: tuple[int, ...] = (1,) * MUSCLES) -> None:
        """Set valves, if they are some."""
        for muscle, length in enumerate(lengths):
            code = codes >> 2 * muscle & 3
            right = 1 <= length <= CONSTANT["LONGEST_PULSE"] or length == CONSTANT["HOLD"]
            if code not in CODE.values() or (code != CODE["CLOSED"] and not right):
                return
        self.valves, self.number = codes, number


def any_command(rng: random.Random, sequence: int, codes: int) -> bytes:
    """Return the frame of an EXCHANGE or a PULSE that is not over before it is looked at."""
    if rng.random() < 0.5:
        return wire.request("EXCHANGE", sequence, codes)
    lengths = [rng.choice((CONSTANT["HOLD"], rng.randint(2_000, CONSTANT["LONGEST_PULSE"]))) for _ in range(MUSCLES)]
    return wire.request("PULSE", sequence, rng.randrange(4), codes, *lengths)


def fuzz(attack: Attack, seed: int) -> dict[str, int]:
    """Send damaged frames, two good ones after each; compare all replies and the pins with the model's."""
    rng = random.Random(seed)
    tally = {"accepted": 0, "answered": 0, "one good frame lost": 0}
    codes = [wire.valves(*names) for names in ([a, b, c, d] for a in CODE for b in CODE for c in CODE for d in CODE)]
    with armed() as host:
        model = Model(host)
        others = [random_request(rng, rng.randrange(65536)) for _ in range(16)]
        sent = {frame[:-1] for frame in others}
        while attack.done < attack.total:
            frame = any_command(rng, host.sequence + 1, rng.choice(codes))
            others[rng.randrange(len(others))] = frame
            damaged = mutated(frame, rng, [other for other in others if other[1] != wire.REQUEST["CONNECT"]])
            good = [any_command(rng, host.sequence + 2 + i, rng.choice(codes)) for i in range(2)]
            stream = damaged + b"".join(good)
            chunks = [chunk for chunk in stream.split(b"\0") if chunk]
            contents = [is_request(chunk) for chunk in chunks]
            kinds = {content[0] for content in contents if content}
            if kinds - {wire.REQUEST["EXCHANGE"], wire.REQUEST["PULSE"], wire.REQUEST["READ"]}:
                continue  # another request as it was sent: no damage, and not the model's
            expected = [model.take(content) if content else None for content in contents]
            replies = host.send(stream, wait=0.0055)
            assert [reply.sequence for reply in replies] == [
                sequence for sequence in expected if sequence is not None
            ]
            assert host.chip.valve_pins == wire.pins_of(model.valves)
            assert replies, "not resynchronised within one frame"
            assert replies[-1].sequence == (host.sequence + 3) & 0xFFFF
            assert replies[-1].valves == model.valves
            assert replies[-1].values["flags"] & FLAG["ARMED"]
            attack.advance()
            tally["one good frame lost"] += contents[-2] is None
            sent.update(chunk[:-1] for chunk in (frame, *good))
            for chunk, content, answer in zip(chunks, contents, expected, strict=True):
                foreign = content is not None and chunk not in sent
                tally["accepted"] += foreign
                tally["answered"] += foreign and answer is not None
            host.sequence = (model.last[0]) & 0xFFFF
        assert not [c for c in host.chip.changes if c.pins & 0x55 & ~(c.pins >> 1)]
    return tally


def test_two_thousand_damaged_frames() -> None:
    assert fuzz(Attack("damaged frames", 2_000), seed=3)["accepted"] == 0


@pytest.mark.soak
def test_many_damaged_frames() -> None:
    attack = Attack("damaged frames to the firmware in a simulated ATmega", amount("FRAMES", 100_000))
    tally = fuzz(attack, seed=4)
    # 16 bits let one in 65,536 through; it must still be of a kind and length that is known, and fresh.
    assert tally["answered"] == 0
    attack.summarise(", ".join(f"{what} {count:,}" for what, count in tally.items()))
