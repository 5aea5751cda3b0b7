"""Several links: MuJoCo knows the rigid body too, and what it does must make sense with everything else."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import open_arm
from pneumarm.arm.virtual import (
    Payload,
    VirtualArm,
    draw_parameters,
    figures,
    nominal_parameters,
    resting_angle,
    usual_sensors,
)
from pneumarm.arm.virtual.body import body_of
from pneumarm.arm.virtual.chain import solve, swing
from pneumarm.arm.virtual.constants import GRAVITY, hang
from pneumarm.arm.virtual.further import MOUNTED, felt_along
from pneumarm.arm.virtual.parameters import BAR
from pneumarm.arm.virtual.rest import static_torque
from pneumarm.arm.virtual.state import JOINT
from pneumarm.arm.virtual.step import SUBSTEP, integrate
from pneumarm.errors import UnusableInput
from pneumarm.kernels import kernel

swing, solve = kernel(swing.py_func), kernel(solve.py_func)


@pytest.fixture
def mujoco():
    return pytest.importorskip("mujoco")


def in_mujoco(mujoco, parameters, payload=(0.0,) * 4):
    """The same links in MuJoCo; an angle is 0 there where the link hangs straight on."""
    tail, place = "", 0.0
    text = ""
    for link, more in zip(parameters.joints, payload, strict=False):
        text += f"""<body pos="0 0 {-place!r}"><joint type="hinge" axis="0 1 0"/>
            <inertial pos="0 0 {-link.distance!r}" mass="{link.mass + more!r}"
            diaginertia="0.05 {link.link_inertia!r} 0.05"/>"""
        tail, place = tail + "</body>", link.length
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/><option gravity="0 0 {-GRAVITY}"><flag contact="disable"/></option>
        <worldbody>{text}{tail}</worldbody></mujoco>"""
    )


def pushed(body, angle, speed):
    """The mass matrix and the bias of the body's chain at ``angle`` and ``speed``."""
    n = len(angle)
    body.joints["angle"], body.joints["speed"] = angle, speed
    swing(body)
    return body.joints["inertia"][:, :n].copy(), -body.joints["torque"]


@pytest.mark.parametrize("joints", [2, 3, 4])
@pytest.mark.parametrize("seed", [1, 2])
def test_mass_matrix_and_bias_are_those_of_mujoco(mujoco, joints, seed):
    parameters = draw_parameters(seed, joints)
    body, model, random = body_of(parameters), in_mujoco(mujoco, parameters), np.random.default_rng(seed)
    data, tilt = mujoco.MjData(model), body.constants.joints["tilt"]
    for _ in range(200):
        angle, speed = random.uniform(-3, 3, joints), random.uniform(-20, 20, joints)
        data.qpos, data.qvel = angle + tilt, speed
        mujoco.mj_forward(model, data)
        expected = np.zeros((joints, joints))
        mujoco.mj_fullM(model, data, expected)
        inertia, bias = pushed(body, angle, speed)
        np.testing.assert_allclose(inertia, expected, atol=1e-10, rtol=0)
        np.testing.assert_allclose(bias, data.qfrc_bias, atol=1e-10, rtol=1e-12)
        solve(body.joints)
        np.testing.assert_allclose(body.joints["torque"], np.linalg.solve(expected, -bias), rtol=1e-9, atol=1e-9)


def test_a_payload_is_a_mass_more_for_mujoco_too(mujoco):
    parameters = draw_parameters(3, 3)
    body, model = body_of(parameters), in_mujoco(mujoco, parameters, (0.0, 0.0, 0.2))
    data = mujoco.MjData(model)
    hang(body.constants, 2, parameters.joints[2].distance, 0.2, 1.0)
    angle, speed = np.array([0.3, -1.0, 0.7]), np.array([1.0, 5.0, -3.0])
    data.qpos, data.qvel = angle + body.constants.joints["tilt"], speed
    mujoco.mj_forward(model, data)
    expected = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, expected)
    inertia, bias = pushed(body, angle, speed)
    np.testing.assert_allclose(inertia, expected, atol=1e-12)
    np.testing.assert_allclose(bias, data.qfrc_bias, atol=1e-10)


def bare(parameters):
    """The same links without muscles, bearings or stops that take energy."""
    muscle = replace(
        parameters.joints[0].muscles[0], bladder_stiffness=0.0, creep_stiffness=(0.0,) * 4, stop_stiffness=0.0,
        friction=0.0, friction_per_pressure=0.0, viscosity=0.0, viscosity_per_pressure=0.0, threshold=2e5,
    )  # fmt: skip
    joints = [replace(j, muscles=(muscle, muscle), viscosity=0.0, stop_angle=50.0) for j in parameters.joints]
    return replace(parameters, joints=tuple(joints))


def energy(body):
    """Kinetic and potential energy [J] of a chain that is coupled as in nature."""
    n, c = len(body.joints), body.constants.joints
    angle, speed = body.joints["angle"].copy(), body.joints["speed"].copy()
    inertia, _ = pushed(body, angle, speed)
    height = np.cos(np.cumsum(angle + c["tilt"]))
    own = c["own_weight"] * np.cos(angle + c["tilt"])
    return speed @ inertia[:n, :n] @ speed / 2 - c["weight"] @ height - own.sum()


@pytest.mark.parametrize("coupling", [1.0, 0.4])
@pytest.mark.parametrize("joints", [2, 4])
def test_a_chain_without_muscles_keeps_its_energy(joints, coupling):
    """The error of the integrator is of the first order, and does not add up."""
    parameters = replace(bare(draw_parameters(5, joints)), coupling=coupling)
    lost = []
    for substep in (SUBSTEP, SUBSTEP / 4):
        body = body_of(parameters)
        body.joints["angle"] = np.linspace(1.2, -0.8, joints)
        body.surroundings["supply"] = 1e5
        start, found = energy(body), []
        for i in range(1, 101):
            integrate(body, i * 0.05, substep)
            found.append(energy(body))
        scale = start - energy_at_rest(parameters)
        lost.append(np.abs(np.array(found) - start).max() / scale)
    assert lost[0] < 0.03
    assert lost[1] < 0.4 * lost[0]


def energy_at_rest(parameters):
    """The energy of a chain that hangs straight down [J]."""
    body = body_of(parameters)
    body.joints["angle"] = -body.constants.joints["tilt"]
    return energy(body)


@pytest.mark.parametrize("seed", range(1, 9))
def test_a_joint_feels_another_as_that_feels_it(seed):
    """At constant pressures torques come from a potential, through passing cables too: the stiffness is symmetric."""
    parameters = draw_parameters(seed, 3)
    fixed, random = body_of(parameters).constants, np.random.default_rng(seed)
    angle, pressures, step = random.uniform(-0.5, 0.5, 3), random.uniform(0.2, 0.9, (3, 2)) * BAR, 1e-5
    stiffness = np.empty((3, 3))
    for k in range(3):
        torques = []
        for shift in (-step, step):
            joints = np.zeros(3, JOINT)
            joints["angle"] = angle
            joints["angle"][k] += shift
            torques.append([static_torque(fixed, pressures, False, joints, j) for j in range(3)])
        stiffness[:, k] = np.diff(torques, axis=0)[0] / (2 * step)
    np.testing.assert_allclose(stiffness, stiffness.T, rtol=1e-6, atol=1e-6)
    assert np.abs(stiffness[0, 1]) > 0.01


def test_static_equilibrium_is_where_the_arm_comes_to_rest(quiet):
    """Without friction and creep the arm settles where the statics says, wherever its cables pass."""
    parameters = quiet(draw_parameters(1, 3))
    assert any(joint.passing for joint in parameters.joints)
    joints = []
    for joint in parameters.joints:
        muscles = [
            replace(m, friction=0.0, friction_per_pressure=0.0, creep_stiffness=(0.0,) * 4, leak=0.0, seat_leak=0.0,
                    viscosity=30.0)
            for m in joint.muscles
        ]  # fmt: skip
        joints.append(replace(joint, muscles=(muscles[0], muscles[1])))
    parameters = replace(parameters, joints=tuple(joints))
    arm = VirtualArm(parameters)
    pressures = np.array([[0.5, 0.2], [0.2, 0.4], [0.4, 0.3]]) * BAR
    for _ in range(300):
        arm.body.muscles["pressure"] = pressures + 1.013e5
        arm.wait(0.02)
    assert np.degrees(arm.angle) == pytest.approx(np.degrees(resting_angle(parameters, pressures)), abs=0.05)


def test_coupling_turned_off_leaves_each_joint_alone():
    """At 0 a joint does not notice how the others are moved, but by the supply that all share; at 1 it does."""
    moves, drawn = [], draw_parameters(2, 2)
    for coupling in (0.0, 1.0):
        parameters = replace(drawn, coupling=coupling, air=replace(drawn.air, droop=0.0))
        angles = []
        for valve in (0, 1):
            arm = VirtualArm(parameters, seed=0)
            arm.set_valves([[1, 0], [valve, 0]])
            arm.wait(0.5)
            angles.append(np.degrees(arm.angle[0]))
        moves.append(abs(angles[1] - angles[0]))
    assert moves[0] < 1e-9
    assert moves[1] > 0.3


@pytest.mark.parametrize("last", [(0, 0), (-1, -1)])
def test_rest_of_a_chain_is_within_a_count_of_full_integration(last):
    rested, integrated = (VirtualArm(draw_parameters(6, 2), seed=3) for _ in range(2))
    for arm in (rested, integrated):
        random = np.random.default_rng(1)
        while arm.time < 4.0:
            arm.set_valves(random.integers(-1, 2, (2, 2)))
            arm.wait(0.1)
        arm.set_valves([last, last])
    rested.wait(300)
    integrate(integrated.body, integrated.time + 300, SUBSTEP)
    assert np.degrees(rested.angle - integrated.angle) * 11.378 == pytest.approx(np.zeros(2), abs=0.7)
    assert (rested.pressure - integrated.pressure) / 1e5 * 166 == pytest.approx(np.zeros((2, 2)), abs=0.5)


def test_an_accelerometer_feels_its_hinge_move():
    """The acceleration across a link is that of the point's path, differentiated twice."""
    parameters = draw_parameters(7, 3)
    velocity, sensors = usual_sensors(["acceleration"], 3)
    arm = VirtualArm(parameters, seed=0, velocity_sensor=velocity, sensors=sensors)
    arm.set_valves([[1, 0], [0, 1], [1, 0]])
    arm.wait(0.1)
    tilt = np.array([joint.tilt for joint in parameters.joints])
    length = np.array([joint.length for joint in parameters.joints])

    def place(link):
        turned = np.cumsum(arm.angle + tilt)
        path = [*length[:link], MOUNTED]
        angle = turned[: link + 1]
        return np.array([(path * np.sin(angle)).sum(), -(path * np.cos(angle)).sum()]), turned[link]

    dt, path, felt = 1e-3, [], []
    for _ in range(3):
        path.append([place(link)[0] for link in range(3)])
        felt.append([felt_along(arm.body, link) for link in range(3)])
        across = [place(link)[1] for link in range(3)]
        arm.wait(dt)
    acceleration = (np.array(path[0]) - 2 * np.array(path[1]) + np.array(path[2])) / dt**2
    for link in range(3):
        direction = np.array([math.cos(across[link]), math.sin(across[link])])
        expected = (acceleration[link] + [0, GRAVITY]) @ direction
        assert felt[1][link] == pytest.approx(expected, abs=0.02 * (1 + abs(expected)))


def test_drawn_chains_can_do_the_job_and_stay_sane_under_babble():
    for joints, seeds in ((2, range(5)), (3, range(2)), (4, range(1))):
        for seed in seeds:
            parameters = draw_parameters(seed, joints)
            assert all(figures(parameters, joint).usable(joints) for joint in range(joints))
            arm, random = VirtualArm(parameters, seed=seed), np.random.default_rng(seed)
            for _ in range(30 * 5):
                arm.set_valves(random.integers(-1, 2, (joints, 2)))
                arm.wait(1 / 30)
                assert (np.abs(np.degrees(arm.angle)) < 80).all()
                assert (arm.pressure > -0.7e5).all()
                assert (arm.pressure < 1.7e5).all()


def test_a_payload_on_the_last_link_bends_every_joint():
    angles = []
    for plan in ([], [Payload(joint=2, mass=0.3)]):
        arm = VirtualArm(nominal_parameters(2), faults=plan)
        arm.set_valves([[1, 0], [1, 0]])
        arm.wait(0.4)
        arm.set_valves(np.zeros((2, 2), np.int8))
        arm.wait(3.0)
        angles.append(np.degrees(arm.angle))
    assert (angles[1] < angles[0] - 1).all()


def test_chains_have_names():
    with open_arm("virtual:joints=2,seed=7") as arm, open_arm("virtual:joints=1,seed=7") as one:
        assert arm.spec.joints == 2
        assert isinstance(one, VirtualArm)
        assert one.parameters == draw_parameters(7)
    with open_arm("virtual:joints=3,coupling=0.3") as arm:
        assert isinstance(arm, VirtualArm)
        assert arm.parameters.coupling == 0.3
    for name, why in (
        ("virtual:joints=5", "1 to 4 joints"),
        ("virtual:joints=0,seed=1", "1 to 4 joints"),
        ("virtual:joints=two", "expected virtual"),
        ("virtual:joints=2,preset=A", "do not go together"),
        ("virtual:coupling=0.5", "one joint is coupled to none"),
        ("virtual:joints=2,coupling=2", "expected a number, 1 or less"),
        ("virtual:joints=2,coupling=x", "coupling of 0 to 1"),
    ):
        with pytest.raises(UnusableInput, match=why):
            open_arm(name)
