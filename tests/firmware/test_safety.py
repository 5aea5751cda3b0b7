"""What protects the arm, on the real .hex: the order of the pins, the dead-man, the latches, the watchdog."""

import random
from collections.abc import Iterator, Sequence
from itertools import pairwise

import pytest

from tests.firmware import wire
from tests.firmware.build import missing
from tests.firmware.chip import LIGHT, Change, Chip
from tests.firmware.figures import armed, dead_man, over_pressure, watchdog
from tests.firmware.host import LIMIT, SESSION, Host
from tests.firmware.wire import CAUSE, CODE, CONSTANT, VENTED

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
MUSCLES = CONSTANT["MUSCLES"]
PRESSURES = [1, 2, 4, 5]
"""Analog channels of the muscles' pressures."""
ADCSRA, ADEN, ADSC = 0x7A, 1 << 7, 1 << 6
"""The converter's control register, and its bits for enabled and converting."""
TIMSK1 = 0x6F
"""The register that lets the tick interrupt."""


@pytest.fixture
def ready() -> Iterator[Host]:
    with armed() as host:
        yield host


def stop_converter(chip: Chip) -> None:
    """Disable the converter behind the program's back, which also ends the conversion under way."""
    chip.poke(ADCSRA, chip.peek(ADCSRA) & ~(ADEN | ADSC))


def both_open(changes: Sequence[Change]) -> list[Change]:
    """Return where an inlet's pin was high while its exhaust's was low: both valves open."""
    return [change for change in changes if change.pins & 0x55 & ~(change.pins >> 1)]


def test_no_pin_is_high_before_the_host_comes() -> None:
    with Chip() as chip:
        chip.run(0.5)
        assert chip.changes == [Change(0, 0)]


def test_both_valves_of_a_muscle_are_never_open(ready: Host) -> None:
    """At no cycle, whatever follows whatever: all 81 x 81 changes, every write to a port being looked at."""
    names = list(CODE)
    patterns = [[names[i // 3**m % 3] for m in range(MUSCLES)] for i in range(len(names) ** MUSCLES)]
    rng = random.Random(1)
    # Each pair of patterns of a port is met by a walk through 9 x 9 pairs, on both ports with different phases.
    for _ in range(400):
        ready.exchange(*rng.choice(patterns), wait=0.0015)
    halves = [[a, b] for a in names for b in names]
    for one in halves:
        for other in halves:
            ready.exchange(*one, *other, wait=0.0015)
            ready.exchange(*other, *one, wait=0.0015)
    assert len(ready.chip.changes) > 1000
    assert both_open(ready.chip.changes) == []


def test_exhaust_opens_after_its_inlet_has_closed(ready: Host) -> None:
    ready.exchange("IN", "IN", "IN", "IN")
    known = len(ready.chip.changes)
    ready.exchange("OUT", "OUT", "OUT", "OUT")
    steps = [change.pins & 0xFF for change in ready.chip.changes[known - 1 :]]
    assert steps[0] == 0xFF
    assert steps[-1] == 0
    inlets = [step & 0x55 for step in steps]
    exhausts = [step & 0xAA for step in steps]
    assert exhausts[inlets.index(0)] == 0xAA  # all inlets were closed before the first exhaust opened


def test_dead_man_vents_at_250_ms() -> None:
    times = dead_man(repeats=12)
    print(f"dead-man: {min(times):.2f} to {max(times):.2f} ms after the last EXCHANGE")
    assert min(times) >= 248.9
    assert max(times) <= 251


def test_dead_man_disarms_until_armed_again(ready: Host) -> None:
    ready.exchange("IN", "IN", "IN", "IN")
    ready.chip.run(0.26)
    assert ready.chip.valve_pins == 0
    refused = ready.exchange("IN")
    assert (refused.why, refused.has("DEAD_MAN"), refused.valves) == ("NOT_ARMED", True, VENTED)
    assert ready.chip.valve_pins == 0
    again = ready.arm()
    assert (again.has("ARMED"), again.has("DEAD_MAN")) == (True, False)
    assert ready.exchange("IN").valves == wire.valves("IN")


@pytest.mark.parametrize("stall", [0.1, 0.24, 0.26, 3.0])
def test_host_that_stalls_has_to_arm_again(ready: Host, stall: float) -> None:
    ready.exchange("IN", wait=0.005)
    ready.chip.run(stall - 0.005)
    reply = ready.exchange("OUT", "IN")
    if stall < 0.25:
        assert reply.valves == wire.valves("OUT", "IN")
    else:
        assert (reply.why, ready.chip.valve_pins) == ("NOT_ARMED", 0)


def test_dead_man_is_fed_by_exchanges_only(ready: Host) -> None:
    for _ in range(100):
        assert not ready.exchange("IN").has("DEAD_MAN")
    readings = [ready.ask("READ") for _ in range(70)]  # 280 ms
    assert not readings[59].has("DEAD_MAN")
    assert readings[69].has("DEAD_MAN")


def test_over_pressure_is_cut_within_2_ms() -> None:
    times = over_pressure()
    print(
        f"over-pressure: cut {max(times.since_third_sample):.3f} ms after the third sample at most, "
        f"{max(times.since_onset):.2f} ms after its onset"
    )
    assert min(times.since_third_sample) >= 0
    assert max(times.since_third_sample) <= 2
    assert max(times.since_onset) <= 2


@pytest.mark.parametrize("muscle", range(MUSCLES))
def test_over_pressure_is_latched_for_its_muscle(ready: Host, muscle: int) -> None:
    flag = f"OVER_PRESSURE_{muscle + 1}"
    ready.exchange(*["IN"] * MUSCLES)
    ready.chip.set_count(PRESSURES[muscle], LIMIT + 1)
    ready.chip.run(0.001)
    expected = ["IN"] * MUSCLES
    expected[muscle] = "OUT"
    for _ in range(3):
        reply = ready.exchange(*["IN"] * MUSCLES)
        assert (reply.name, reply.has("ARMED"), reply.has(flag)) == ("READING", True, True)
        assert reply.valves == wire.valves(*expected)
        assert ready.chip.valve_pins == wire.pins_of(wire.valves(*expected))
    refused = ready.arm()
    assert (refused.why, refused.has(flag)) == ("CAUSE_REMAINS", True)
    ready.chip.set_count(PRESSURES[muscle], LIMIT)
    assert ready.exchange(*["IN"] * MUSCLES).valves == wire.valves(*expected)  # gone, and still latched
    assert not ready.arm().has(flag)
    assert ready.exchange(*["IN"] * MUSCLES).valves == wire.valves(*["IN"] * MUSCLES)


def test_two_samples_over_the_limit_are_none(ready: Host) -> None:
    """A disturbance of two samples in a row, again and again, does not latch."""
    chip = ready.chip
    chip.log_samples()
    for _ in range(20):
        ready.exchange("IN", wait=0.002)
        chip.samples.clear()
        chip.set_count(1, 1023)
        over = 0
        while over < 2:
            chip.run_until(chip.cycle + 100)
            over = sum(channel == 1 for _, channel in chip.samples)
        chip.set_count(1, 0)
        chip.run(0.001)
    assert not ready.exchange("IN").has("OVER_PRESSURE_1")


def test_at_the_limit_is_not_over_it(ready: Host) -> None:
    for channel in PRESSURES:
        ready.chip.set_count(channel, LIMIT)
    ready.exchange("IN", "IN", "IN", "IN", wait=0.05)
    assert ready.exchange("IN").valves == wire.valves("IN")


def test_a_latch_outlives_the_dead_man_and_a_new_session(ready: Host) -> None:
    ready.exchange("IN")
    ready.chip.set_count(1, 1023)
    ready.chip.run(0.3)
    ready.connect()
    ready.configure()
    assert ready.ask("READ").has("OVER_PRESSURE_1")
    assert ready.ask("READ").has("DEAD_MAN")
    assert ready.arm().why == "CAUSE_REMAINS"
    ready.chip.set_count(1, 0)
    ready.chip.run(0.002)
    assert ready.arm().has("ARMED")


@pytest.mark.parametrize("interrupts", [True, False])
def test_hung_program_is_reset_with_all_outputs_off(interrupts: bool) -> None:
    times = watchdog(repeats=3, interrupts=interrupts)
    print(f"watchdog: outputs off {min(times):.1f} to {max(times):.1f} ms after the hang")
    assert max(times) <= 150


def test_after_a_hang_the_cause_is_told_and_nothing_moves(ready: Host) -> None:
    ready.exchange("IN", "IN")
    resets = len(ready.chip.resets)
    ready.chip.hang()
    ready.chip.run(0.2)
    assert len(ready.chip.resets) == resets + 1
    assert ready.chip.valve_pins == 0
    assert ready.exchange("IN").why == "NOT_CONNECTED"
    hello = ready.connect()
    assert (hello.reset_cause, hello.boots) == (CAUSE["WATCHDOG"], 2)
    assert ready.exchange("IN").why == "NOT_ARMED"
    assert ready.chip.valve_pins == 0
    ready.ready()
    assert ready.exchange("IN").name == "READING"


def test_a_program_whose_tick_has_stopped_is_reset_with_all_outputs_off(ready: Host) -> None:
    """It answers as ever, but the dead-man hangs on the tick."""
    ready.exchange("IN", "IN")
    resets = len(ready.chip.resets)
    ready.chip.poke(TIMSK1, 0)
    for _ in range(30):
        ready.exchange("IN", "IN", wait=0.005)
    assert len(ready.chip.resets) == resets + 1
    assert ready.chip.valve_pins == 0


def test_idle_program_is_not_reset() -> None:
    with Chip() as chip:
        chip.run(2.0)
        assert chip.resets == []


def test_stopped_converter_vents_and_runs_again_when_armed(ready: Host) -> None:
    ready.exchange("IN", "IN")
    known = ready.chip.cycle
    stop_converter(ready.chip)
    ready.chip.run(0.02)
    assert ready.chip.valve_pins == 0
    vented = next(change.cycle for change in ready.chip.changes if change.cycle > known)
    assert (vented - known) / 16_000 < 6
    refused = ready.exchange("IN")
    assert (refused.why, refused.has("CONVERTER")) == ("NOT_ARMED", True)
    assert ready.arm().has("ARMED")  # the tick started it again
    assert not ready.exchange("IN").has("CONVERTER")


def test_converter_that_stays_stopped_lets_nobody_arm(ready: Host) -> None:
    chip = ready.chip
    ready.sequence += 1
    replies = []
    for turn in range(1500):  # whatever is started is stopped before it is done
        if turn == 1000:
            chip.write(wire.request("ARM", ready.sequence, SESSION))
        chip.run_until(chip.cycle + 160)
        stop_converter(chip)
        replies += chip.received()
    reply = wire.reply(bytes(byte for _, byte in replies)[:-1])
    assert (reply.why, reply.has("CONVERTER")) == ("CAUSE_REMAINS", True)
    assert chip.valve_pins == 0


def light_changes(host: Host, seconds: float, *codes: str) -> int:
    """Return how often the light changes in a time in which the dead-man is fed."""
    known = len(host.chip.changes)
    for _ in range(round(seconds / 0.1)):
        host.exchange(*codes, wait=0.1)
    levels = [change.pins & LIGHT for change in host.chip.changes[known - 1 :]]
    return sum(a != b for a, b in pairwise(levels))


def test_light_is_on_while_armed_and_blinks_while_latched(ready: Host) -> None:
    assert light_changes(ready, 1.0, "IN") == 0
    assert ready.chip.pins & LIGHT
    ready.chip.set_count(1, 1023)
    assert 3 <= light_changes(ready, 1.0, "IN") <= 5
    ready.chip.set_count(1, 0)
    ready.chip.run(0.01)
    ready.arm()
    ready.ask("DISARM")
    assert not ready.chip.pins & LIGHT
