"""Requests and replies of the real .hex: sessions, sequences, refusals."""

import struct
from collections.abc import Iterator

import pytest

from tests.firmware import wire
from tests.firmware.build import hash_of_sources, missing
from tests.firmware.chip import Chip
from tests.firmware.figures import armed
from tests.firmware.host import LIMIT, SESSION, Host
from tests.firmware.wire import CAUSE, CODE, CONSTANT, REQUEST, VENTED

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
FULL = [LIMIT] * CONSTANT["MUSCLES"]


@pytest.fixture
def host() -> Iterator[Host]:
    with Chip() as chip:
        yield Host(chip)


@pytest.fixture
def ready() -> Iterator[Host]:
    with armed() as host:
        yield host


def test_only_connect_is_served_after_a_reset(host: Host) -> None:
    for name in REQUEST:
        if name != "CONNECT":
            zeros = bytes(wire.layout(name).size)
            reply = host.ask(name, *(wire.twice(0) if name == "EXCHANGE" else wire.layout(name).unpack(zeros)))
            assert (reply.name, reply.why, reply.valves) == ("REFUSED", "NOT_CONNECTED", VENTED)
    assert host.chip.valve_pins == 0


def test_hello_says_who_is_there(host: Host) -> None:
    hello = host.connect()
    assert (hello.version, hello.session) == (CONSTANT["VERSION"], SESSION)
    assert (hello.reset_cause, hello.boots) == (CAUSE["POWER_ON"], 1)


def test_firmware_is_the_hash_of_the_sources(host: Host) -> None:
    assert host.connect().firmware == hash_of_sources()


def test_reset_pin_and_boots_are_told(ready: Host) -> None:
    ready.exchange("IN")
    for boots in (2, 3):
        ready.chip.reset()
        assert ready.chip.valve_pins == 0
        ready.chip.run(0.005)
        hello = ready.connect()
        assert (hello.reset_cause, hello.boots) == (CAUSE["EXTERNAL"], boots)
    assert ready.exchange("IN").why == "NOT_ARMED"


@pytest.mark.parametrize("version", [0, 2 - 1, CONSTANT["VERSION"] + 1, 255])
def test_another_version_is_refused_and_changes_nothing(ready: Host, version: int) -> None:
    ready.exchange("IN")
    reply = ready.ask("CONNECT", version, 99, sequence=7)
    assert (reply.why, reply.has("ARMED")) == ("WRONG_VERSION", True)
    assert ready.exchange("IN").name == "READING"


def test_a_host_of_the_oldest_version_finds_its_board(host: Host) -> None:
    hello = host.ask("CONNECT", 2, SESSION)
    assert (hello.name, hello.version, hello.session) == ("HELLO", 2, SESSION)
    host.configure()
    assert host.arm().has("ARMED")
    assert host.exchange("IN", "OUT").valves == wire.valves("IN", "OUT")


@pytest.mark.parametrize("conversions", [0, 1, 4, 6, 8, 10, 255])
def test_conversions_are_five_seven_or_nine(host: Host, conversions: int) -> None:
    host.connect()
    assert host.configure(conversions=conversions).why == "BAD_VALUE"
    assert host.arm().why == "NOT_CONFIGURED"


@pytest.mark.parametrize("velocity_ms", [0, CONSTANT["MOST_VELOCITY_MS"] + 1, 255])
def test_velocity_is_averaged_over_a_time_that_is_kept(host: Host, velocity_ms: int) -> None:
    host.connect()
    assert host.configure(velocity_ms=velocity_ms).why == "BAD_VALUE"


@pytest.mark.parametrize("muscle", range(CONSTANT["MUSCLES"]))
@pytest.mark.parametrize("limit", [0, 1024, 65535])
def test_limits_are_counts(host: Host, muscle: int, limit: int) -> None:
    host.connect()
    limits = FULL.copy()
    limits[muscle] = limit
    assert host.ask("CONFIGURE", 5, 16, *limits).why == "BAD_VALUE"


def test_the_ends_of_all_ranges_are_good(host: Host) -> None:
    host.connect()
    for conversions, velocity_ms, limit in ((5, 1, 1), (7, 2, 512), (9, CONSTANT["MOST_VELOCITY_MS"], 1023)):
        assert host.configure(conversions, velocity_ms, limit).has("CONFIGURED")


def test_configure_waits_for_disarm(ready: Host) -> None:
    assert ready.configure().why == "STILL_ARMED"
    assert ready.ask("CONFIGURE", 4, 16, *FULL).why == "STILL_ARMED"
    assert not ready.ask("DISARM").has("ARMED")
    assert ready.configure().name == "STATUS"


def test_arm_names_the_session_and_closes_all_valves(host: Host) -> None:
    host.connect()
    assert host.arm().why == "NOT_CONFIGURED"
    host.configure()
    assert host.ask("ARM", SESSION + 1).why == "WRONG_SESSION"
    assert host.chip.valve_pins == 0
    reply = host.arm()
    assert (reply.name, reply.has("ARMED"), reply.valves) == ("STATUS", True, 0)
    assert host.chip.valve_pins == wire.pins_of(0)


def test_disarm_vents(ready: Host) -> None:
    ready.exchange("IN", "CLOSED", "OUT", "IN")
    reply = ready.ask("DISARM")
    assert (reply.has("ARMED"), reply.valves, ready.chip.valve_pins) == (False, VENTED, 0)
    assert ready.exchange("IN").why == "NOT_ARMED"
    assert ready.chip.valve_pins == 0


def test_every_byte_of_valves(ready: Host) -> None:
    """All 81 patterns act at the pins; the 175 bytes with an unknown code are refused and move nothing."""
    held = 0
    for codes in range(256):
        reply = ready.ask("EXCHANGE", codes, wait=0.002)
        if all(codes >> 2 * muscle & 3 in CODE.values() for muscle in range(CONSTANT["MUSCLES"])):
            held = codes
            assert (reply.name, reply.valves) == ("READING", codes)
        else:
            assert (reply.name, reply.why, reply.valves) == ("REFUSED", "BAD_VALUE", held)
            ready.exchange(*_names(held))  # a refusal does not feed the dead-man
        assert ready.chip.valve_pins == wire.pins_of(held)


def _names(codes: int) -> list[str]:
    names = {value: name for name, value in CODE.items()}
    return [names[codes >> 2 * muscle & 3] for muscle in range(CONSTANT["MUSCLES"])]


def test_read_leaves_the_valves_alone(ready: Host) -> None:
    ready.exchange("IN", "OUT")
    before = ready.chip.valve_pins
    reply = ready.ask("READ")
    assert (reply.name, reply.valves) == ("READING", wire.valves("IN", "OUT"))
    assert ready.chip.valve_pins == before


def test_the_last_again_does_not_act(ready: Host) -> None:
    ready.exchange("IN")
    reply = ready.ask("EXCHANGE", wire.valves("OUT"), sequence=ready.sequence)
    assert reply.name == "READING"
    assert reply.has("REPEATED")
    assert reply.valves == wire.valves("IN")
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN"))


def test_the_last_again_does_not_feed_the_dead_man(ready: Host) -> None:
    ready.exchange("IN")
    for _ in range(30):
        last = ready.ask("EXCHANGE", wire.valves("IN"), sequence=ready.sequence, wait=0.01)
    assert (last.has("DEAD_MAN"), last.has("ARMED"), last.valves) == (True, False, VENTED)


def test_what_was_refused_is_refused_again(ready: Host) -> None:
    bad = 0b11
    assert not ready.ask("EXCHANGE", bad).has("REPEATED")
    again = ready.ask("EXCHANGE", bad, sequence=ready.sequence)
    assert (again.why, again.has("REPEATED")) == ("BAD_VALUE", True)


def test_other_requests_again(ready: Host) -> None:
    pulse = (1, wire.valves("IN"), 100, 0, 0, 0)
    requests = (("READ", ()), ("PULSE", pulse), ("DISARM", ()), ("CONFIGURE", (5, 16, *FULL)), ("ARM", (SESSION,)))
    for name, values in requests:
        first = ready.ask(name, *values)
        again = ready.ask(name, *values, sequence=ready.sequence)
        assert (again.name, again.has("REPEATED")) == (first.name, True)


def test_arm_again_does_not_arm(ready: Host) -> None:
    ready.ask("DISARM")
    sequence = ready.sequence - 1
    assert ready.ask("ARM", SESSION, sequence=sequence) is None  # a late copy from before
    ready.arm()
    ready.chip.run(0.26)
    again = ready.ask("ARM", SESSION, sequence=ready.sequence)
    assert (again.has("REPEATED"), again.has("ARMED"), again.has("DEAD_MAN")) == (True, False, True)
    assert ready.chip.valve_pins == 0


@pytest.mark.parametrize("behind", [1, 2, 100, 0x7FFF, 0x8000])
def test_stale_is_neither_done_nor_answered(ready: Host, behind: int) -> None:
    ready.exchange("IN")
    assert ready.ask("EXCHANGE", wire.valves("OUT", "OUT"), sequence=(ready.sequence - behind) & 0xFFFF) is None
    assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN"))
    reply = ready.ask("READ")
    assert reply.has("STALE_SEEN")
    assert not ready.ask("READ").has("STALE_SEEN")


def test_same_sequence_of_another_type_is_stale(ready: Host) -> None:
    ready.ask("READ")
    assert ready.ask("EXCHANGE", wire.valves("IN"), sequence=ready.sequence) is None
    assert ready.chip.valve_pins == wire.pins_of(0)


def test_fresh_is_up_to_half_the_circle_ahead(ready: Host) -> None:
    for ahead in (1, 2, 0x7FFF, 0x7FFF, 0x7FFF):  # more than once around
        ready.sequence = (ready.sequence + ahead - 1) & 0xFFFF
        assert ready.exchange("IN").name == "READING"


def test_sequence_wraps(ready: Host) -> None:
    for ahead in (0x7000, 0xEFFE):
        ready.sequence = ahead
        ready.exchange("IN")
    ready.sequence = 0xFFF8
    for i in range(16):
        code = ("IN", "OUT")[i & 1]
        assert ready.exchange(code).valves == wire.valves(code)
    assert ready.sequence == 8


def test_clearing_a_latch_forgets_no_sequence(ready: Host) -> None:
    ready.exchange("IN")
    late = ready.sequence
    ready.chip.run(0.26)
    assert ready.arm().has("ARMED")
    assert ready.ask("EXCHANGE", wire.valves("IN"), sequence=late) is None
    assert ready.chip.valve_pins == wire.pins_of(0)


def test_late_connect_disarms_and_its_session_arms_nothing(ready: Host) -> None:
    ready.exchange("IN")
    ready.ask("CONNECT", CONSTANT["VERSION"], 77, sequence=ready.sequence - 2)
    assert ready.chip.valve_pins == 0
    assert ready.exchange("IN").why == "NOT_ARMED"
    assert ready.arm().why == "WRONG_SESSION"


def test_connect_forgets_the_configuration(ready: Host) -> None:
    assert ready.connect().name == "HELLO"
    assert ready.arm().why == "NOT_CONFIGURED"


def test_request_of_a_wrong_length_is_corrupt(ready: Host) -> None:
    for name in REQUEST:
        size = wire.layout(name).size
        for length in {0, size - 1, size + 1, 20} - {size, -1}:
            content = struct.pack("<BH", REQUEST[name], ready.sequence + 1) + bytes(length)
            assert ready.send(wire.enclosed(content)) == []
            assert ready.ask("READ").has("CORRUPT_SEEN")
    assert not ready.ask("READ").has("CORRUPT_SEEN")


def test_valves_that_are_not_said_twice_are_corrupt(ready: Host) -> None:
    """With a right CRC: neither done, nor answered, nor counted as a sequence, whichever bit differs."""
    ready.exchange("IN", "OUT")
    codes = wire.valves("OUT", "IN")
    for second in [codes, 0, 0xFF, *(codes ^ 0xFF ^ 1 << bit for bit in range(8))]:
        assert ready.ask("EXCHANGE", codes, second, sequence=ready.sequence + 1) is None
        assert ready.chip.valve_pins == wire.pins_of(wire.valves("IN", "OUT"))
        assert ready.ask("READ").has("CORRUPT_SEEN")
    assert ready.ask("EXCHANGE", codes).valves == codes


def test_unknown_types_are_corrupt(ready: Host) -> None:
    for kind in set(range(256)) - set(REQUEST.values()):
        content = struct.pack("<BH", kind, ready.sequence + 1)
        assert ready.send(wire.enclosed(content), wait=0.0005) == []
    assert ready.ask("READ").has("CORRUPT_SEEN")
