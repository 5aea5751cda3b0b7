"""What a simulation would do: its step on many copies of a state, without noise."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import part
from pneumarm.random import random_state
from pneumarm.simulation.kernel import (
    SimulationParameters,
    SimulationState,
    simulation_parameters,
    simulation_state,
    step,
)
from pneumarm.simulation.layout import angle_at, pressure_at, velocity_at
from pneumarm.simulation.noise import NoiseParameters, NoiseSettings, noise_parameters
from pneumarm.simulation.simulation import Simulation


class SimulatedWorld(NamedTuple):
    """What does not change in rollouts of a simulation, and a step's workspace. Made by :func:`simulated_world`."""

    simulation: SimulationParameters
    noise: NoiseParameters
    workspace: SimulationState
    """Only its sums and its random state are used; the state itself lies in :class:`SimulatedStates`."""
    unit: NDArray[np.float64]
    """Offset and scale of the observations, shape (joints, 4, 2) [sensor units]."""
    command_scale: NDArray[np.float64]
    """Shape (joints, 2)."""
    command: NDArray[np.float32]
    """Workspace, shape (2 joints,)."""
    limit: float
    """Inlets stay closed while their muscle reads over this [counts]."""


class SimulatedStates(NamedTuple):
    """``n`` states of a simulation. Made by :func:`simulated_states`."""

    x: NDArray[np.float32]
    """State vectors, see :mod:`.layout`, shape (n, inputs)."""
    angle: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    velocity: NDArray[np.float64]
    """Shape (n, joints) [counts/ms]."""
    pressure: NDArray[np.float64]
    """Shape (n, joints, 2) [counts]."""


def simulated_world(simulation: Simulation) -> SimulatedWorld:
    """Return ``simulation`` for rollouts."""
    window, joints, scaling = simulation.window, simulation.window.joints, simulation.scaling
    parameters = simulation_parameters(simulation)
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    return SimulatedWorld(
        simulation=parameters,
        noise=noise_parameters(NoiseSettings(kind="none"), simulation),
        workspace=simulation_state(parameters, random_state(0)),
        unit=np.stack([offset, scale], axis=-1),
        command_scale=np.ascontiguousarray(scaling.command_scale.reshape(joints, 2)),
        command=np.zeros(2 * joints, np.float32),
        limit=simulation.spec.max_pressure_counts,
    )


def simulated_states(world: SimulatedWorld, n: int) -> SimulatedStates:
    """Return workspace for ``n`` states of a simulation."""
    joints = len(world.unit)
    return SimulatedStates(
        x=np.tile(world.workspace.x, (n, 1)),
        angle=np.empty((n, joints)),
        velocity=np.empty((n, joints)),
        pressure=np.empty((n, joints, 2)),
    )


@part(entry=True)
def look_simulated(world, states, i):  # type: ignore[no-untyped-def]
    """Set the readings of state ``i`` to what its vector says."""
    x, unit, layout = states.x, world.unit, world.simulation.layout
    for j in range(states.angle.shape[1]):
        states.angle[i, j] = unit[j, 0, 0] + unit[j, 0, 1] * x[i, angle_at(layout, 0, j)]
        states.velocity[i, j] = unit[j, 1, 0] + unit[j, 1, 1] * x[i, velocity_at(layout, 0, j)]
        for m in range(2):
            pressure = x[i, pressure_at(layout, 0, j, m)]
            states.pressure[i, j, m] = unit[j, 2 + m, 0] + unit[j, 2 + m, 1] * pressure


@part(entry=True)
def copy_simulated(states, to, source):  # type: ignore[no-untyped-def]
    """Copy state ``source`` to the place ``to``."""
    for k in range(states.x.shape[1]):
        states.x[to, k] = states.x[source, k]
    for j in range(states.angle.shape[1]):
        states.angle[to, j] = states.angle[source, j]
        states.velocity[to, j] = states.velocity[source, j]
        for m in range(2):
            states.pressure[to, j, m] = states.pressure[source, j, m]


@part(entry=True)
def advance_simulated(world, states, i, valves):  # type: ignore[no-untyped-def]
    """Let one control period pass in state ``i`` with ``valves`` (joints, 2)."""
    for j in range(states.angle.shape[1]):
        for m in range(2):
            world.command[2 * j + m] = valves[j, m] / world.command_scale[j, m]
    workspace = world.workspace
    state = SimulationState(
        states.x[i], workspace.average, workspace.random, workspace.hidden, workspace.second, workspace.change
    )
    step(world.simulation, world.noise, state, world.command)
    look_simulated(world, states, i)
