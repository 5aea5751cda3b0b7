"""Further sensors: velocity from faster samples, accelerometers, thermometers, on every arm that can have them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumarm.arm import ArmSpec, Reading, Sensor, open_arm
from pneumarm.arm.corrected import CorrectedArm
from pneumarm.arm.seam import checked, measured, with_measured
from pneumarm.arm.serial import BoardLine, EmulatedBoard, SerialArm
from pneumarm.arm.serial.arm import VELOCITY_MS as OF_THE_CONTROLLER
from pneumarm.arm.spec_file import ArmFile, SensorCorrection, load_spec, save_spec
from pneumarm.arm.virtual import FrozenPotentiometer, VirtualArm, usual_sensors, without_noise
from pneumarm.arm.virtual.further import ACCELEROMETER, GRAVITY, THERMOMETER, VELOCITY_MS
from pneumarm.arm.virtual.parameters import ArmParameters
from pneumarm.errors import ArmFailure, UnusableInput

ALL = "velocity+acceleration+temperature"
MANY = ArmSpec(
    joints=2,
    velocity_sensor=True,
    sensors=(
        Sensor("temperature", 2, 1, channel=2, scale=0.5, offset=-10.0),
        Sensor("acceleration", 1),
        Sensor("temperature", 1, 2),
    ),
)
NAMES = (
    "joint_1_velocity",
    "joint_2_velocity",
    "joint_2_temperature_1",
    "joint_1_acceleration",
    "joint_1_temperature_2",
)


def plain_reading(joints: int = 2) -> Reading:
    return Reading(1.0, np.full(joints, 500.0), np.full((joints, 2), 50.0))


def drive(arm, periods=60, seed=0):
    """Move ``arm`` by random valves, as the control cycle does; return its readings."""
    random, readings = np.random.default_rng(seed), []
    for k in range(periods):
        readings.append(checked(arm.read(), arm.spec))
        arm.wait(arm.spec.latency)
        if k % 5 == 0:
            arm.set_valves(random.integers(-1, 2, (arm.spec.joints, 2)).astype(np.int8))
        arm.wait_until(readings[-1].time + arm.spec.period)
    return readings


# ---- the seam


def test_names_tell_kind_joint_and_muscle_in_the_order_of_the_spec():
    assert MANY.further == NAMES
    assert ArmSpec().further == ()


@given(st.lists(st.floats(-1e6, 1e6), min_size=5, max_size=5))
def test_what_is_put_into_a_reading_is_found_there(values):
    reading = with_measured(plain_reading(), MANY, values)
    assert measured(reading, MANY.further) == values
    assert measured(reading, NAMES[::-1]) == values[::-1]
    assert np.isnan(reading.temperature[[0, 1], [0, 1]]).all()
    assert np.isnan(reading.acceleration[1])
    assert checked(reading, MANY) is reading


@given(st.floats(-1000, 1000), st.floats(-100, 100).filter(lambda s: abs(s) > 1e-3), st.floats(0, 1023))
def test_counts_and_values_are_inverse(offset, scale, counts):
    one = Sensor("acceleration", scale=scale, offset=offset)
    assert one.counts(one.value(counts)) == pytest.approx(counts, abs=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "humidity"},
        {"kind": "temperature"},
        {"kind": "temperature", "muscle": 3},
        {"kind": "acceleration", "muscle": 1},
        {"kind": "acceleration", "joint": 0},
        {"kind": "acceleration", "channel": 0},
        {"kind": "acceleration", "scale": 0.0},
        {"kind": "acceleration", "offset": math.nan},
    ],
)
def test_impossible_sensors_are_refused(wrong):
    with pytest.raises(UnusableInput, match="Sensor: "):
        Sensor(**wrong)


def test_a_spec_refuses_a_sensor_twice_and_one_of_a_joint_that_it_has_not():
    with pytest.raises(UnusableInput, match="sensors"):
        ArmSpec(sensors=(Sensor("acceleration"), Sensor("acceleration", channel=2)))
    with pytest.raises(UnusableInput, match="sensors"):
        ArmSpec(sensors=(Sensor("acceleration", 2),))
    with pytest.raises(UnusableInput, match="sensors"):
        ArmSpec(sensors=(Sensor("acceleration", channel=1), Sensor("temperature", muscle=1, channel=1)))


def test_a_reading_without_what_the_spec_promises_is_a_failure_of_the_arm():
    whole = with_measured(plain_reading(), MANY, [1.0, 2.0, 3.0, 4.0, 5.0])
    with pytest.raises(ArmFailure, match="joint_2_temperature_1"):
        checked(replace(whole, temperature=None), MANY)
    with pytest.raises(ArmFailure, match="joint_1_velocity"):
        checked(replace(whole, velocity=np.array([np.nan, 1.0])), MANY)
    with pytest.raises(ArmFailure, match="joint_2_velocity"):
        checked(replace(whole, velocity=np.array([1.0])), MANY)


def test_a_file_keeps_them(tmp_path):
    save_spec(MANY, tmp_path / "arm.toml")
    assert load_spec(tmp_path / "arm.toml") == MANY
    text = (tmp_path / "arm.toml").read_text().replace("channel", "chanel")
    (tmp_path / "arm.toml").write_text(text)
    with pytest.raises(UnusableInput, match="chanel is unknown"):
        load_spec(tmp_path / "arm.toml")


# ---- the virtual arm


def test_the_name_or_the_spec_says_which_a_virtual_arm_has(tmp_path):
    with open_arm("virtual:seed=2") as plain, open_arm(f"virtual:seed=2,sensors={ALL}") as arm:
        assert plain.spec.further == ()
        assert arm.spec.further == (
            "joint_1_velocity",
            "joint_1_acceleration",
            "joint_1_temperature_1",
            "joint_1_temperature_2",
        )
        save_spec(replace(arm.spec, name="mine"), tmp_path / "arm.toml")
        with open_arm(f"virtual:seed=2,spec={tmp_path / 'arm.toml'}") as same:
            assert same.spec.sensors == arm.spec.sensors
            assert same.read().temperature == pytest.approx(arm.read().temperature, abs=3 * THERMOMETER)
        with pytest.raises(UnusableInput, match=r"lacks .*joint_1_velocity"):
            CorrectedArm(plain, ArmFile(arm.spec))
    for wrong in ("humidity", "velocity+velocity", "velocity+"):
        with pytest.raises(UnusableInput, match="further sensors of velocity, acceleration, temperature"):
            open_arm(f"virtual:sensors={wrong}")


def test_angles_and_pressures_are_those_of_the_arm_without_them():
    with open_arm("virtual:seed=3", 5) as plain, open_arm(f"virtual:seed=3,sensors={ALL}", 5) as arm:
        one, other = drive(plain, 90), drive(arm, 90)
    assert [r.time for r in one] == pytest.approx([r.time for r in other], abs=1e-9)
    angle = np.array([[r.angle for r in readings] for readings in (one, other)])
    pressure = np.array([[r.pressure for r in readings] for readings in (one, other)])
    assert np.ptp(angle[0]) > 100
    assert abs(angle[0] - angle[1]).max() <= 2  # substeps are cut otherwise
    assert abs(pressure[0] - pressure[1]).max() <= 2


def test_velocity_is_the_change_over_the_last_milliseconds_as_of_the_controller():
    assert VELOCITY_MS == OF_THE_CONTROLLER
    quiet = without_noise(ArmParameters())
    with VirtualArm(quiet, velocity_sensor=True) as arm:
        arm.set_valves(np.array([[1, 0]], np.int8))
        arm.wait(0.2)
        for seconds in (0.005, 0.005, 0.006, 0.05, 0.004, 0.3):  # samples go on over waits of any length
            past = []
            for piece in np.full(VELOCITY_MS, 1e-3):
                past.append(arm.angle)
                arm.wait(piece)
            now = arm.read()
            expected = (arm.angle - past[0]) * np.degrees(arm.spec.counts_per_degree) / VELOCITY_MS
            assert now.velocity == pytest.approx(expected, abs=1.5 / VELOCITY_MS)
            arm.wait(seconds)


def test_an_arm_that_rests_has_no_velocity_and_feels_gravity():
    with VirtualArm(velocity_sensor=True, sensors=usual_sensors(["acceleration"])[1]) as arm:
        readings = [arm.read() for _ in range(20) if arm.wait(0.1) is None]
        tilt = arm.parameters.joints[0].tilt
    assert np.mean([r.velocity for r in readings]) == pytest.approx(0.0, abs=0.05)
    felt = np.mean([r.acceleration for r in readings])
    assert felt == pytest.approx(GRAVITY * math.sin(arm.angle[0] + tilt), abs=ACCELEROMETER)


def test_an_accelerometer_agrees_with_the_change_of_the_speed():
    """Mean acceleration along a movement, from the true speeds at both ends."""
    with VirtualArm(without_noise(ArmParameters()), sensors=usual_sensors(["acceleration"])[1]) as arm:
        tilt, felt, expected = arm.parameters.joints[0].tilt, [], []
        arm.set_valves(np.array([[1, 0]], np.int8))
        arm.wait(0.1)
        for _ in range(40):
            before = arm.speed[0]
            arm.wait(2e-3)
            turning = (arm.speed[0] - before) / 2e-3
            expected.append(0.2 * turning + GRAVITY * math.sin(arm.angle[0] + tilt))
            felt.append(arm.read().acceleration[0])
    assert np.ptp(expected) > 5 * ACCELEROMETER
    assert np.corrcoef(felt, expected)[0, 1] > 0.98


def test_a_thermometer_tells_a_cold_arm_from_a_warm_one():
    with open_arm("virtual:seed=4,sensors=temperature") as arm:
        cold = np.mean([arm.read().temperature for _ in range(30)], axis=0)
        assert cold == pytest.approx(arm.temperature, abs=THERMOMETER)
        arm.wait(4 * 3600.0)  # the room is heated by day
        warm = np.mean([arm.read().temperature for _ in range(30)], axis=0)
        assert warm == pytest.approx(arm.temperature, abs=THERMOMETER)
        assert (warm - cold > THERMOMETER).all()


def test_a_saved_state_is_taken_up_bit_for_bit_and_only_by_an_arm_with_the_same_sensors():
    name = f"virtual:seed=5,sensors={ALL}"
    with open_arm(name, 1) as arm, open_arm(name, 2) as other, open_arm("virtual:seed=5", 1) as plain:
        drive(arm, 7)
        state = arm.get_state()
        other.set_state(state)
        for one, same in zip(drive(arm, 7), drive(other, 7), strict=True):
            assert measured(one, arm.spec.further) == measured(same, arm.spec.further)
            assert one.angle == same.angle
        with pytest.raises(UnusableInput):
            plain.set_state(state)


def test_the_velocity_is_that_of_the_potentiometer_with_its_faults():
    with VirtualArm(velocity_sensor=True, faults=[FrozenPotentiometer(begin=0.5)]) as arm:
        arm.set_valves(np.array([[1, 0]], np.int8))
        arm.wait(0.3)
        assert abs(arm.read().velocity[0]) > 0.2
        arm.wait(0.3)
        assert arm.read().velocity[0] == 0
        assert abs(arm.speed[0]) > 0


# ---- behind a controller


def test_a_board_passes_them_on(tmp_path):
    with open_arm("virtual:seed=6,sensors=velocity+temperature", 1) as direct:
        alone = drive(direct)
    with open_arm("emulated:virtual:seed=6,sensors=velocity+temperature", 1) as arm:
        behind = drive(arm)
        arm.read()
    speeds = np.array([[r.velocity[0] for r in readings] for readings in (alone, behind)])
    assert np.ptp(speeds[0]) > 1
    assert np.corrcoef(speeds)[0, 1] > 0.95  # the board's clock is another, and so are its moments
    for one, other in zip(alone, behind, strict=True):
        assert other.temperature == pytest.approx(one.temperature, abs=6 * THERMOMETER)


def test_a_controller_without_a_channel_for_a_sensor_refuses_it():
    velocity, sensors = usual_sensors(ALL.split("+"))
    arm = VirtualArm(velocity_sensor=velocity, sensors=sensors)
    with pytest.raises(UnusableInput, match=r"joint_1_temperature_2 needs one of the board's 2 extra channels"):
        SerialArm(BoardLine(EmulatedBoard(arm)), arm.spec)


def test_a_linearised_angle_has_a_linearised_velocity():
    """Twice the slope above 500 counts, half of it below."""
    bent = SensorCorrection(angle_raw=((0.0, 500.0, 1000.0),), angle_true=((0.0, 250.0, 1250.0),))
    with VirtualArm(velocity_sensor=True) as arm:
        raw = [Reading(0.0, np.array([a]), np.zeros((1, 2)), np.array([0.5])) for a in (300.0, 700.0)]
        arm.read = iter(raw).__next__
        corrected = CorrectedArm(arm, ArmFile(arm.spec, bent))
        assert [corrected.read().velocity[0] for _ in raw] == pytest.approx([0.25, 1.0])
