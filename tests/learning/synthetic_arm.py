"""A made-up arm that is easy to control, as a simulation and as rows of a store: nothing has to be fitted."""

from dataclasses import replace

import numpy as np

from pneumarm.arm import ArmSpec
from pneumarm.networks.network import Network
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.begin import BeginStates, begin_states
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Window

OFFSET = np.array([512.0, 0.0, 90.0, 90.0])
SCALE = np.array([400.0, 5.0, 90.0, 90.0])


def synthetic_simulation(
    joints: int = 1,
    history: int = 3,
    hidden: int = 10,
    direct: bool = False,
    second: bool = False,
    hysteresis: tuple[float, ...] = (),
) -> Simulation:
    """Return an arm whose angle springs towards 0.5 (p1 - p2) and whose valves change the pressures.

    Its networks have one hidden layer; or a ``second`` one; or are ``direct``, without any. By stop operators of the
    radii in ``hysteresis`` [counts] it is held back.
    """
    window = Window(joints, history, hysteresis=hysteresis)
    networks = []
    for joint in range(joints):
        theta, p1, p2 = 4 * joint, 4 * joint + 2, 4 * joint + 3
        older = window.observation_size + theta if history > 1 else theta
        command = window.state_size + 2 * joint
        spring = {theta: -0.15, p1: 0.075, p2: -0.075}
        if history > 1:
            spring[theta] += 0.5
            spring[older] = -0.5
        memory = window.state_size - window.memory_size + joint * len(hysteresis)
        spring |= dict.fromkeys(range(memory, memory + len(hysteresis)), -0.03)
        networks.append(_network(window, spring, hidden, joint, direct, second))
        networks.append(_network(window, {command: 0.2}, hidden, joint + 10, direct, second))
        networks.append(_network(window, {command + 1: 0.2}, hidden, joint + 20, direct, second))
    return Simulation(
        spec=ArmSpec(joints=joints, name="synthetic"),
        window=window,
        scaling=Scaling(np.tile(OFFSET, joints), np.tile(SCALE, joints), np.ones(2 * joints)),
        networks=tuple(networks),
        velocity="derived",
        error_std=np.tile([4.0, 0.12, 1.0, 1.0], (joints, 1)),
        goal_range=np.tile([350.0, 670.0], (joints, 1)),
        pressure_range=np.tile([[0.0, 200.0], [0.0, 200.0]], (joints, 1, 1)),
    )


def in_steps(simulation: Simulation, steps: int) -> Simulation:
    """Return ``simulation`` of an arm whose pulses are so many ``steps`` of its period, or fewer."""
    step = simulation.spec.period / steps
    return replace(simulation, spec=replace(simulation.spec, shortest_pulse=step, pulse_step=step))


def _network(window: Window, linear: dict[int, float], hidden: int, seed: int, direct: bool, second: bool) -> Network:
    random = np.random.default_rng(seed)
    n = window.input_size
    d = np.zeros((n, 1))
    for place, value in linear.items():
        d[place] = value
    if direct:
        return Network(np.zeros((n, 0)), np.zeros(0), np.zeros((0, 1)), np.zeros(1), d)
    small = 0.05  # tanh is linear there
    w1 = random.normal(0, 0.3, (n, hidden))
    w1[:, 0] = small * d[:, 0]
    w2 = random.normal(0, 1e-3, (hidden, 1))
    w2[0] = 1 / small
    b1 = random.normal(0, 0.3, hidden)
    b1[0] = 0
    if not second:
        return Network(w1, b1, w2, -np.tanh(b1) @ w2)
    between = np.eye(hidden)[:, : hidden - 1]
    between[:, 1:] += random.normal(0, 0.1, (hidden, hidden - 2))
    bias = -np.tanh(b1) @ between  # nothing changes where nothing is done
    return Network(w1, b1, w2[:-1], np.zeros(1), None, between, bias)


def resting_rows(joints: int = 1, sequences: int = 1500, seed: int = 0) -> Rows:
    """Return sequences of two rows that begin at rest."""
    random = np.random.default_rng(seed)
    n = 2 * sequences
    pressure = np.repeat(random.uniform(10, 170, (sequences, joints, 2)), 2, axis=0)
    angle = OFFSET[0] + 0.5 * (pressure[..., 0] - pressure[..., 1]) / 90 * SCALE[0]
    command = np.zeros((n, joints, 2))
    command[1::2] = np.nan
    index = np.arange(n)
    return Rows(index // 2, index % 2, index / 30, angle, pressure, command, np.ones(n, bool))


def synthetic_begin_states(simulation: Simulation) -> BeginStates:
    return begin_states(
        resting_rows(simulation.window.joints), simulation.window, simulation.scaling, simulation.spec
    )


KINDS_OF_SIMULATION = {
    "one joint": synthetic_simulation(1, 3),
    "two joints, direct": synthetic_simulation(2, 2, direct=True),
    "history 1": synthetic_simulation(1, 1, direct=True),
    "two layers": synthetic_simulation(2, 2, second=True),
    "two joints with hysteresis": synthetic_simulation(2, 2, hysteresis=(15.0, 60.0)),
}
"""Of all that a gradient may have to go through."""
