"""One contract for every arm: whatever stands behind the seam, the same may be relied on."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import Arm, ArmSpec, ControlCycle, GuardedArm, Reading, guarded
from pneumarm.arm.fill import EstimatedArm
from pneumarm.arm.seam import checked
from pneumarm.arm.serial import BoardLine, EmulatedBoard, SerialArm
from pneumarm.arm.virtual import VirtualArm, draw_parameters, preset_parameters
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.simulation import SimulationArm
from simple_simulation import QUIET, simulation


def emulated(arm):
    """Return ``arm`` behind the emulated board."""
    return SerialArm(BoardLine(EmulatedBoard(arm)), arm.spec)


def angle_alone_simulation():
    """Return a simulation of an arm without pressure sensors."""
    made = replace(simulation(), commands="pulses")
    return replace(made, spec=replace(made.spec, pressure_sensors=False, safe_supply=True))


def single_simulation():
    """Return a simulation of an arm with one muscle a joint."""
    made = replace(simulation(), commands="pulses")
    return replace(made, spec=replace(made.spec, muscles=1))


def punctual(parameters):
    """Return the parameters of an arm whose host is never late: its waits end when they should."""
    return replace(parameters, jitter=0.0)


ARMS = {
    "emulated": lambda smallest: emulated(VirtualArm(punctual(draw_parameters(7)), seed=1)),
    "emulated, a user's with two joints": lambda smallest: emulated(smallest(joints=2)),
    "virtual": lambda smallest: VirtualArm(seed=1),
    "virtual, supply of 2 bar": lambda smallest: VirtualArm(preset_parameters("C"), seed=1),
    "virtual, drawn": lambda smallest: VirtualArm(draw_parameters(7), seed=1, name="virtual:seed=7"),
    "virtual, angle alone": lambda smallest: EstimatedArm(VirtualArm(seed=1, pressure_sensors=False)),
    "emulated, angle alone": lambda smallest: EstimatedArm(
        emulated(VirtualArm(punctual(draw_parameters(7)), seed=1, pressure_sensors=False))
    ),
    "simulated, angle alone": lambda smallest: EstimatedArm(SimulationArm(angle_alone_simulation(), seed=1)),
    "simulated": lambda smallest: SimulationArm(replace(simulation(), commands="pulses"), seed=1),
    "virtual, one muscle": lambda smallest: VirtualArm(seed=1, muscles=1),
    "emulated, one muscle": lambda smallest: emulated(VirtualArm(punctual(draw_parameters(7)), seed=1, muscles=1)),
    "emulated, a user's with one muscle": lambda smallest: emulated(smallest(muscles=1)),
    "simulated, one muscle": lambda smallest: SimulationArm(single_simulation(), noise=QUIET),
    "a user's with one muscle": lambda smallest: smallest(muscles=1),
    "a user's with two joints of one muscle": lambda smallest: smallest(joints=2, muscles=1),
    "a user's": lambda smallest: smallest(),
    "a user's with two joints": lambda smallest: smallest(joints=2),
}
"""Factories by name; a new arm is added here. One without pressure sensors keeps it with its estimates."""


@pytest.fixture(params=ARMS)
def arm(request, smallest_arm):
    with ARMS[request.param](smallest_arm) as arm:
        yield arm


def all_valves(arm, value):
    """Return valves of ``value``, those closed of muscles that are not there."""
    valves = np.full((arm.spec.joints, 2), value, np.int8)
    valves[:, arm.spec.muscles :] = 0
    return valves


def there(arm, values):
    """Return those of ``values`` (joints, 2) that are of muscles that ``arm`` has."""
    return values[:, : arm.spec.muscles]


def test_a_reading_has_the_shapes_and_units_of_the_spec(arm):
    assert isinstance(arm, Arm)
    assert isinstance(arm.spec, ArmSpec)
    reading = checked(arm.read(), arm.spec)
    assert isinstance(reading, Reading)
    assert type(reading.time) is float
    assert reading.angle.shape == (arm.spec.joints,)
    assert reading.pressure.shape == (arm.spec.joints, 2)
    assert reading.angle.dtype == reading.pressure.dtype == np.float64
    low, high = arm.spec.angle_range
    assert ((low <= reading.angle) & (reading.angle <= high)).all()


def test_readings_are_kept_apart(arm):
    first = checked(arm.read(), arm.spec)
    angle, pressure = first.angle.copy(), first.pressure.copy()
    arm.set_valves(all_valves(arm, 1))
    arm.wait(0.5)
    second = checked(arm.read(), arm.spec)
    assert not np.array_equal(second.pressure, pressure)
    assert (second.pressure[:, arm.spec.muscles :] == 0).all()
    assert np.array_equal(first.angle, angle)
    assert np.array_equal(first.pressure, pressure)


def test_time_advances_by_waiting_and_by_nothing_else(arm):
    # A controller's clock counts microseconds, which the host maps to its own.
    tolerance = 2e-6 if isinstance(getattr(arm, "arm", arm), SerialArm) else 1e-9
    begin = arm.read().time
    arm.set_valves(all_valves(arm, 0))
    assert arm.read().time == pytest.approx(begin, abs=tolerance)
    arm.wait(0.25)
    assert arm.read().time == pytest.approx(begin + 0.25, abs=tolerance)
    arm.wait(0.0)
    assert arm.read().time == pytest.approx(begin + 0.25, abs=tolerance)
    arm.wait_until(begin + 0.4)
    assert begin + 0.4 - tolerance <= arm.read().time < begin + 0.42
    now = arm.read().time
    arm.wait_until(begin)
    assert arm.read().time == now


def test_valves_hold_until_the_next_call(arm):
    arm.set_valves(all_valves(arm, 1))
    pressures = []
    for _ in range(4):
        arm.wait(0.1)
        pressures.append(there(arm, checked(arm.read(), arm.spec).pressure))
    if arm.spec.muscles == 2:
        assert (np.diff(pressures, axis=0) > 5).all()
    else:  # as its joint leaves the lower end a lone muscle takes up air by growing
        assert (pressures[3] - pressures[1] > 10).all()
    arm.set_valves(all_valves(arm, 0))
    arm.wait(2.0)  # a joint with one muscle swings for longer
    held = checked(arm.read(), arm.spec).pressure
    arm.wait(0.5)
    assert checked(arm.read(), arm.spec).pressure == pytest.approx(held, abs=6)
    arm.set_valves(all_valves(arm, -1))
    arm.wait(2.0)
    assert (checked(arm.read(), arm.spec).pressure < 6).all()


def test_each_muscle_obeys_its_own_valve(arm):
    for joint in range(arm.spec.joints):
        for muscle in range(arm.spec.muscles):
            arm.set_valves(all_valves(arm, -1))
            arm.wait(2.0)
            valves = all_valves(arm, 0)
            valves[joint, muscle] = 1
            before = checked(arm.read(), arm.spec)
            arm.set_valves(valves)
            arm.wait(0.4)
            after = checked(arm.read(), arm.spec)
            change = after.pressure - before.pressure
            assert change[joint, muscle] > 30
            assert np.argmax(change) == 2 * joint + muscle
            # Muscle 1 turns the joint to higher angles.
            assert np.sign(after.angle - before.angle)[joint] == (1 if muscle == 0 else -1)


def test_the_guard_keeps_inlets_of_full_muscles_closed(arm):
    with guarded(arm) as safe:
        assert guarded(safe) is safe
        safe.set_valves(np.ones((arm.spec.joints, 2)))
        safe.wait(4.0)
        reading = safe.read()
        # No more than what comes in within one period and its dead time, and the noise.
        assert (reading.pressure <= safe.spec.max_pressure_counts + 20).all()
        over = reading.pressure > safe.spec.max_pressure_counts
        safe.set_valves(np.ones((arm.spec.joints, 2)))
        assert np.array_equal(there(arm, safe.applied == 0), there(arm, over))
        assert (safe.applied[:, arm.spec.muscles :] == 0).all()
        assert (safe.peak_pressure >= reading.pressure).all()


def filled(arm, command, turns=12):
    """Return the pressures after ``turns`` control periods under a muscle's ``command``, then at rest."""
    safe = guarded(arm)
    safe.set_valves(all_valves(arm, -1))
    safe.wait(2.0)
    safe.set_valves(all_valves(arm, 0))
    shares = np.zeros((arm.spec.joints, 2))
    shares[0, 0] = command
    remaining = iter(range(turns))
    for _ in ControlCycle(safe).run(lambda reading: None if next(remaining, None) is None else shares):
        pass
    safe.wait(0.5)
    return safe.read().pressure


def test_a_pulse_lets_in_air_for_its_share_of_the_period(arm):
    quarter, half, whole = (filled(arm, share)[0, 0] for share in (0.25, 0.5, 1.0))
    assert quarter == pytest.approx(whole / 4, rel=0.25, abs=8)
    assert half == pytest.approx(whole / 2, rel=0.2, abs=8)


def test_pulses_too_short_for_a_valve_are_none_or_the_shortest(arm):
    shortest = arm.spec.shortest_pulse / arm.spec.period
    safe = guarded(arm)
    command = np.zeros((arm.spec.joints, 2))
    command[0] = -0.51 * shortest, 0.49 * shortest
    safe.decide(command)
    assert safe.applied[0].tolist() == [-shortest, 0.0]
    safe.wait(arm.spec.period)
    command[0] = np.nextafter(1.0, 0.0), -1.0
    safe.decide(command)
    assert there(arm, safe.applied)[0].tolist() == there(arm, command)[0].tolist()
    safe.set_valves(all_valves(arm, 0))


@pytest.mark.parametrize("wrong", [2, -2, 0.5, np.nan])
def test_impossible_valves_are_refused_before_anything_is_set(arm, wrong):
    safe = guarded(arm)
    safe.set_valves(all_valves(arm, -1))
    valves = np.zeros((arm.spec.joints, 2))
    valves[0, 1] = wrong
    with pytest.raises(PneumarmError, match="valves must be"):
        safe.set_valves(valves)
    with pytest.raises(PneumarmError, match="valves must be"):
        safe.set_valves(np.zeros((arm.spec.joints, 3)))
    assert (there(arm, safe.applied) == -1).all()


def test_the_cycle_keeps_period_and_latency(arm):
    cycle, turns = ControlCycle(guarded(arm)), 0

    def decide(reading):
        nonlocal turns
        turns += 1
        return all_valves(arm, 0) if turns <= 60 else None

    steps = list(cycle.run(decide))
    times = np.array([step.reading.time for step in steps])
    assert len(steps) == 61
    assert steps[-1].valves is None
    assert (np.diff(times) > 0).all()
    # Lateness does not add up.
    assert times - times[0] == pytest.approx(np.arange(61) * arm.spec.period, abs=0.01)
    assert cycle.missed_deadlines == 0


def test_closing_closes_the_valves_also_twice_and_after_an_error(arm):
    def fail_while_moving():
        with arm:
            arm.set_valves(all_valves(arm, 1))
            arm.wait(0.2)
            raise RuntimeError("in the middle")

    with pytest.raises(RuntimeError, match="in the middle"):
        fail_while_moving()
    arm.close()
    arm = arm.arm if isinstance(arm, EstimatedArm) else arm
    if isinstance(arm, SerialArm):
        assert not arm.link.line.board.armed
    elif isinstance(arm, VirtualArm):
        arm.wait(2.0)
        before = arm.pressure
        arm.wait(1.0)
        assert (arm.body.muscles["open"] == 0).all()
        assert arm.pressure == pytest.approx(before, abs=3000)
    elif isinstance(arm, SimulationArm):
        before = arm.read()
        arm.wait(1.0)
        assert arm.read().pressure == pytest.approx(before.pressure, abs=10)
    else:
        assert arm.closed == 2
        assert arm.valves == all_valves(arm, 0).tolist()


def test_a_state_can_be_restored_or_is_not_there(arm):
    safe = GuardedArm(arm)
    state = safe.get_state()
    if state is None:
        with pytest.raises(UnusableInput, match="cannot be put into a saved state"):
            safe.set_state(b"")
        return
    safe.set_valves(all_valves(arm, 1))
    safe.wait(0.3)
    first = safe.read()
    safe.set_state(state)
    safe.set_valves(all_valves(arm, 1))
    safe.wait(0.3)
    again = safe.read()
    assert first.time == again.time
    assert np.array_equal(first.angle, again.angle)
    assert np.array_equal(first.pressure, again.pressure)
