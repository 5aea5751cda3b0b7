"""No sound arm is refused, whatever its physics: not while collecting, and no row of it is marked."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import Arm, ArmSpec, Reading, guarded, open_arm
from pneumarm.arm.virtual import StuckValve, SwappedMuscles, SwappedValves, VirtualArm, draw_wide
from pneumarm.control import Monitor
from pneumarm.control.monitor.hypotheses import TORN, hypotheses, time_open, times_opened
from pneumarm.errors import ArmFailure
from pneumarm.transitions import Store, collect

PRESSURES = [f"python:tests.plain_arms:{name}" for name in ("linear", "throttled", "hose")]
PLAIN = [*PRESSURES, "python:tests.plain_arms:angle_alone"]
STICKING = [f"python:tests.friction_arms:{name}" for name in ("joint_1", "joint_2", "joints_1")]

BREAKS = 200.0
"""When a sound arm breaks [s]; until then it was filled, emptied and watched for two minutes."""


class Broken(Arm):
    """A sound arm whose readings or commands are spoiled from a time on."""

    def __init__(self, arm, begin, pressures=lambda p: p, valves=lambda v: v):
        self.arm, self.spec, self.begin = arm, arm.spec, begin
        self.pressures, self.valves, self.now = pressures, valves, 0.0

    def read(self):
        reading = self.arm.read()
        self.now = reading.time
        if self.now >= self.begin:
            return replace(reading, pressure=self.pressures(reading.pressure.copy()))
        return reading

    def set_valves(self, valves):
        self.arm.set_valves(self.valves(np.array(valves)) if self.now >= self.begin else valves)

    def wait(self, seconds):
        self.arm.wait(seconds)

    def close(self):
        self.arm.close()


def stuck(valves):
    valves[0, 0] = min(valves[0, 0], 0)
    return valves


def dead(pressure):
    pressure[0, 1] = 7.0
    return pressure


@pytest.mark.parametrize("name", [*PLAIN, *STICKING, *(f"virtual:wide,seed={seed}" for seed in (2, 6, 9, 6228))])
def test_a_sound_arm_is_collected_from_without_a_mark(name, tmp_path):
    arm = open_arm(name)
    watch, enough = Monitor(arm.spec), 3_000 if name in STICKING else 6_000  # Python computes these slowly
    with Store.for_arm(tmp_path / "db", arm.spec) as store:
        result = collect(arm, store, enough, 1, watch=watch)
    assert watch.findings == []
    assert result.marked == {}
    assert result.transitions >= enough


def test_a_muscle_that_is_stretched_and_reads_less_than_an_empty_one_is_no_fault(tmp_path):
    arm = open_arm("python:benchmarks.strangers:two_1003")
    watch = Monitor(arm.spec)
    with Store.for_arm(tmp_path / "db", arm.spec) as store:
        assert collect(arm, store, 3_000, 0, watch=watch).marked == {}


def test_an_angle_that_stays_at_an_end_is_no_fault(tmp_path):
    arm = open_arm("virtual:wide,seed=7304", 7304)  # its angle has 9 bits
    watch = Monitor(arm.spec)
    with Store.for_arm(tmp_path / "db", arm.spec) as store:
        assert collect(arm, store, 4_000, 7304, watch=watch).marked == {}


@pytest.mark.parametrize("name", PRESSURES)
def test_a_fault_of_any_arm_is_what_differs_from_this_arm(name, tmp_path):
    arm = Broken(open_arm(name), BREAKS, valves=stuck)
    watch = Monitor(arm.spec)
    with Store.for_arm(tmp_path / "db", arm.spec) as store, pytest.raises(ArmFailure) as stopped:
        collect(arm, store, 12_000, 1, watch=watch)
    first = watch.findings[0]
    assert (first.joint, first.muscle) == (1, 1)
    assert first.noticed > BREAKS
    if name == PRESSURES[1]:  # fills so slowly that it takes minutes; an empty muscle does not answer either
        assert first.kind in ("stuck-valve", "no-answer")
    else:
        assert first.kind == "stuck-valve"
        assert BREAKS - 10 <= first.since <= BREAKS + 20
    for said in ("judged against what this arm itself did", "--monitor warn"):
        assert said in str(stopped.value)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Broken(open_arm(PLAIN[0]), 0.0, pressures=dead), "reads one constant while valves act"),
        (lambda: VirtualArm(draw_wide(2), seed=3, faults=[SwappedValves()]), "outlet are swapped"),
        (lambda: VirtualArm(draw_wide(2), seed=3, faults=[SwappedMuscles()]), "valves are those of"),
    ],
)
def test_what_no_sound_arm_does_is_wrong_from_the_start(make, said, tmp_path):
    arm = make()
    with Store.for_arm(tmp_path / "db", arm.spec) as store, pytest.raises(ArmFailure, match=said):
        collect(arm, store, 10_000, 1, watch=Monitor(arm.spec))


def test_a_valve_that_is_stuck_open_is_open_beside_the_other_and_never_opens():
    found, readings = hypotheses(1)
    by_detail = {(one.detail, one.muscle): h for h, one in enumerate(found) if not readings.leak[h].any()}
    stuck_open = by_detail["the outlet is stuck open, or the hose is off", 1]
    filling, emptying = (1.0, 0.0), (0.0, 1.0)
    assert [time_open(readings, stuck_open, 0, valve, *filling) for valve in (0, 1)] == [1.0, 1.0]
    assert time_open(readings, stuck_open, 0, 1, 0.0, 0.0) == 1.0
    assert times_opened(readings, stuck_open, 0, 1, 2, 3) == 0.0
    assert times_opened(readings, stuck_open, 0, 0, 2, 3) == 2.0
    assert time_open(readings, stuck_open, 1, 1, *filling) == 0.0  # the other muscle is sound
    swapped = by_detail["inlet and outlet are swapped", 1]
    assert [time_open(readings, swapped, 0, valve, *emptying) for valve in (0, 1)] == [1.0, 0.0]
    assert times_opened(readings, swapped, 0, 0, 2, 3) == 3.0


def test_evidence_of_torn_hoses_fades_where_nothing_adds_to_it():
    spec = ArmSpec()
    monitor = Monitor(spec)
    _, readings = hypotheses(1)
    begun = 10.0
    monitor._memory.score[1:] = begun
    reading = Reading(0.0, np.array([500.0]), np.array([[60.0, 60.0]]))
    seconds = 6.0
    for step in range(round(seconds / spec.period)):  # too few for an arm to be judged by
        monitor.see(replace(reading, time=step * spec.period), np.zeros((1, 2)))
    torn = (readings.leak >= TORN).any(axis=1)
    assert torn.sum() == 4
    for score, fades in zip(monitor._memory.score[1:], torn[1:], strict=True):
        assert score == pytest.approx(begun * np.exp(-1) if fades else begun, rel=0.01)


@pytest.mark.parametrize("mode", ["warn", "off"])
def test_a_monitor_that_only_warns_or_is_off_stops_nothing_and_marks_nothing(mode, tmp_path):
    arm = VirtualArm(draw_wide(2), seed=3, faults=[StuckValve(begin=60.0)])
    watch = Monitor(arm.spec, mode=mode)
    with Store.for_arm(tmp_path / "db", arm.spec) as store:
        result = collect(guarded(arm), store, 4_000, 1, watch=watch)
    assert result.transitions >= 4_000
    assert result.marked == {}
    assert bool(watch.findings) == (mode == "warn")
