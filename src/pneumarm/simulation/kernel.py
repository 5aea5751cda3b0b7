"""The simulation as a compiled step, in scaled units.

Everything that reads the state reads one float32 vector, laid out as :mod:`.layout` says. The networks of the
simulation have zero weights at the goal, those of an agent at the command. All hidden units of all networks of one
kind lie side by side, ``[input][unit]``, padded to a multiple of sixteen, so that the compiler turns the loop over
units into vector instructions; four inputs at a time, so that what is summed is loaded and stored less often.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.kernels import part
from pneumarm.networks.tansig import FASTMATH, tansig
from pneumarm.random import RandomState
from pneumarm.simulation.layout import Layout, angle_at, command_at, layout_of, padded, velocity_at
from pneumarm.simulation.noise import add_noise, begin_noise
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.transitions.window import Window
from pneumarm.vectors import product, weighted_sums

UNIT_BLOCK = 16


class SimulationParameters(NamedTuple):
    """A simulation as a kernel needs it. Made by :func:`simulation_parameters`."""

    hidden: NDArray[np.float32]
    """W1 and b1 of all networks, shape (inputs, units)."""
    second: NDArray[np.float32]
    """Second hidden layers of all networks, with zeros between units of different ones, shape (units, second units);
    (0, 0) where networks have one layer."""
    second_bias: NDArray[np.float32]
    """Shape (second units,)."""
    output: NDArray[np.float32]
    """W2 of all networks with zeros where an output belongs to another network, shape (outputs, units of the last
    layer)."""
    output_bias: NDArray[np.float32]
    """b2, shape (outputs,)."""
    direct: NDArray[np.float32]
    """D, shape (outputs, inputs), or (0, inputs) where no network has such a part."""
    read: NDArray[np.int64]
    """Where what the networks read of the inputs begins and ends, shape (stretches, 2)."""
    place: NDArray[np.int64]
    """Place of each output in the observation, shape (outputs,)."""
    lowest: NDArray[np.float32]
    """Lowest prediction, shape (outputs,) [scaled]."""
    highest: NDArray[np.float32]
    """Highest prediction, shape (outputs,) [scaled]."""
    velocity: NDArray[np.float32]
    """Derived velocity by change of the angle, and at rest, shape (joints, 2) [scaled]; (0, 2) if predicted."""
    stops: NDArray[np.float32]
    """Change of each stop operator by that of its angle, both scaled, shape (joints, remembered)."""
    layout: Layout


class SimulationState(NamedTuple):
    """What one simulated arm changes: its state, its noise, its random state, and workspace for sums."""

    x: NDArray[np.float32]
    """State vector, see :mod:`.layout`, shape (inputs,)."""
    average: NDArray[np.float32]
    """Moving average of the noise, shape (outputs,)."""
    random: RandomState
    hidden: NDArray[np.float32]
    """Shape (units,)."""
    second: NDArray[np.float32]
    """Shape (second units,)."""
    change: NDArray[np.float32]
    """Shape (outputs,)."""


def simulation_parameters(simulation: Simulation) -> SimulationParameters:
    """Pack ``simulation`` into float32 arrays."""
    window, scaling = simulation.window, simulation.scaling
    layout = layout_of(window)
    hidden_sizes = [network.hidden_bias.size for network in simulation.networks]
    second_sizes = [0 if network.second_bias is None else network.second_bias.size for network in simulation.networks]
    output_sizes = [network.output_bias.size for network in simulation.networks]
    inputs, outputs = window.input_size, sum(output_sizes)
    units, second_units = (padded(sum(sizes), UNIT_BLOCK) for sizes in (hidden_sizes, second_sizes))
    hidden = np.zeros((layout.size, units))
    second, second_bias = np.zeros((units if second_units else 0, second_units)), np.zeros(second_units)
    output, output_bias = np.zeros((outputs, second_units or units)), np.zeros(outputs)
    has_direct = any(network.direct is not None for network in simulation.networks)
    direct = np.zeros((outputs if has_direct else 0, layout.size))
    u = s = o = 0
    for network, h, m, n in zip(simulation.networks, hidden_sizes, second_sizes, output_sizes, strict=True):
        hidden[:inputs, u : u + h] = network.hidden_weights
        hidden[layout.one, u : u + h] = network.hidden_bias
        if network.second_weights is None:
            output[o : o + n, u : u + h] = network.output_weights.T
        else:
            second[u : u + h, s : s + m] = network.second_weights
            second_bias[s : s + m] = network.second_bias
            output[o : o + n, s : s + m] = network.output_weights.T
        output_bias[o : o + n] = network.output_bias
        if network.direct is not None:
            direct[o : o + n, :inputs] = network.direct.T
        u, s, o = u + h, s + m, o + n

    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    limits = simulation.limits
    lowest, highest = (limits - scaling.observation_offset) / scaling.observation_scale
    rate = scale[:, 0] / (1e3 * simulation.spec.period * scale[:, 1])
    velocity = np.stack([rate, -offset[:, 1] / scale[:, 1]], axis=1)
    return SimulationParameters(
        hidden=_float32(hidden),
        second=_float32(second),
        second_bias=_float32(second_bias),
        output=_float32(output),
        output_bias=_float32(output_bias),
        direct=_float32(direct),
        read=_stretches(np.asarray(np.concatenate([hidden.T, direct]).any(axis=0))),
        place=simulation.outputs,
        lowest=_float32(lowest[simulation.outputs]),
        highest=_float32(highest[simulation.outputs]),
        velocity=_float32(velocity if simulation.velocity == "derived" else velocity[:0]),
        stops=stops_by_angle(window, scaling),
        layout=layout,
    )


def simulation_state(simulation: SimulationParameters, random: RandomState) -> SimulationState:
    """Return a state for ``simulation`` with a window of zeros, drawing its noise from ``random``."""
    inputs, units = simulation.hidden.shape
    outputs = simulation.output_bias.size
    x = np.zeros(inputs, np.float32)
    x[simulation.layout.one] = 1
    return SimulationState(
        x=x,
        average=np.zeros(outputs, np.float32),
        random=random,
        hidden=np.zeros(units, np.float32),
        second=np.zeros(simulation.second_bias.size, np.float32),
        change=np.zeros(outputs, np.float32),
    )


def scaled_state(sigma: ArrayLike, window: Window, scaling: Scaling) -> NDArray[np.float32]:
    """Return windows ``sigma`` (..., state_size) in sensor units as scaled ones."""
    return scaling.inputs(sigma, window).astype(np.float32)


def raw_observation(sigma: ArrayLike, window: Window, scaling: Scaling) -> NDArray[np.float64]:
    """Return the joints' part (..., joints, 4) of the newest observation of scaled windows, in sensor units."""
    return window.of_joints(raw_observations(sigma, scaling))


def raw_observations(sigma: ArrayLike, scaling: Scaling) -> NDArray[np.float64]:
    """Return the newest observation (..., observation_size) of scaled windows ``sigma``, in sensor units."""
    newest = np.asarray(sigma, np.float64)[..., : scaling.observation_offset.size]
    raw: NDArray[np.float64] = newest * scaling.observation_scale + scaling.observation_offset
    return raw


def _float32(array: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(array, np.float32)


def _stretches(read: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return where each stretch of True begins and ends, shape (stretches, 2)."""
    change = np.diff(read.astype(np.int8), prepend=0, append=0)
    return np.stack([np.flatnonzero(change > 0), np.flatnonzero(change < 0)], axis=1)


@part
def hidden_layer(weights, x, hidden):  # type: ignore[no-untyped-def]
    """Set ``hidden`` (units,) to tansig(x W), ``weights`` (at least inputs, units), ``x`` (inputs,)."""
    weighted_sums(x, weights, 0, hidden)
    tansig(hidden)


@part(fastmath=FASTMATH)
def predict_change(simulation, state):  # type: ignore[no-untyped-def]
    """Set ``state.change`` to what the networks predict for the state and the command in ``state.x``."""
    x, hidden = state.x, state.hidden
    hidden_layer(simulation.hidden, x, hidden)
    if simulation.second.shape[0] > 0:
        weighted_sums(hidden, simulation.second, 0, state.second)
        for u in range(state.second.shape[0]):
            state.second[u] += simulation.second_bias[u]
        tansig(state.second)
        hidden = state.second
    for o in range(simulation.output_bias.shape[0]):
        state.change[o] = product(hidden, simulation.output[o]) + simulation.output_bias[o]
    for o in range(simulation.direct.shape[0]):
        for i in range(x.shape[0]):
            state.change[o] += x[i] * simulation.direct[o, i]


@part(entry=True)
def shift(layout, x, command):  # type: ignore[no-untyped-def]
    """Move the observations in the window at the begin of ``x`` one step into the past, and remember ``command``.

    The newest observation stays as it is until another is written over it.
    """
    newest = command_at(layout, 1)
    for i in range(newest - 1, layout.observed - 1, -1):
        x[i] = x[i - layout.observed]
    if layout.history > 1:
        for i in range(layout.memory - 1, newest + layout.commanded - 1, -1):
            x[i] = x[i - layout.commanded]
        for i in range(layout.commanded):
            x[newest + i] = command[i]


@part(entry=True)
def remember(layout, by_angle, x, joint, moved, most):  # type: ignore[no-untyped-def]
    """Let the stop operators of ``joint`` in ``x`` follow an angle that has ``moved``, up to ``most`` either way.

    All is scaled: ``by_angle`` (joints, remembered) is the change of operators, whose ends are -1 and 1, by the
    angle's.
    """
    for i in range(layout.remembered):
        place = layout.memory + joint * layout.remembered + i
        x[place] = min(max(x[place] + by_angle[joint, i] * moved, -most), most)


def stops_by_angle(window: Window, scaling: Scaling) -> NDArray[np.float32]:
    """Return the change of stop operators by that of their angle, both scaled, shape (joints, remembered)."""
    scale = window.of_joints(scaling.observation_scale)[:, :1]
    return _float32(scale / np.array(window.hysteresis, np.float64))


@part
def push(simulation, x, change, command):  # type: ignore[no-untyped-def]
    """Shift the window in ``x`` by one step: add ``change`` to the newest observation, remember ``command``."""
    layout = simulation.layout
    shift(layout, x, command)
    for joint in range(layout.joints):
        remember(layout, simulation.stops, x, joint, -x[angle_at(layout, 0, joint)], np.float32(np.inf))
    for joint in range(simulation.velocity.shape[0]):
        x[velocity_at(layout, 0, joint)] = x[angle_at(layout, 0, joint)]
    for o in range(change.shape[0]):
        place = simulation.place[o]
        x[place] = min(max(x[place] + change[o], simulation.lowest[o]), simulation.highest[o])
    for joint in range(simulation.velocity.shape[0]):
        velocity = velocity_at(layout, 0, joint)
        moved = x[angle_at(layout, 0, joint)] - x[velocity]
        x[velocity] = moved * simulation.velocity[joint, 0] + simulation.velocity[joint, 1]
    for joint in range(layout.joints):
        remember(layout, simulation.stops, x, joint, x[angle_at(layout, 0, joint)], np.float32(1.0))


@part
def put_command(simulation, x, command):  # type: ignore[no-untyped-def]
    """Put the scaled ``command`` (2 joints,) into ``x``, where the networks of the simulation read it."""
    for i in range(command.shape[0]):
        x[simulation.layout.command + i] = command[i]


@part
def settle(simulation, noise, state, command):  # type: ignore[no-untyped-def]
    """Let ``state`` go to what ``state.change`` predicts, with noise."""
    x = state.x
    for i in range(command.shape[0]):
        x[simulation.layout.command + i] = np.float32(0.0)  # so that the command of the past is no input of an agent
    add_noise(noise, x, state.change, state.average, state.random)
    push(simulation, x, state.change, command)


@part(entry=True)
def step(simulation, noise, state, command):  # type: ignore[no-untyped-def]
    """Let ``state`` advance by one control period under the scaled ``command`` (2 joints,)."""
    put_command(simulation, state.x, command)
    predict_change(simulation, state)
    settle(simulation, noise, state, command)


@part(entry=True)
def begin(simulation, noise, state, sigma):  # type: ignore[no-untyped-def]
    """Put ``state`` into the scaled window ``sigma`` (state_size,), with noise that went on before it."""
    for i in range(sigma.shape[0]):
        state.x[i] = sigma[i]
    begin_noise(noise, state.average, state.random)
