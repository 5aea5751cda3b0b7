import json
import math
import os
from dataclasses import replace

import numpy as np
import pytest

from children import python
from pneumarm.arm.virtual import ArmParameters, JointParameters, MuscleParameters, VirtualArm, draw_parameters
from pneumarm.errors import PneumarmError, UnusableInput


def run(arm, steps, seed=0):
    """Everything read in ``steps`` control periods under random valves."""
    random, read = np.random.default_rng(seed), []
    due = arm.time
    for _ in range(steps):
        reading = arm.read()
        read.append((reading.time, *reading.angle, *reading.pressure.ravel()))
        arm.wait(arm.spec.latency)
        arm.set_valves(random.integers(-1, 2, (arm.spec.joints, 2), dtype=np.int8))
        due += arm.spec.period
        arm.wait_until(due)
    return np.array(read)


def test_a_seed_is_a_run_bit_for_bit_and_another_seed_another_run():
    parameters = draw_parameters(2)
    first, again, other = (run(VirtualArm(parameters, seed=seed), 200) for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_restored_arm_has_the_same_future_bit_for_bit():
    arm = VirtualArm(seed=1)
    run(arm, 50)
    arm.set_valves([[1, -1]])  # still under way in the pipes when the state is taken
    state = arm.get_state()
    future = run(arm, 100, seed=1)
    arm.set_state(state)
    assert np.array_equal(run(arm, 100, seed=1), future)
    stranger = VirtualArm(seed=99)
    run(stranger, 7)
    stranger.set_state(state)
    assert stranger.get_state() == state
    assert np.array_equal(run(stranger, 100, seed=1), future)


def test_a_state_from_a_computer_that_draws_other_last_digits_is_taken():
    parameters = draw_parameters(1)
    air = replace(parameters.air, supply=np.nextafter(parameters.air.supply, np.inf))
    arm, there = VirtualArm(parameters), VirtualArm(replace(parameters, air=air))
    run(there, 5)
    arm.set_state(there.get_state())
    assert arm.get_state() == there.get_state()


def test_a_wrong_state_is_refused_and_changes_nothing():
    arm = VirtualArm()
    run(arm, 5)
    state = arm.get_state()
    with pytest.raises(UnusableInput, match=r"expected a saved state of \d+ bytes, got 3"):
        arm.set_state(b"abc")
    with pytest.raises(UnusableInput, match="no saved state of a virtual arm"):
        arm.set_state(b"x" * len(state))
    with pytest.raises(UnusableInput, match="other parameters"):
        arm.set_state(VirtualArm(draw_parameters(1)).get_state())
    header = 28
    pressure, clock = header, header + arm.body.muscles.nbytes + arm.body.joints.nbytes
    for place, damage in ((pressure, np.nan), (pressure, np.inf), (pressure, -1.0), (clock, np.nan), (clock, 1e300)):
        damaged = bytearray(state)
        damaged[place : place + 8] = np.float64(damage).tobytes()
        with pytest.raises(UnusableInput, match="impossible numbers"):
            arm.set_state(bytes(damaged))
    assert arm.get_state() == state


def test_the_control_interval_has_the_jitter_of_the_thesis():
    times = run(VirtualArm(seed=2), 4000)[:, 0]
    interval = np.diff(times)
    assert interval.std() == pytest.approx(1.5e-3, rel=0.06)
    assert interval.mean() == pytest.approx(1 / 30, rel=1e-3)
    late = times[1:] - np.arange(1, len(times)) / 30
    assert (late >= 0).all()
    assert late.max() < 0.01


def test_waiting_is_exact_and_reading_takes_no_time():
    arm = VirtualArm()
    arm.wait(0.0123)
    arm.read()
    arm.set_valves([[0, 1]])
    assert arm.time == 0.0123
    arm.wait_until(0.005)
    assert arm.time == 0.0123


def test_wait_until_draws_no_sensor_noise():
    punctual = replace(ArmParameters(), jitter=0.0)
    first, second = VirtualArm(punctual, seed=3), VirtualArm(punctual, seed=3)
    first.wait(0.25)
    second.wait_until(0.25)
    assert second.time == 0.25
    for _ in range(20):
        assert np.array_equal(first.read().pressure, second.read().pressure)


def test_the_arm_begins_at_rest():
    for seed in (1, 2, 3):
        arm = VirtualArm(draw_parameters(seed))
        begin = arm.angle
        arm.wait(2.0)
        assert np.degrees(arm.angle - begin) == pytest.approx(0, abs=0.5)


def test_rest_vents_the_arm():
    arm = VirtualArm()
    arm.set_valves([[1, 1]])
    arm.wait(1.0)
    arm.rest(5.0)
    arm.wait(0.1)
    assert arm.pressure == pytest.approx(np.zeros((1, 2)), abs=100)
    assert (arm.body.muscles["open"] == 0).all()


@pytest.mark.parametrize(
    "valves", [[[2, 0]], [[0.5, 0]], [[math.nan, 0]], [[257, 0]], [1, 0], [[0, 0], [0, 0]], "no"]
)
def test_impossible_valves_are_refused(valves):
    arm = VirtualArm()
    state = arm.get_state()
    with pytest.raises(PneumarmError, match=r"valves must be \(1, 2\) of -1, 0 or \+1"):
        arm.set_valves(valves)
    assert arm.get_state() == state


@pytest.mark.parametrize("seconds", [-1.0, math.nan, math.inf, 1e20])
def test_impossible_waits_are_refused(seconds):
    with pytest.raises(PneumarmError, match="can wait"):
        VirtualArm().wait(seconds)


@pytest.mark.parametrize("time", [math.nan, math.inf])
def test_impossible_deadlines_are_refused(time):
    with pytest.raises(PneumarmError, match="can wait"):
        VirtualArm().wait_until(time)


def test_impossible_parameters_are_refused():
    with pytest.raises(UnusableInput, match="diameter cannot be -1"):
        MuscleParameters(diameter=-1)
    with pytest.raises(UnusableInput, match="weave_angle cannot be 2"):
        MuscleParameters(weave_angle=2)
    with pytest.raises(UnusableInput, match="expected 4 or more values"):
        MuscleParameters(slip_weights=(1.0,))
    with pytest.raises(UnusableInput, match="radius cannot be 0"):
        JointParameters(radius=0)
    with pytest.raises(UnusableInput, match="joints cannot be"):
        ArmParameters(joints=(JointParameters(),) * 5)
    with pytest.raises(UnusableInput, match="a radius for each joint that cables pass"):
        ArmParameters(joints=(JointParameters(), JointParameters(passing=(0.005, 0.005))))
    with pytest.raises(UnusableInput, match="expected a number, 1 or less"):
        ArmParameters(joints=(JointParameters(),) * 2, coupling=1.5)
    with pytest.raises(UnusableInput, match="seed of a virtual arm"):
        VirtualArm(seed=-1)


PLAIN = """
import json
import numpy as np
from pneumarm.arm.virtual import draw_parameters
from pneumarm.arm.virtual.body import body_of
from pneumarm.arm.virtual.constants import Constants
from pneumarm.arm.virtual.start import start
from pneumarm.arm.virtual.rest import fast_forward
from pneumarm.arm.virtual.sensors import sense
from pneumarm.arm.virtual.step import integrate
from pneumarm.arm.virtual.valve import command
from pneumarm.arm.virtual.parameters import ArmParameters

np.seterr(over="ignore")
view = (lambda a: a.view(np.recarray)) if {plain} else (lambda a: a)
body = body_of(ArmParameters(), 5)
muscles, joints, air = view(body.muscles), view(body.joints), view(body.surroundings)
body = body._replace(muscles=muscles, joints=joints, surroundings=air,
                     constants=Constants(*(view(a) for a in body.constants)))
start(body)
for i, valves in enumerate([[1, -1], [0, 1], [-1, 0], [0, 0]]):
    command(body, np.array([valves], np.int8), 1 / 30)
    integrate(body, 0.04 * (i + 1), 0.5e-3)
angle, pressure = np.zeros(1), np.zeros((1, 2))
sense(body, angle, pressure)
joints["speed"] = 0.0
fast_forward(body, 20.0)
print(json.dumps([float(joints["angle"][0]), *muscles["pressure"].ravel().tolist(), *muscles["slip"].ravel().tolist(),
            *muscles["temperature"].ravel().tolist(), float(air["supply"][0]), *angle.tolist(),
            *pressure.ravel().tolist()]))
"""


def test_kernels_say_the_same_as_plain_python():
    outputs = []
    for plain in (False, True):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": str(int(plain))}
        script = PLAIN.format(plain=plain)
        done = python("-c", script, env=environment, check=True)
        outputs.append(json.loads(done.stdout))
    assert outputs[0] == pytest.approx(outputs[1], rel=1e-9, abs=1e-9)
