"""The board in pure Python keeps the rules of the protocol: the tests of the real .hex run on it too."""

from collections.abc import Iterator

import numpy as np
import pytest
from tests.arm.serial.table_board import EmulatedChip, TableArm, armed
from tests.firmware import test_line, test_pulses, test_requests, test_safety, wire
from tests.firmware.host import SESSION, Host

from pneumarm.arm.serial import EmulatedBoard, board
from pneumarm.arm.serial.protocol import HIGHEST_COUNT, VELOCITY_SCALE, Cause, Flag
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.arm.virtual.parameters import without_noise
from pneumarm.errors import UnusableInput

OF_THE_LINE = {
    "test_frames_split_anywhere",
    "test_frames_one_after_the_other_are_all_answered",
    "test_zeros_between_frames_mean_nothing",
    "test_garbage_of_any_length_costs_itself_only",
    "test_two_thousand_damaged_frames",
}
OF_SAFETY = {
    "test_dead_man_disarms_until_armed_again",
    "test_host_that_stalls_has_to_arm_again",
    "test_dead_man_is_fed_by_exchanges_only",
    "test_over_pressure_is_latched_for_its_muscle",
    "test_at_the_limit_is_not_over_it",
    "test_a_latch_outlives_the_dead_man_and_a_new_session",
    "test_after_a_hang_the_cause_is_told_and_nothing_moves",
}
"""The others look into the chip itself."""
OF_REQUESTS = {name for name in vars(test_requests) if name.startswith("test_")} - {
    "test_firmware_is_the_hash_of_the_sources"
}
OF_PULSES = {name for name in vars(test_pulses) if name.startswith("test_")} - {
    "test_pulses_are_as_long_as_asked_for"
}
for _module, _names in (
    (test_line, OF_THE_LINE),
    (test_safety, OF_SAFETY),
    (test_requests, OF_REQUESTS),
    (test_pulses, OF_PULSES),
):
    globals().update({name: getattr(_module, name) for name in sorted(_names)})


@pytest.fixture(autouse=True)
def _in_place_of_the_chip(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the firmware's tests find this board, which looks as often at its pressures as the firmware does."""
    monkeypatch.setattr(test_line, "armed", armed)
    monkeypatch.setattr(board, "SAMPLE", 0.2e-3)
    monkeypatch.setattr(board, "SELDOM", 0.2e-3)


def test_the_firmware_s_tests_are_not_run_on_the_firmware(ready: Host) -> None:
    assert isinstance(ready.chip, EmulatedChip)
    assert len(OF_REQUESTS) > 25


@pytest.fixture
def host() -> Host:
    return Host(EmulatedChip())


@pytest.fixture
def ready() -> Iterator[Host]:
    with armed() as host:
        yield host


def test_dead_man_vents_at_250_ms(ready: Host) -> None:
    ready.exchange("IN")
    begun = ready.begun
    ready.chip.run(0.3)
    assert (ready.chip.changes[-1].cycle - begun) / 16e3 == pytest.approx(250, abs=1e-3)
    assert ready.chip.valve_pins == 0


def test_watchdog_vents_within_150_ms(ready: Host) -> None:
    ready.exchange("IN")
    hung = ready.chip.cycle
    ready.chip.hang()
    ready.chip.run(0.3)
    vented = next(change for change in ready.chip.changes if change.cycle > hung)
    assert vented.pins == 0
    assert (vented.cycle - hung) / 16e3 <= 150


def test_two_samples_over_the_limit_are_none(ready: Host) -> None:
    ready.exchange("IN")
    for _ in range(20):
        ready.chip.set_count(1, HIGHEST_COUNT)
        ready.chip.run(2 * board.SAMPLE)
        ready.chip.set_count(1, 0)
        ready.chip.run(2 * board.SAMPLE)
    assert not ready.exchange("IN").has("OVER_PRESSURE_1")


def test_velocity_is_the_change_over_the_time_asked(host: Host) -> None:
    host.ready(velocity_ms=16)
    for count in range(100, 180):  # one count a millisecond
        host.chip.set_count(0, count)
        host.chip.set_count(3, 1000 - 2 * count)
        host.chip.run(1e-3)
        host.exchange() if count % 50 == 0 else None
    velocity = host.ask("READ", wait=0.0).velocity
    assert np.array(velocity) / VELOCITY_SCALE == pytest.approx([1.0, -2.0], abs=0.15)


def test_more_joints_than_pins_are_refused() -> None:
    with pytest.raises(UnusableInput, match="pins for 2 joints"):
        EmulatedBoard(TableArm(joints=3))


def test_a_muscle_that_fills_is_cut_off_soon_after_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with the few looks that the board takes by default, on an arm with real pneumatics."""
    monkeypatch.undo()
    arm = VirtualArm(without_noise(draw_parameters(3)))
    emulated = EmulatedBoard(arm)
    limit = 100
    limits = [limit, *[HIGHEST_COUNT] * (wire.CONSTANT["MUSCLES"] - 1)]
    requests = [("CONNECT", wire.CONSTANT["VERSION"], SESSION), ("CONFIGURE", 5, 16, *limits), ("ARM", SESSION)]
    requests += [("EXCHANGE", wire.valves("IN"))] * 20
    for sequence, (name, *values) in enumerate(requests):
        emulated.receive(wire.request(name, sequence, *values))
        while emulated.armed and emulated.time < 0.1 * sequence and not emulated._flags & Flag.OVER_PRESSURE_1:
            emulated.run_until(emulated.time + 0.2e-3)
            assert arm.read().pressure[0, 0] < limit + 5
    assert emulated._flags & Flag.OVER_PRESSURE_1
    emulated.run_until(emulated.time + 0.2)
    assert arm.read().pressure[0, 0] < limit - 5  # vented


def test_reset_causes_and_boots_are_told() -> None:
    chip = EmulatedChip()
    chip.board.reset(Cause.BROWN_OUT)
    hello = Host(chip).connect()
    assert (hello.reset_cause, hello.boots) == (wire.CAUSE["BROWN_OUT"], 2)
