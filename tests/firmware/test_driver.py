"""pneumarm's own driver on the unmodified firmware, in lock-step: what holds of any arm holds of this one."""

import sys
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import ControlCycle, Reading, guarded
from pneumarm.arm.seam import checked
from pneumarm.arm.serial import FaultyLine, LineFaults, SerialArm
from pneumarm.arm.serial.protocol import OLDEST_VERSION
from pneumarm.arm.virtual import VirtualArm, draw_parameters, usual_sensors
from pneumarm.arm.virtual.further import THERMOMETER
from pneumarm.control import Monitor, TransferSettings, transfer
from pneumarm.errors import ArmFailure, LineLost
from pneumarm.learning import Agent
from pneumarm.task.movements import join_movements
from pneumarm.transitions import CollectBegin, CollectSettings, Store, collect
from tests.arm.serial.table_board import TableArm
from tests.firmware.board import SimulatedBoard, single_conversions, valves_of
from tests.firmware.build import missing
from tests.firmware.chip import FREQUENCY
from tests.firmware.line import SimulatedLine

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
LATEST_CLOSING = 50e-6
"""By how much a pulse may be longer or shorter than asked for [s]."""
LONGEST_EXCHANGE = 2e-3
"""Time that a request may take on the board's clock [s]."""


@pytest.fixture
def arm() -> Iterator[SerialArm]:
    """Give arm 3 behind the real firmware."""
    inner = single_conversions(VirtualArm(draw_parameters(3)), seed=1)
    with SerialArm(SimulatedLine(SimulatedBoard(inner)), replace(inner.spec, name="firmware")) as arm:
        yield arm


def every(value: int) -> NDArray[np.int8]:
    return np.full((1, 2), value, np.int8)


def test_time_passes_by_waiting_and_a_little_by_asking(arm: SerialArm) -> None:
    begin = checked(arm.read(), arm.spec).time
    assert begin < arm.read().time < begin + 2 * LONGEST_EXCHANGE
    arm.wait_until(begin + 0.4)
    assert begin + 0.4 <= arm.read().time < begin + 0.4 + 2 * LONGEST_EXCHANGE


def test_further_sensors_come_through_their_channels() -> None:
    """A velocity of the firmware's own samples, and thermometers on the two extra channels, each on its own."""
    sensors = usual_sensors(["temperature"])[1]
    bare = VirtualArm(draw_parameters(3), velocity_sensor=True, sensors=sensors)
    inner = single_conversions(bare, seed=1)
    inner.body.muscles["temperature"] = [[15.0, 35.0]]
    with SerialArm(SimulatedLine(SimulatedBoard(inner)), replace(inner.spec, name="firmware")) as arm:
        arm.wait(0.05)
        arm.set_valves(np.array([[1, -1]], np.int8))
        arm.wait(0.15)
        before, speed = arm.read(), []
        for _ in range(8):
            arm.wait(0.01)
            reading = checked(arm.read(), arm.spec)
            assert reading.velocity is not None
            assert reading.temperature is not None
            speed.append(reading.velocity[0])
        expected = (reading.angle - before.angle) / (1e3 * (reading.time - before.time))
        assert abs(expected[0]) > 0.3
        assert np.mean(speed) == pytest.approx(expected[0], rel=0.3)
        assert reading.temperature == pytest.approx(inner.temperature, abs=2 * THERMOMETER)


def test_each_muscle_obeys_its_own_valve_and_holds(arm: SerialArm) -> None:
    for muscle in range(2):
        arm.set_valves(every(-1))
        arm.wait(1.5)
        valves = every(0)
        valves[0, muscle] = 1
        before = arm.read()
        arm.set_valves(valves)
        arm.wait(0.4)  # longer than the dead-man waits
        after = arm.read()
        change = (after.pressure - before.pressure)[0]
        assert change[muscle] > 30
        assert np.argmax(change) == muscle
        assert np.sign(after.angle - before.angle)[0] == (1 if muscle == 0 else -1)
        arm.set_valves(every(0))
        arm.wait(0.3)
        assert arm.read().pressure[0, muscle] == pytest.approx(after.pressure[0, muscle], abs=12)


@pytest.mark.parametrize("rate", [30, 100])
def test_the_cycle_keeps_its_period(arm: SerialArm, rate: int) -> None:
    arm.spec = replace(arm.spec, period=1 / rate)
    cycle, turns = ControlCycle(guarded(arm)), iter(range(rate))
    steps = list(cycle.run(lambda reading: None if next(turns, None) is None else every(0)))
    times = np.array([step.reading.time for step in steps])
    assert len(times) == rate + 1
    assert times - times[0] == pytest.approx(np.arange(rate + 1) / rate, abs=LONGEST_EXCHANGE)
    assert cycle.missed_deadlines == 0


def test_an_arm_that_nobody_moved_is_vented_and_made_ready(arm: SerialArm) -> None:
    assert arm.get_state() is None
    arm.set_valves(every(1))
    board = arm._line.board  # type: ignore[attr-defined]
    board.wait(0.3)
    assert board.chip.valve_pins == 0
    with pytest.raises(ArmFailure, match="heard nothing for a quarter of a second"):
        arm.set_valves(every(1))
    arm.make_ready()
    arm.set_valves(every(1))
    assert board.chip.valve_pins != 0


def test_collecting_and_moving(
    arm: SerialArm, small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two minutes, the least that is allowed, would be too long for a test.
    monkeypatch.setattr(sys.modules["pneumarm.transitions.collect"], "FEWEST_TRANSITIONS", 120)
    quick = CollectSettings(actions=60, begin=CollectBegin(deflate=0.5, inflate=0.5, settle=0.3))
    watch = Monitor(arm.spec)
    agent = Agent.load(small_run / "agent.safetensors")
    with Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
        collected = collect(arm, store, 120, settings=quick, watch=watch)
        settings = TransferSettings(episodes=0, test_episodes=1)
        moved = transfer(agent, arm, store, settings, seed=1)
        store.check()
    assert (collected.transitions, collected.missed_deadlines) == (120, 0)
    assert watch.findings == []
    made = join_movements(moved.movements.values())
    assert made.n == 2
    assert (made.success | (made.actions == agent.settings.cutoff)).all()


def in_motion(arm: SerialArm, turns: int = 10) -> SimulatedBoard:
    """Have the arm move for some control periods; give the board."""
    for turn in range(turns):
        begun = arm.read().time
        arm.set_valves(every(1 if turn % 2 else -1))
        arm.wait_until(begun + arm.spec.period)
    arm.set_valves(every(1))
    return arm._line.board  # type: ignore[attr-defined,no-any-return]


def until_failure(arm: SerialArm) -> tuple[float, str]:
    """Go on in the control cycle; return how long [s] until it failed, and why."""
    begun = arm._line.now()
    turns = ControlCycle(guarded(arm)).run(lambda reading: every(1))
    with pytest.raises(ArmFailure) as failed:
        deque(islice(turns, 100), maxlen=0)
    return arm._line.now() - begun, str(failed.value)


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        ("EXTERNAL", "reset pin"),
        ("BROWN_OUT", "supply too low"),
        ("POWER_ON", "power on"),
        ("WATCHDOG", "its program hung"),
    ],
)
def test_board_that_restarts_in_an_episode(arm: SerialArm, cause: str, words: str) -> None:
    """It is vented and told of; the host shakes hands again within 2 s, and its readings' times stay true."""
    board = in_motion(arm)
    before, happened = arm.read().time, board.time
    if cause == "WATCHDOG":
        board.chip.hang()
    else:
        board.reset(cause)
    took, why = until_failure(arm)
    board.wait_until(max(board.time, happened + 0.15))
    assert board.chip.valve_pins == 0
    assert f"restarted while in use ({words})" in why
    silent = 0.15 if cause == "WATCHDOG" else 0.0  # at first; its watchdog is quicker than the host gives up
    assert took <= silent + 2 * arm.spec.period + LONGEST_EXCHANGE
    with pytest.raises(ArmFailure):
        arm.make_ready()
    assert board.chip.valve_pins == 0
    begun = board.time
    arm.rearm()
    assert board.time - begun < 2
    assert arm.reset_causes() == [words]
    # The board restarted; readings go on in the host's time.
    for _ in range(30):
        sent = board.time
        reading = arm.read()
        assert before < sent <= reading.time <= board.time
        arm.set_valves(every(1))
        arm.wait(0.1)
    assert board.chip.valve_pins != 0


def test_controller_s_clock_wraps_in_an_episode(arm: SerialArm) -> None:
    """As after an hour and eleven minutes: readings go on in the host's time, period by period."""
    board = in_motion(arm)
    board.chip.set_variable("ticks_us", (1 << 32) - 500_000)
    arm.rearm()  # a new session, with a new map of the clock
    readings, raw = [], []
    for _ in range(40):
        sent = board.time
        readings.append(arm.read().time)
        raw.append(board.chip.variable("ticks_us"))
        assert sent <= readings[-1] <= board.time
        arm.set_valves(every(0))
        arm.wait_until(readings[-1] + arm.spec.period)
    assert min(raw) < 1_000_000 < 4_000_000_000 < max(raw)
    assert np.diff(readings) == pytest.approx(arm.spec.period, abs=LONGEST_EXCHANGE)


def test_board_that_is_unplugged_and_plugged_in_again(arm: SerialArm) -> None:
    """Row 1 on the real firmware: vented by the dead-man; nothing moves until it is armed again."""
    board = in_motion(arm)
    fed = board.time
    line = arm._line
    arm.link.line = gone = FaultyLine(line)
    gone.unplugged = True
    with pytest.raises(ArmFailure, match="gone"):
        arm.read()
    board.wait_until(fed + 0.251)
    assert board.chip.valve_pins == 0
    gone.unplugged = False
    for use in (arm.read, arm.make_ready, lambda: arm.set_valves(every(1))):
        with pytest.raises(ArmFailure, match="gone"):
            use()
    board.wait(0.5)
    assert board.chip.valve_pins == 0
    begun = board.time
    arm.rearm()
    assert board.time - begun < 2
    arm.set_valves(every(1))
    assert board.chip.valve_pins != 0


@pytest.mark.parametrize("meanwhile", ["nothing", "POWER_ON", "EXTERNAL", "WATCHDOG", "BROWN_OUT"])
def test_what_is_done_with_the_arm_goes_on_after_a_plug_was_out(arm: SerialArm, meanwhile: str) -> None:
    """On the real firmware, whose count of restarts is in its EEPROM; one that restarted by itself is not armed."""
    guard, attempts = guarded(arm), []
    board = in_motion(arm)
    arm.link.line = gone = FaultyLine(arm._line)
    arm._line = gone

    def work() -> None:
        attempts.append(board.time)
        guard.make_ready()
        guard.set_valves(every(1))
        if len(attempts) == 1:
            gone.unplugged = True
            with pytest.raises(LineLost):
                guard.read()
            board.wait(0.251)
            assert board.chip.valve_pins == 0
            if meanwhile == "WATCHDOG":
                board.chip.hang()
                board.wait(0.2)
            elif meanwhile != "nothing":
                board.reset(meanwhile)
            gone.unplugged = False
        guard.wait(0.4)

    if meanwhile in ("WATCHDOG", "BROWN_OUT"):
        with pytest.raises(ArmFailure, match="restarted by itself"):
            guard.despite_losses(work)
        assert board.chip.valve_pins == 0
    else:
        guard.despite_losses(work)
        assert len(attempts) == 2
        assert board.chip.valve_pins != 0


def pulses_at_the_pins(board: SimulatedBoard, since: int, muscle: int) -> list[float]:
    """Return the pulses of a muscle since a change of the pins, out being negative [s]."""
    steps = [
        (change.cycle, valves_of(change.pins & 0xFF, 2).ravel()[muscle]) for change in board.chip.changes[since:]
    ]
    steps = [now for before, now in pairwise([(0, 0), *steps]) if now[1] != before[1]]
    return [int(valve) * (end - begin) / FREQUENCY for (begin, valve), (end, _) in pairwise(steps) if valve]


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_pulses_of_two_joints_are_those_of_the_controller(lost: float) -> None:
    """On the real firmware, also where every third frame is lost each way."""
    table = TableArm(joints=2)
    line = FaultyLine(SimulatedLine(board := SimulatedBoard(table)))
    with SerialArm(line, replace(table.spec, name="firmware")) as arm:
        since = len(board.chip.changes)
        line.faults = LineFaults(dropped=lost, seed=2)
        rng, turns = np.random.default_rng(1), iter(range(25))

        def decide(reading: Reading) -> NDArray[np.float64] | None:
            sign = rng.choice([-1.0, 1.0], (2, 2))
            return None if next(turns, None) is None else sign * rng.uniform(0.1, 0.4, (2, 2))

        steps = ControlCycle(guarded(arm)).run(decide)
        applied = np.array([step.valves for step in steps if step.valves is not None])
        line.faults = LineFaults()
        for muscle in range(4):
            expected = applied.reshape(-1, 4)[:, muscle] * arm.spec.period
            assert pulses_at_the_pins(board, since, muscle) == pytest.approx(expected, abs=LATEST_CLOSING)


def test_an_arm_fills_by_pulses_as_by_whole_periods(arm: SerialArm) -> None:
    """Ten periods of half a pulse let in as much air as five whole ones, with what the valves take to switch."""

    def filled(share: float, turns: int) -> NDArray[np.float64]:
        """Return the pressures after so many periods."""
        arm.set_valves(every(-1))
        arm.wait(1.5)
        arm.set_valves(every(0))
        left = iter(range(turns))
        cycle = ControlCycle(guarded(arm)).run(lambda _: None if next(left, None) is None else np.full((1, 2), share))
        deque(cycle, maxlen=0)
        arm.wait(0.3)
        return arm.read().pressure[0]

    assert filled(0.5, turns=10) == pytest.approx(filled(1.0, turns=5), rel=0.2)


def test_an_older_firmware_s_host_and_this_board_understand_each_other(arm: SerialArm, monkeypatch: Any) -> None:
    monkeypatch.setattr("pneumarm.arm.serial.arm.VERSION", OLDEST_VERSION)
    arm.rearm()
    assert arm.version == OLDEST_VERSION
    assert not arm.set_pulses(np.full((1, 2), 0.5))
    arm.set_valves(every(1))
    assert arm._line.board.chip.valve_pins & 0b1111 == 0b1111  # type: ignore[attr-defined]
