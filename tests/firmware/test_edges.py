"""Where programs of microcontrollers break: interrupts that come in between, the stack, disturbed registers."""

import random
from collections.abc import Iterator

import pytest

from tests.firmware import wire
from tests.firmware.build import missing, symbols
from tests.firmware.chip import Chip
from tests.firmware.figures import ANALOG, armed, noise
from tests.firmware.host import LIMIT, Host
from tests.firmware.mutations import mutated, random_request
from tests.firmware.wire import CAUSE, CODE, CONSTANT

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
MUSCLES = CONSTANT["MUSCLES"]
TWO_BYTES = 2 * wire.CYCLES_PER_BYTE / 16e6
"""Time for which the line's register keeps what comes [s]: two bytes, then the next one is lost."""
RAM_END = 0x8FF
UCSR0B, TXCIE = 0xC1, 1 << 6
ADCSRA, ADEN, ADSC, ADIE = 0x7A, 1 << 7, 1 << 6, 1 << 3


@pytest.fixture
def ready() -> Iterator[Host]:
    with armed() as host:
        yield host


def work(host: Host, rng: random.Random) -> None:
    """Have the board do all that it can do, at any moment: requests, medians of noise, latches, damaged frames."""
    chip = host.chip
    others = [random_request(rng, i) for i in range(8)]
    for turn in range(25):
        host.ask("DISARM")
        host.configure(conversions=9, velocity_ms=CONSTANT["MOST_VELOCITY_MS"])
        host.arm()
        noise(chip, rng, 2e-3, amplitude=300)
        host.exchange(*[rng.choice(list(CODE)) for _ in range(MUSCLES)])
        host.pulse(*[(rng.choice(list(CODE)), rng.randint(1, 500)) for _ in range(MUSCLES)])
        host.send(mutated(wire.request("READ", host.sequence), rng, others) + b"\0")
        host.connect()
        chip.run_until(chip.cycle + rng.randrange(16_000))
        host.ready(conversions=9)
        if turn % 5 == 0:
            chip.run(0.26)


def test_interrupts_are_off_for_less_than_two_bytes() -> None:
    """Else bytes from the line are lost, which simavr's longer buffer hides."""
    with armed(conversions=9) as host:
        chip = host.chip
        chip.watch_interrupts()
        chip.run(0.02)
        # Of the interrupts that come before that of the line; the other, of pulses, takes a byte that waits first.
        tick = chip.longest_masked
        work(host, random.Random(1))
        assert tick < chip.longest_masked
        assert chip.longest_masked + tick < TWO_BYTES
        for channel in range(ANALOG):
            chip.set_count(channel, LIMIT + 1)
        chip.run(0.01)
        print(f"interrupts are off for {1e6 * tick:.0f} us in a tick, {1e6 * chip.longest_masked:.0f} us at most")
        assert chip.longest_masked < TWO_BYTES


def test_the_stack_stays_away_from_the_variables() -> None:
    paint = 0xC5
    with Chip() as chip:
        end = sum(symbols()["cause"])
        host = Host(chip)
        # The stack is as deep as it is now; nothing below it is in use.
        stack = chip.peek(0x5D) | chip.peek(0x5E) << 8
        for address in range(end, stack - 8):
            chip.poke(address, paint)
        host.ready(conversions=9)
        chip.set_count(1, LIMIT + 1)
        chip.run(0.01)
        chip.set_count(1, 0)
        chip.run(0.01)
        work(host, random.Random(2))
        free = next(address for address in range(end, RAM_END) if chip.peek(address) != paint) - end
        print(f"stack: at most {RAM_END + 1 - end - free} bytes, {free} were never touched")
        assert free > 512


def test_unwanted_interrupt_vents_and_resets(ready: Host) -> None:
    ready.exchange("IN", "IN", "IN", "IN")
    chip = ready.chip
    chip.poke(UCSR0B, chip.peek(UCSR0B) | TXCIE)  # nobody serves the end of a transmission
    disturbed = chip.cycle
    ready.ask("READ")
    vented = next(change.cycle for change in chip.changes if change.cycle > disturbed and change.pins & 0xFF == 0)
    assert (vented - disturbed) / 16e3 < 2
    chip.run(0.2)
    assert len(chip.resets) == 1
    ready.forget()
    assert ready.connect().reset_cause == CAUSE["WATCHDOG"]
    assert ready.exchange("IN").why == "NOT_ARMED"


@pytest.mark.parametrize("cause", CAUSE)
def test_every_reset_vents_and_tells_its_cause(ready: Host, cause: str) -> None:
    ready.exchange("IN", "CLOSED", "OUT", "IN")
    if cause == "WATCHDOG":
        ready.chip.hang()
        ready.chip.run(0.15)
    else:
        ready.chip.reset(cause)
    assert ready.chip.valve_pins == 0
    ready.chip.run(0.01)
    ready.forget()
    assert ready.exchange("IN").why == "NOT_CONNECTED"
    assert ready.chip.valve_pins == 0
    assert ready.connect().reset_cause == CAUSE[cause]


def test_flags_and_valves_of_a_reply_belong_together(ready: Host) -> None:
    """A muscle that its latch vents while the reply is made is told to be latched, and only such a one."""
    rng = random.Random(3)
    met = set()
    for _ in range(250):
        ready.arm()
        ready.chip.run_until(ready.chip.cycle + rng.randrange(4_000))
        # The third sample over the limit comes about when the reply is being made.
        ready.chip.set_count(1, LIMIT + 1)
        ready.chip.run_until(ready.chip.cycle + rng.randrange(8_000))
        reply = ready.exchange("IN")
        ready.chip.set_count(1, 0)
        ready.chip.run(0.001)
        latched = reply.has("OVER_PRESSURE_1")
        assert reply.valves & 3 == (CODE["OUT"] if latched else CODE["IN"])
        met.add(latched)
    assert met == {False, True}


@pytest.mark.parametrize("bits", [ADEN | ADSC, ADIE, ADEN | ADSC | ADIE])
def test_channels_are_not_mixed_up_after_the_converter_stopped(ready: Host, bits: int) -> None:
    """Whenever it stops, and whichever bit of its register was disturbed."""
    chip, rng = ready.chip, random.Random(bits)
    counts = [60 + 100 * channel for channel in range(ANALOG)]
    for channel, count in enumerate(counts):
        chip.set_count(channel, count)
    for _ in range(25):
        chip.run_until(chip.cycle + rng.randrange(16_000))
        for _ in range(3):  # the first one may be in its interrupt, which writes the register
            chip.poke(ADCSRA, chip.peek(ADCSRA) & ~bits)
            chip.run_until(chip.cycle + 300)
        chip.run(0.008)
        assert ready.exchange("IN").why == "NOT_ARMED"
        assert ready.arm().has("ARMED")
        reply = ready.exchange("CLOSED")
        assert [*reply.angle, *reply.pressure, *reply.extra] == [counts[i] for i in (0, 3, 1, 2, 4, 5, 6, 7)]
        windows = _windows(chip)
        assert windows == [{count} for count in counts]


def _windows(chip: Chip) -> list[set[int]]:
    """Return what the conversions in the median of each channel were."""
    address, size = symbols()["windows"]
    each = size // ANALOG
    words = [chip.peek(address + i) | chip.peek(address + i + 1) << 8 for i in range(0, size, 2)]
    used = 5  # conversions by default
    return [set(words[channel * each // 2 :][:used]) for channel in range(ANALOG)]


def test_clock_wraps_in_the_middle_of_its_ticks(ready: Host) -> None:
    """The clock's low and high parts agree at any moment, also when it wraps."""
    chip, rng = ready.chip, random.Random(4)
    chip.set_variable("ticks_us", (1 << 32) - 300_000)
    shift = None
    for _ in range(300):
        chip.run_until(chip.cycle + rng.randrange(16_000))
        reply = ready.ask("READ", wait=0.002)
        off = (reply.time - round(ready.begun / 16)) & 0xFFFFFFFF
        shift = off if shift is None else shift
        assert abs((off - shift + (1 << 31)) % (1 << 32) - (1 << 31)) < 60
    assert reply.time < 1 << 31  # it wrapped
