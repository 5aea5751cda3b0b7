"""Arms without pressure sensors: what is estimated in their place, and what they ask of a person."""

from dataclasses import replace

import numpy as np
import pytest
from tests.plain_arms import angle_alone

from pneumarm.arm import Arm, ArmSpec, GuardedArm, Reading, guarded, open_arm
from pneumarm.arm.fill import PressureEstimate, estimated_pressures
from pneumarm.arm.seam import check_pressures
from pneumarm.arm.virtual import VirtualArm
from pneumarm.errors import UnusableInput
from pneumarm.transitions import Store, collect

SPEC = ArmSpec(pressure_sensors=False, safe_supply=True)


class Still(Arm):
    """An arm whose clock is all that moves."""

    def __init__(self, spec: ArmSpec = SPEC) -> None:
        self.spec, self.time, self.closed = spec, 0.0, False

    def read(self) -> Reading:
        return Reading(self.time, np.full(self.spec.joints, 500.0))

    def set_valves(self, valves: np.ndarray) -> None:
        pass

    def wait(self, seconds: float) -> None:
        self.time += seconds

    def close(self) -> None:
        self.closed = True


def test_an_arm_whose_supply_nobody_vouches_for_is_refused_and_closed():
    arm = Still(replace(SPEC, safe_supply=False))
    with pytest.raises(UnusableInput, match="safe_supply = true"):
        guarded(arm)
    assert arm.closed


def test_a_muscle_is_filled_and_emptied_in_the_times_of_the_spec():
    fill = PressureEstimate(replace(SPEC, fill_times=(0.8, 0.5), max_pressure=1.2))
    full = 1.2 * SPEC.counts_per_bar
    fill.pass_until(0.0)
    fill.command(np.array([[1, 0]], np.int8))
    rises = []
    for time in (0.2, 0.4, 0.6, 0.8):
        fill.pass_until(time)
        rises.append(fill.pressure[0, 0])
    assert rises[-1] == pytest.approx(full)
    assert (np.diff([0.0, *rises]) > 0).all()
    assert (np.diff(np.diff([0.0, *rises])) < 0).all()  # slower and slower, as towards the supply
    fill.pass_until(3.0)
    assert fill.pressure[0].tolist() == pytest.approx([full, 0.0])
    fill.command(np.array([[-1, 0]], np.int8))
    fill.pass_until(3.49)
    assert 0.0 < fill.pressure[0, 0] < 0.01 * full
    fill.pass_until(3.51)
    assert fill.pressure[0, 0] == pytest.approx(0.0, abs=1e-9)


def test_time_passes_alike_in_one_step_or_in_many_and_pulses_end_by_themselves():
    steps, whole = PressureEstimate(SPEC), PressureEstimate(SPEC)
    for fill, times in ((steps, np.linspace(0.0, 0.3, 61)), (whole, [0.0, 0.3])):
        fill.pass_until(0.0)
        fill.command(np.array([[0.5, 1.0]]))
        for time in times:
            fill.pass_until(time)
    assert steps.pressure == pytest.approx(whole.pressure, rel=1e-9)
    half = PressureEstimate(SPEC)
    half.pass_until(0.0)
    half.command(np.array([[1, 0]], np.int8))
    half.pass_until(0.5 * SPEC.period)
    assert whole.pressure[0, 0] == pytest.approx(half.pressure[0, 0], rel=1e-9)


def test_a_pulse_that_the_guard_times_fills_as_one_that_the_arm_times():
    class Timing(Still):
        def set_pulses(self, command: np.ndarray) -> bool:
            return True

    found = []
    for arm in (Still(), Timing()):
        guard = GuardedArm(arm)
        guard.read()
        guard.decide(np.array([[0.4, -1.0]]))
        guard.wait(0.2)
        found.append(guard.read().pressure)
    assert found[0][0, 0] > 1
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_a_guard_that_comes_later_goes_on_with_the_estimates():
    arm = Still()
    first = GuardedArm(arm)
    first.read()
    first.set_valves([[1, 0]])
    first.wait(0.3)
    first.set_valves([[0, 0]])
    known = first.read().pressure
    assert known[0, 0] > 20
    assert GuardedArm(arm).read().pressure.tolist() == known.tolist()
    assert GuardedArm(Still()).read().pressure.tolist() == [[0.0, 0.0]]


def test_estimates_are_near_to_the_true_pressures_of_a_virtual_arm():
    arm = open_arm("virtual:seed=3,pressure_sensors=off")
    assert isinstance(arm, VirtualArm)
    assert arm.read().pressure.size == 0
    guard, random, errors, spread = guarded(arm), np.random.default_rng(0), [], []
    guard.read()
    for _ in range(300):
        guard.set_valves(random.integers(-1, 2, (1, 2)))
        guard.wait(0.1)
        estimated = guard.read().pressure / arm.spec.counts_per_bar
        errors.append(estimated - 1e-5 * arm.pressure)
        spread.append(1e-5 * arm.pressure)
    # The default times are not this arm's, and a tenth of a bar is what compression alone does.
    assert np.std(errors) < 0.5 * np.std(spread)


def test_a_supply_over_what_the_muscles_bear_is_turned_down():
    strong = open_arm("virtual:preset=C,pressure_sensors=off")
    assert isinstance(strong, VirtualArm)
    assert strong.parameters.air.supply <= strong.parameters.max_pressure
    assert strong.spec.safe_supply


def test_a_recording_of_commands_gives_the_estimates_of_the_arm_that_made_it(tmp_path):
    arm = angle_alone()
    with Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
        collect(arm, store, 2000, seed=3)
        rows = next(iter(store.blocks()))
    one = rows.where(rows.sequence == 1)
    again = estimated_pressures(arm.spec, one.time, one.command)
    # It began with some air, which a muscle that was full or vented once has forgotten.
    forgotten = ((one.pressure == 0) | (one.pressure > 0.999 * arm.spec.max_pressure_counts)).cumsum(axis=0) > 0
    assert forgotten.any(axis=(0, 1)).any()
    assert again[forgotten] == pytest.approx(one.pressure[forgotten], abs=2.0)


def test_what_was_made_with_pressures_is_not_used_without_them():
    with pytest.raises(UnusableInput, match="with pressure sensors, arm is one without"):
        check_pressures(ArmSpec(), SPEC, "this agent was trained")
    with pytest.raises(UnusableInput, match="fill_times"):
        check_pressures(SPEC, replace(SPEC, fill_times=(1.6, 1.0)), "this agent was trained")
    check_pressures(SPEC, SPEC, "this agent was trained")


def test_the_option_of_a_name_is_on_or_off():
    assert open_arm("virtual:seed=3,pressure_sensors=on").spec.pressure_sensors
    with pytest.raises(UnusableInput, match="on or off"):
        open_arm("virtual:seed=3,pressure_sensors=no")
