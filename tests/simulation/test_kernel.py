"""The compiled simulation step against a plain NumPy reading of thesis eq. 3.5 and section 3.2.4."""

from dataclasses import replace
from itertools import accumulate

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.networks.network import Network
from pneumarm.networks.tansig import tansig
from pneumarm.random import random_state
from pneumarm.simulation.kernel import (
    begin,
    raw_observation,
    scaled_state,
    simulation_parameters,
    simulation_state,
    step,
)
from pneumarm.simulation.layout import layout_of, padded
from pneumarm.simulation.noise import NoiseSettings, noise_parameters
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.transitions.window import Window

QUIET = NoiseSettings(kind="none")


def made_up(
    joints: int = 1,
    history: int = 3,
    outputs: list[int] | None = None,
    velocity: str = "derived",
    direct: bool = False,
    second: bool = False,
    hysteresis: tuple[float, ...] = (),
) -> Simulation:
    """Return a simulation with random networks of different sizes; ``outputs`` of each network."""
    random = np.random.default_rng(joints + 10 * history)
    window = Window(joints, history, hysteresis=hysteresis)
    outputs = outputs or [1] * (3 * joints if velocity == "derived" else 4 * joints)
    networks = []
    for i, count in enumerate(outputs):
        hidden, last = 0 if direct and i == 0 else 7 + i, 5 + i if second else 7 + i
        networks.append(
            Network(
                random.normal(0, 0.4, (window.input_size, hidden)),
                random.normal(0, 0.4, hidden),
                random.normal(0, 0.05, (last if hidden else 0, count)),
                random.normal(0, 0.02, count),
                random.normal(0, 0.02, (window.input_size, count)) if direct else None,
                random.normal(0, 0.4, (hidden, last)) if second else None,
                random.normal(0, 0.4, last) if second else None,
            )
        )
    scaling = Scaling(
        random.uniform(80, 120, 4 * joints) * np.tile([5, 0.001, 1, 1], joints),
        random.uniform(80, 120, 4 * joints) * np.tile([4, 0.05, 1, 1], joints),
        random.uniform(0.5, 2, 2 * joints),
    )
    return Simulation(
        ArmSpec(joints=joints),
        window,
        scaling,
        tuple(networks),
        velocity,  # type: ignore[arg-type]
        np.tile([4.0, 0.12, 1.0, 1.0], (joints, 1)),
        np.tile([300.0, 700.0], (joints, 1)),
        np.tile([0.0, 190.0], (joints, 2, 1)),
    )


def reference(simulation: Simulation, sigma: NDArray, command: NDArray) -> NDArray:
    """Return the next raw window, in float64 with np.tanh, straight from the definitions."""
    window, scaling = simulation.window, simulation.scaling
    joints, h, o = window.joints, window.history, window.observation_size
    scaled = scaled_state(sigma, window, scaling).astype(np.float64)
    x = np.concatenate([scaled, command / scaling.command_scale])[None]
    change = np.concatenate([network(x)[0] for network in simulation.networks]).reshape(joints, -1)
    old = sigma[:o].reshape(joints, 4)
    new = old.copy()
    quantities = [0, 2, 3] if simulation.velocity == "derived" else [0, 1, 2, 3]
    new[:, quantities] += change * scaling.observation_scale.reshape(joints, 4)[:, quantities]
    new[:, 0] = np.clip(new[:, 0], *simulation.spec.angle_range)
    new[:, 2:] = np.clip(new[:, 2:], 0, 190)
    if simulation.velocity == "derived":
        new[:, 1] = (new[:, 0] - old[:, 0]) / (1e3 * simulation.spec.period)
    observations = np.concatenate([new.ravel(), sigma[: (h - 1) * o]])
    commands = np.concatenate([command, sigma[h * o :]])[: (h - 1) * 2 * joints]
    moved = np.repeat(new[:, 0] - old[:, 0], len(window.hysteresis))
    radii = np.tile(window.hysteresis, joints)
    stops = np.clip(sigma[window.state_size - window.memory_size :] + moved, -radii, radii)
    return np.concatenate([observations, commands, stops])


@pytest.mark.parametrize(
    "simulation",
    [
        made_up(),
        made_up(history=1),
        made_up(joints=2, history=4),
        made_up(outputs=[3]),
        made_up(direct=True),
        made_up(velocity="network"),
        made_up(joints=3, history=2, outputs=[9]),
        made_up(joints=2, outputs=[8], velocity="network", direct=True),
        made_up(second=True),
        made_up(joints=2, outputs=[6], second=True),
        made_up(joints=2, hysteresis=(5.0, 20.0)),
    ],
    ids=[
        "thesis",
        "history 1",
        "two joints",
        "one network",
        "direct",
        "velocity",
        "three joints",
        "all of it",
        "two layers",
        "one network of two layers",
        "hysteresis",
    ],
)
def test_twenty_steps_follow_the_definitions(simulation: Simulation) -> None:
    random = np.random.default_rng(0)
    window, scaling, joints = simulation.window, simulation.scaling, simulation.window.joints
    parameters, noise = simulation_parameters(simulation), noise_parameters(QUIET, simulation)
    state = simulation_state(parameters, random_state(0))
    observation = np.tile([500.0, 0.2, 90.0, 80.0], joints)
    others = np.zeros(window.state_size - window.history * window.observation_size)
    sigma = np.concatenate([np.tile(observation, window.history), others])
    begin(parameters, noise, state, scaled_state(sigma, window, scaling))
    visited = []
    for _ in range(20):
        command = random.integers(-1, 2, 2 * joints).astype(float)
        step(parameters, noise, state, (command / scaling.command_scale).astype(np.float32))
        predicted = simulation.predict(np.concatenate([sigma, command])[None])[0]
        sigma = reference(simulation, sigma, command)
        np.testing.assert_allclose(predicted, sigma[: len(predicted)], rtol=1e-5, atol=1e-5)
        got = state.x[: window.state_size]
        np.testing.assert_allclose(got, scaled_state(sigma, window, scaling), rtol=0, atol=5e-4)
        visited.append(sigma[0])
    assert np.ptp(visited) > 5  # the arm did move


def test_rational_hyperbolic_tangent() -> None:
    x = np.concatenate([np.linspace(-20, 20, 100_001), [np.inf, -np.inf, 0.0]]).astype(np.float32)
    got = x.copy()
    tansig(got)
    assert np.abs(got - np.tanh(x.astype(np.float64))).max() < 1e-5
    assert np.abs(got).max() <= 1 + 1e-6
    assert got[-1] == 0
    small = np.linspace(0.001, 6, 1000).astype(np.float32)
    grown = small.copy()
    tansig(grown)
    assert (np.diff(grown) > -1e-6).all()


@pytest.mark.parametrize("sign", [-1, 1])
def test_readings_stay_within_the_sensors(sign: int) -> None:
    simulation = made_up()
    pushed = tuple(replace(network, output_bias=np.array([sign * 9.0])) for network in simulation.networks)
    simulation = replace(simulation, networks=pushed)
    parameters, noise = simulation_parameters(simulation), noise_parameters(NoiseSettings(), simulation)
    state = simulation_state(parameters, random_state(0))
    for _ in range(5):
        step(parameters, noise, state, np.zeros(2, np.float32))
    angle, velocity, *pressures = raw_observation(state.x[:16], simulation.window, simulation.scaling)[0]
    low, high = simulation.spec.angle_range
    assert angle == pytest.approx(high if sign > 0 else low, abs=1e-2)
    assert velocity == pytest.approx(0, abs=1e-3)  # derived from the clipped angle
    assert pressures == pytest.approx([190 if sign > 0 else 0] * 2, abs=1e-2)


def test_layout_of_the_state_vector() -> None:
    assert layout_of(Window()) == (1, 3, 4, 2, 16, 0, 16, 18, 19, 20)
    assert layout_of(Window(hysteresis=(1.0, 5.0))) == (1, 3, 4, 2, 16, 2, 18, 20, 21, 24)
    assert layout_of(Window(2, 4)) == (2, 4, 8, 4, 44, 0, 44, 48, 50, 52)
    assert [*layout_of(Window(2)).angles] == [0, 4]
    assert layout_of(Window(2)).pressures == [2, 3, 6, 7]
    assert list(accumulate([padded(n, 16) for n in (1, 16, 17)])) == [16, 32, 64]
    state = simulation_state(simulation_parameters(made_up()), random_state(0))
    assert state.x.tolist() == [0] * 19 + [1]


def test_command_is_no_input_of_the_next_state() -> None:
    simulation = made_up()
    parameters, noise = simulation_parameters(simulation), noise_parameters(QUIET, simulation)
    state = simulation_state(parameters, random_state(0))
    step(parameters, noise, state, np.array([1, -1], np.float32))
    assert state.x[12:16].tolist() == [1, -1, 0, 0]  # remembered as a_{k-1}
    assert state.x[16:18].tolist() == [0, 0]
