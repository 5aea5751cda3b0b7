"""Pulses of the real .hex: valves that close by themselves, at the time that was asked for, whatever happens."""

import random
from collections.abc import Iterator

import pytest

from tests.firmware import wire
from tests.firmware.build import missing
from tests.firmware.chip import FREQUENCY
from tests.firmware.figures import armed, open_between, pulses
from tests.firmware.host import LIMIT, LONGEST_REPLY, SESSION, Host
from tests.firmware.wire import CAUSE, CODE, CONSTANT, VENTED

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
MUSCLES = CONSTANT["MUSCLES"]
HOLD, LONGEST = CONSTANT["HOLD"], CONSTANT["LONGEST_PULSE"]
UNIT = CONSTANT["PULSE_UNIT_US"] * 1e-6
"""What lengths are counted in [s]."""
EXACT = 0.05
"""By how much a pulse may be longer or shorter than asked for [ms]."""


@pytest.fixture
def ready() -> Iterator[Host]:
    with armed() as host:
        yield host


def ms(milliseconds: float) -> int:
    """Return a time as a length of a pulse."""
    return round(1e-3 * milliseconds / UNIT)


def length(host: Host, known: int, muscle: int = 0, code: str = "IN") -> float:
    """Return for how long [ms] a valve was open in the one pulse since ``known`` changes of pins."""
    begin, end = open_between(host.chip.changes[known - 1 :], muscle, code)
    return 1e3 * (end - begin) / FREQUENCY


def test_pulses_are_as_long_as_asked_for() -> None:
    """Of any muscles together, at all phases of the tick and across its wraps, with the converter hard at work."""
    found = pulses()
    print(
        f"pulses: {1e3 * min(found.longer):.0f} to {1e3 * max(found.longer):+.0f} us off, valves within "
        f"{max(found.valves):.3f} ms, reply within {max(found.reply):.3f} ms of the first byte"
    )
    assert len(found.longer) > 100
    assert max(map(abs, found.longer)) <= EXACT
    assert max(found.valves) <= 0.75
    assert max(found.reply) <= 1.75


@pytest.mark.parametrize("units", [6, 7, 50, 124, 125, 126, 127, 128, 250, 1000, 12_500, 30_000])
def test_one_pulse_of_any_length(ready: Host, units: int) -> None:
    """Also next to whole ticks and to the farthest that the timer counts at once."""
    for phase in range(4):
        known = len(ready.chip.changes)
        ready.pulse(("CLOSED", 0), ("IN", units), wait=units * UNIT + LONGEST_REPLY)
        assert length(ready, known, 1) == pytest.approx(1e3 * units * UNIT, abs=EXACT)
        ready.exchange()
        ready.chip.run(0.21e-3 + phase * 0.27e-3)


def test_all_muscles_at_once_and_each_for_its_own_time(ready: Host) -> None:
    for lengths in ([500] * MUSCLES, [100, 101, 102, 103], [400, 300, 200, 100], [10, 2000, 10, 2000]):
        known = len(ready.chip.changes)
        ready.pulse(*[(("IN", "OUT")[m % 2], units) for m, units in enumerate(lengths)], wait=0.03)
        for m, units in enumerate(lengths):
            assert length(ready, known, m, ("IN", "OUT")[m % 2]) == pytest.approx(1e3 * units * UNIT, abs=EXACT)


def test_readings_tell_what_is_open(ready: Host) -> None:
    assert ready.pulse(("IN", ms(10)), ("OUT", ms(20)), ("IN", HOLD)).valves == wire.valves("IN", "OUT", "IN")
    ready.chip.run(0.01)
    assert ready.ask("READ").valves == wire.valves("CLOSED", "OUT", "IN")
    ready.chip.run(0.01)
    assert ready.ask("READ").valves == wire.valves("CLOSED", "CLOSED", "IN")
    ready.chip.run(0.1)
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("CLOSED", "CLOSED", "IN"))  # it holds


def test_the_same_command_again_goes_on(ready: Host) -> None:
    """As after a reply that was lost: no pulse is longer for it, and none begins again."""
    known = len(ready.chip.changes)
    ready.pulse(("IN", ms(20)), ("OUT", ms(10)))
    for _ in range(8):
        assert ready.pulse(("IN", ms(20)), ("OUT", ms(10)), number=ready.number).name == "READING"
    assert ready.ask("READ").valves == 0
    assert length(ready, known, 0, "IN") == pytest.approx(20, abs=EXACT)
    assert length(ready, known, 1, "OUT") == pytest.approx(10, abs=EXACT)


def test_the_same_command_again_feeds_the_dead_man(ready: Host) -> None:
    known = len(ready.chip.changes)
    ready.pulse(("IN", LONGEST), ("OUT", HOLD))
    for _ in range(6):
        ready.pulse(("IN", LONGEST), ("OUT", HOLD), number=ready.number, wait=0.1)
    reply = ready.ask("READ")
    assert (reply.has("ARMED"), reply.valves) == (True, wire.valves("CLOSED", "OUT"))
    assert length(ready, known) == pytest.approx(CONSTANT["DEAD_MAN_MS"], abs=EXACT)


def test_another_command_ends_what_is_left(ready: Host) -> None:
    for number in range(300):  # numbers begin again
        reply = ready.pulse(("IN", 100 + number), ("CLOSED", 0), ("OUT", 400), wait=0.0025)
        assert reply.valves == wire.valves("IN", "CLOSED", "OUT")
    ready.pulse(("IN", ms(5)), ("IN", ms(5)))
    ready.exchange("IN", "CLOSED", "OUT", wait=0.02)
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN", "CLOSED", "OUT"))
    # It was forgotten, and is a new one.
    assert ready.pulse(("IN", ms(5)), number=ready.number).valves == wire.valves("IN")
    ready.pulse(("IN", HOLD), wait=0.02)
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN"))
    ready.pulse(("IN", ms(10)))
    assert ready.arm().valves == 0
    known = len(ready.chip.changes)
    ready.pulse(("OUT", ms(5)), number=ready.number, wait=0.02)
    assert length(ready, known, 0, "OUT") == pytest.approx(5, abs=EXACT)


@pytest.mark.parametrize("units", [0, LONGEST + 1, HOLD - 1])
@pytest.mark.parametrize("muscle", range(MUSCLES))
def test_lengths_have_a_range(ready: Host, muscle: int, units: int) -> None:
    ready.exchange("OUT")
    lengths = [100] * MUSCLES
    lengths[muscle] = units
    number = ready.number + 1
    refused = ready.ask("PULSE", number, wire.valves(*["IN"] * MUSCLES), *lengths)
    assert (refused.why, refused.valves) == ("BAD_VALUE", wire.valves("OUT"))
    codes = ["IN"] * MUSCLES
    codes[muscle] = "CLOSED"  # a muscle that is closed has no length
    assert ready.ask("PULSE", number, wire.valves(*codes), *lengths).valves == wire.valves(*codes)


def test_codes_are_those_of_an_exchange(ready: Host) -> None:
    for codes in range(256):
        reply = ready.ask("PULSE", codes, codes, *[HOLD] * MUSCLES, wait=0.002)
        if all(codes >> 2 * muscle & 3 in CODE.values() for muscle in range(MUSCLES)):
            held = codes
            assert (reply.name, reply.valves) == ("READING", codes)
        else:
            assert (reply.name, reply.why, reply.valves) == ("REFUSED", "BAD_VALUE", held)
            ready.ask("EXCHANGE", held, wait=0.002)  # a refusal does not feed the dead-man
        assert ready.chip.valve_pins == wire.pins_of(held)


def test_damaged_in_any_bit_it_is_none(ready: Host) -> None:
    """With a right CRC: neither done, nor answered, nor counted as a sequence."""
    ready.exchange("IN", "OUT")
    good = wire.layout("PULSE").pack(7, wire.valves("OUT", "IN"), 300, 400, 0, 0, 0)[:-2]
    good += wire.summed(good)
    rng = random.Random(1)
    damaged = [
        bytes(b ^ (at == place) << bit for at, b in enumerate(good)) for place in range(12) for bit in range(8)
    ]
    damaged += [bytes(b ^ (at == place) * rng.randint(1, 255) for at, b in enumerate(good)) for place in range(12)]
    damaged += [good[:2] + good[4:6] + good[2:4] + good[6:], good[1::-1] + good[2:]]  # swapped
    head = bytes([wire.REQUEST["PULSE"]]) + (ready.sequence + 1).to_bytes(2, "little")
    for payload in damaged:
        assert ready.send(wire.enclosed(head + payload), wait=0.0015) == []
    assert ready.ask("READ", sequence=ready.sequence + 2).has("CORRUPT_SEEN")
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN", "OUT"))


def test_the_dead_man_in_a_pulse_vents_and_nothing_closes_again(ready: Host) -> None:
    ready.pulse(("IN", LONGEST), ("IN", LONGEST - ms(1)), ("IN", HOLD))
    ready.chip.run(0.24)
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN", "IN", "IN"))
    ready.chip.run(0.1)
    assert ready.chip.valve_pins == 0
    refused = ready.pulse(("IN", 100), number=ready.number)
    assert (refused.why, refused.has("DEAD_MAN"), refused.valves) == ("NOT_ARMED", True, VENTED)


@pytest.mark.parametrize("request_", ["DISARM", "CONNECT"])
def test_what_disarms_in_a_pulse_vents_for_good(ready: Host, request_: str) -> None:
    ready.pulse(("IN", ms(10)), ("OUT", ms(7)))
    ready.ask(request_, *((CONSTANT["VERSION"], SESSION) if request_ == "CONNECT" else ()))
    assert ready.chip.valve_pins == 0
    ready.chip.run(0.02)
    assert ready.chip.valve_pins == 0


def test_over_pressure_in_a_pulse_stays_vented_when_it_is_over(ready: Host) -> None:
    ready.pulse(("IN", ms(10)), ("IN", ms(10)))
    ready.chip.set_count(1, LIMIT + 1)
    ready.chip.run(0.002)
    assert ready.ask("READ").valves == wire.valves("OUT", "IN")
    ready.chip.run(0.02)
    ready.chip.set_count(1, 0)
    reply = ready.ask("READ")
    assert (reply.has("OVER_PRESSURE_1"), reply.valves) == (True, wire.valves("OUT", "CLOSED"))
    again = ready.pulse(("IN", ms(3)), ("IN", ms(3)), wait=0.01)
    assert again.valves == wire.valves("OUT", "IN")
    assert ready.ask("READ").valves == wire.valves("OUT", "CLOSED")


def test_reset_in_a_pulse_vents_and_forgets_it(ready: Host) -> None:
    ready.pulse(("IN", ms(10)), ("OUT", ms(20)))
    ready.chip.reset()
    ready.chip.run(0.03)
    assert ready.chip.valve_pins == 0
    assert ready.connect().reset_cause == CAUSE["EXTERNAL"]
    assert ready.pulse(("IN", ms(10)), number=ready.number).why == "NOT_ARMED"
    ready.ready()
    assert ready.pulse(("IN", ms(10)), number=ready.number).valves == wire.valves("IN")  # it is a new one


def test_pulses_of_muscles_never_open_both_valves(ready: Host) -> None:
    rng = random.Random(2)
    for _ in range(300):
        ready.pulse(
            *[(rng.choice(list(CODE)), rng.choice((rng.randint(1, 300), HOLD))) for _ in range(MUSCLES)], wait=0.003
        )
    assert len(ready.chip.changes) > 500
    assert not [change for change in ready.chip.changes if change.pins & 0x55 & ~(change.pins >> 1)]


def test_the_clock_of_the_board_is_as_it_was(ready: Host) -> None:
    """Waking it between its ticks leaves its ticks alone."""
    first = ready.ask("READ")
    offset = ready.begun - 16 * first.time
    rng = random.Random(3)
    for _ in range(150):
        ready.pulse(("IN", rng.randint(1, 800)), ("IN", rng.randint(1, 800)), wait=0.004 + rng.random() * 1e-3)
        reading = ready.ask("READ")
        assert abs(ready.begun - 16 * reading.time - offset) < 16 * 250
