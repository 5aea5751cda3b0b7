"""A simulation with further sensors in its state: as predicted, as compiled, as an arm, and in its file."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import ArmSpec, Sensor
from pneumarm.arm.seam import checked, measured
from pneumarm.control import Monitor
from pneumarm.errors import UnusableInput
from pneumarm.networks.network import Network
from pneumarm.random import random_state
from pneumarm.simulation import FitSettings, NoiseSettings, Scaling, Simulation, SimulationArm, fit
from pneumarm.simulation.kernel import begin, scaled_state, simulation_parameters, simulation_state, step
from pneumarm.simulation.noise import noise_parameters
from pneumarm.transitions import Window, transitions

QUIET = NoiseSettings(kind="none")
KINDS = [("velocity",), ("acceleration",), ("temperature", "velocity"), ("acceleration", "temperature")]


def spec_of(joints):
    sensors = (Sensor("temperature", joints, 1), *(Sensor("acceleration", j) for j in range(1, joints + 1)))
    return ArmSpec(joints=joints, velocity_sensor=True, sensors=sensors)


def made_up(joints, kinds, history=3):
    """Return a simulation with random networks that reads the ``kinds`` of sensors."""
    random = np.random.default_rng(joints)
    window = Window.of(spec_of(joints), history, kinds)
    further = len(window.further)
    velocity = "network" if window.velocity == "measured" else "derived"
    outputs = window.observation_size - (0 if velocity == "network" else joints)
    networks = tuple(
        Network(
            random.normal(0, 0.4, (window.input_size, 6)),
            random.normal(0, 0.4, 6),
            random.normal(0, 0.05, (6, 1)),
            random.normal(0, 0.02, 1),
        )
        for _ in range(outputs)
    )
    return Simulation(
        window.spec(spec_of(joints)),
        window,
        Scaling(
            np.concatenate([np.tile([500.0, 0.1, 90, 100], joints), np.full(further, 20.0)]),
            np.concatenate([np.tile([400.0, 5, 100, 90], joints), np.full(further, 8.0)]),
            random.uniform(0.5, 2, 2 * joints),
        ),
        networks,
        velocity,
        np.tile([4.0, 0.12, 1.0, 1.0], (joints, 1)),
        np.tile([300.0, 700.0], (joints, 1)),
        np.tile([0.0, 190.0], (joints, 2, 1)),
        further_std=np.full(further, 0.5),
        further_range=np.tile([19.5, 20.5], (further, 1)),
    )


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("kinds", KINDS)
def test_twenty_compiled_steps_are_those_predicted(joints, kinds):
    simulation = made_up(joints, kinds)
    window, scaling = simulation.window, simulation.scaling
    parameters, noise = simulation_parameters(simulation), noise_parameters(QUIET, simulation)
    state, random = simulation_state(parameters, random_state(0)), np.random.default_rng(0)
    observation = np.concatenate([np.tile([500.0, 0.2, 90.0, 80.0], joints), np.full(len(window.further), 20.1)])
    sigma = np.concatenate([np.tile(observation, 3), np.zeros(4 * joints)])
    begin(parameters, noise, state, scaled_state(sigma, window, scaling))
    visited = []
    for _ in range(20):
        command = random.integers(-1, 2, 2 * joints).astype(float)
        step(parameters, noise, state, (command / scaling.command_scale).astype(np.float32))
        following = simulation.predict(np.concatenate([sigma, command])[None])[0]
        past = 3 * window.observation_size
        sigma = np.concatenate([following, sigma[: past - len(following)], command, sigma[past : past + 2 * joints]])
        np.testing.assert_allclose(
            state.x[: window.state_size], scaled_state(sigma, window, scaling), rtol=0, atol=5e-4
        )
        visited.append(following)
    assert (np.ptp(visited, axis=0) > 0).all()
    further = np.array(visited)[:, window.joint_size :]
    assert ((further >= 19.5) & (further <= 20.5)).all()


@pytest.mark.parametrize("kinds", KINDS)
def test_noise_of_every_output_has_the_deviation_of_its_error(kinds):
    """Networks of zeros: what changes is the noise alone."""
    simulation = made_up(2, kinds)
    still = tuple(replace(one, output_weights=0 * one.output_weights, output_bias=np.zeros(1)) for one in
                  simulation.networks)  # fmt: skip
    wide = np.tile([-1e9, 1e9], (len(simulation.window.further), 1))
    simulation = replace(simulation, networks=still, further_range=wide)
    parameters, window = simulation_parameters(simulation), simulation.window
    noise = noise_parameters(NoiseSettings(kind="white", by_velocity=False), simulation)
    state, changes = simulation_state(parameters, random_state(3)), []
    none = np.zeros(4, np.float32)
    sigma = np.concatenate([np.tile(simulation.scaling.observation_offset, 3), np.zeros(8)])
    for _ in range(4000):
        begin(parameters, noise, state, scaled_state(sigma, window, simulation.scaling))
        step(parameters, noise, state, none)
        changes.append(state.x[: window.observation_size] * simulation.scaling.observation_scale)
    std = np.std(changes, axis=0)[simulation.outputs]
    np.testing.assert_allclose(std, simulation.errors[simulation.outputs], rtol=0.06)


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("kinds", KINDS)
def test_a_file_keeps_it_and_behind_the_seam_it_says_what_it_predicts(tmp_path, joints, kinds):
    simulation = made_up(joints, kinds)
    wide = np.tile([-1e3, 1e3], (len(simulation.window.further), 1))
    simulation = replace(simulation, further_range=wide)
    simulation.save(tmp_path / "sim")
    again = Simulation.load(tmp_path / "sim")
    assert (again.spec, again.window, again.velocity) == (simulation.spec, simulation.window, simulation.velocity)
    np.testing.assert_array_equal(again.limits, simulation.limits)
    np.testing.assert_array_equal(again.errors, simulation.errors)
    with SimulationArm(again, seed=1) as arm:
        assert arm.spec.further == simulation.window.needs
        said = []
        for _ in range(5):
            said.append(measured(checked(arm.read(), arm.spec), arm.spec.further))
            arm.wait(arm.spec.period)
    assert (np.ptp(said, axis=0) > 0).all()


def test_a_file_whose_arm_lacks_a_sensor_that_it_needs_is_refused(tmp_path):
    simulation = made_up(1, ("temperature",))
    replace(simulation, spec=ArmSpec()).save(tmp_path / "sim")
    with pytest.raises(UnusableInput, match="lacks joint_1_temperature_1"):
        Simulation.load(tmp_path / "sim")
    measuring = made_up(1, ("velocity",))
    replace(measuring, velocity="derived").save(tmp_path / "sim")
    with pytest.raises(UnusableInput, match="a measured velocity needs a network"):
        Simulation.load(tmp_path / "sim")


def test_a_sensor_that_knows_more_makes_a_better_fit(make_rows):
    """Without the hidden force that moves the angle the fit cannot foresee it; with it the error is the noise."""
    rows = make_rows(sequences=40)
    force = np.random.default_rng(1).normal(size=len(rows))
    pushed = rows.angle.copy()
    for k in range(1, len(rows)):
        if rows.step[k]:
            pushed[k, 0] += 20 * force[k - 1]
    spec = ArmSpec(sensors=(Sensor("acceleration"),))
    rows = replace(rows, angle=pushed, measured={"joint_1_acceleration": force})
    errors = {}
    for kinds in ((), ("acceleration",)):
        found = transitions(rows, Window.of(spec, 3, kinds))
        settings = FitSettings(epochs=15, sensors=kinds)
        made = fit(found, found, spec=spec, goal_range=np.array([[300.0, 700.0]]), settings=settings)
        errors[kinds] = made.std["angle"]
        assert made.simulation.spec.further == made.simulation.window.needs
        assert list(made.std)[4:] == list(made.simulation.window.further)
        assert len(made.outputs) == len(made.simulation.outputs)
    assert errors["acceleration",] < 0.5 * errors[()]


def test_a_monitor_expects_what_the_simulation_does(tmp_path):
    """On the simulation's own arm without noise nothing is unexpected, with readings of all sensors in the state."""
    simulation = made_up(1, ("velocity", "temperature", "acceleration"))
    with SimulationArm(simulation, noise=QUIET) as arm:
        monitor = Monitor(arm.spec, simulation)
        random, errors = np.random.default_rng(0), []
        for _ in range(12):
            reading = arm.read()
            valves = random.integers(-1, 2, (1, 2)).astype(np.int8)
            monitor.see(reading, valves)
            errors.append(np.abs(monitor._memory.angle - reading.angle).max())
            arm.set_valves(valves)
            arm.wait(arm.spec.period)
    assert max(errors[4:]) < 0.05
    other = Monitor(arm.spec, simulation)
    other.set_state(monitor.get_state())
    assert other.get_state() == monitor.get_state()


@pytest.mark.parametrize("wrong", [("humidity",), ("velocity", "velocity")])
def test_settings_refuse_sensors_that_there_are_not(wrong):
    with pytest.raises(UnusableInput, match="sensors"):
        FitSettings(sensors=wrong)
