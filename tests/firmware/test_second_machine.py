"""The same .hex in a second, independent machine: the firmware's own tests once more, and both beside each other."""

import random
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.firmware import test_pulses, test_requests, test_safety, wire
from tests.firmware.chip import Chip
from tests.firmware.host import LIMIT, Host
from tests.firmware.second_machine import SecondChip, missing
from tests.firmware.wire import CAUSE, CODE, CONSTANT

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
OF_SAFETY = {
    "test_exhaust_opens_after_its_inlet_has_closed",
    "test_dead_man_disarms_until_armed_again",
    "test_host_that_stalls_has_to_arm_again",
    "test_dead_man_is_fed_by_exchanges_only",
    "test_over_pressure_is_latched_for_its_muscle",
    "test_at_the_limit_is_not_over_it",
    "test_a_latch_outlives_the_dead_man_and_a_new_session",
    "test_after_a_hang_the_cause_is_told_and_nothing_moves",
    "test_light_is_on_while_armed_and_blinks_while_latched",
}
OF_REQUESTS = {name for name in vars(test_requests) if name.startswith("test_")}
OF_PULSES = {name for name in vars(test_pulses) if name.startswith("test_")} - {
    "test_pulses_are_as_long_as_asked_for"
}
for _module, _names in ((test_safety, OF_SAFETY), (test_requests, OF_REQUESTS), (test_pulses, OF_PULSES)):
    globals().update({name: getattr(_module, name) for name in sorted(_names)})


@contextmanager
def armed(**configuration: int) -> Iterator[Host]:
    """Give a host with an armed board, all valves closed, nothing at its inputs."""
    with SecondChip() as chip:
        yield Host(chip).ready(**configuration)  # type: ignore[arg-type]


@pytest.fixture
def host() -> Iterator[Host]:
    with SecondChip() as chip:
        yield Host(chip)  # type: ignore[arg-type]


@pytest.fixture
def ready() -> Iterator[Host]:
    with armed() as host:
        yield host


def conversation(chip: Chip | SecondChip, seed: int) -> tuple[list[object], list[int]]:
    """Ask a board the same as another one; return its replies, without their times, and the levels of its pins."""
    rng = random.Random(seed)
    host = Host(chip)  # type: ignore[arg-type]
    host.ready()
    replies: list[object] = []
    names = list(CODE)
    for turn in range(150):
        what = rng.random()
        if what < 0.1:
            chip.set_count(rng.randrange(8), rng.choice((0, 300, LIMIT, LIMIT + 1)))
            chip.run(0.05)
        elif what < 0.15:
            chip.run(0.3)
        elif what < 0.3:
            for channel in range(8):
                chip.set_count(channel, rng.randrange(LIMIT))
            chip.run(0.005)
            host.arm()
        elif what < 0.33:
            chip.reset(rng.choice(["EXTERNAL", "BROWN_OUT"]))
            chip.run(0.02)
            host.forget()
            host.connect()
            host.configure()
            host.arm()
        sequence = None if rng.random() < 0.9 else (host.sequence + rng.choice((-5, 0))) & 0xFFFF
        kind = rng.choice(("EXCHANGE", "PULSE", "READ", "DISARM" if turn % 30 == 0 else "READ"))
        values = []
        if kind in ("EXCHANGE", "PULSE"):
            values = [wire.valves(*rng.choices(names, k=CONSTANT["MUSCLES"]))]
        if kind == "PULSE":
            # None ends while a reply is made, which the two may do at slightly different times.
            lengths = rng.choices((20, 2_000, CONSTANT["HOLD"]), k=CONSTANT["MUSCLES"])
            values = [rng.randrange(3), *values, *lengths]
        reply = host.ask(kind, *values, sequence=sequence)
        told = None if reply is None else {k: v for k, v in reply.values.items() if k not in ("time", "velocity")}
        replies.append((turn, None if reply is None else reply.name, told))
    return replies, [change.pins & 0xFF for change in chip.changes]


@pytest.mark.parametrize("seed", range(3))
def test_both_machines_say_and_do_the_same(seed: int) -> None:
    with Chip() as one, SecondChip() as other:
        first, second = conversation(one, seed), conversation(other, seed)
    assert first[0] == second[0]
    assert first[1] == second[1]
    assert len({str(reply[2]) for reply in first[0]}) > 50  # type: ignore[index]


@pytest.mark.parametrize("interrupts", [True, False])
def test_hung_program_is_reset_with_all_outputs_off(ready: Host, interrupts: bool) -> None:
    ready.exchange("IN", "IN", "IN", "IN")
    begun = ready.chip.cycle
    ready.chip.hang(interrupts=interrupts)
    ready.chip.run(0.2)
    off = next(change.cycle for change in ready.chip.changes if change.cycle > begun and change.pins & 0xFF == 0)
    assert (off - begun) / 16e3 <= 150
    ready.forget()
    assert ready.connect().reset_cause == CAUSE["WATCHDOG"]
