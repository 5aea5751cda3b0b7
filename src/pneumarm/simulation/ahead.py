"""The fit goes on over several steps, so that what a simulation says of later steps is right, too.

A fit to single steps takes each reading for the truth. Most of the error of one step is noise of the readings, so
the networks see less in them than there is, and small errors that all point one way add up: to degrees within half
a second where joints stick. So the networks that were fitted to single steps make several of their own, each from
what the one before said, and the error of every step counts:

    cost = sum_k sum_i huber((o_k,i - predicted_k,i) / e_k,i)        e_k,i: such errors as the fit before leaves

(quadratic, and linear beyond 4, where something happened that cannot be predicted). Its gradient goes back through
all the steps (back-propagation through time), and Adam follows it. In system identification this is an output error
in place of an equation error (L. Ljung, "System Identification", 1999, section 4.2).
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import borrowed, kernel
from pneumarm.networks.layers import Trainable, adam, add_slopes, trainable
from pneumarm.networks.network import Network
from pneumarm.networks.tansig import FASTMATH
from pneumarm.simulation.gradient import StepWorkspace, step_all, step_back, step_workspace
from pneumarm.simulation.kernel import SimulationParameters, simulation_parameters
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.choice import hashed_uniform, held_out
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import transitions
from pneumarm.vectors import put

UPDATES = 1000
"""How often stretches are drawn and learned from; divided by the number of joints, whose networks are larger."""
_AT_ONCE = 256  # stretches
_RATE = 5e-4  # of Adam at the start; falls linearly to 0
_LONGEST_GRADIENT = 1.0
_MOST = 20_000  # stretches that are kept; 20 MB of one joint
_CLIP = 4.0  # errors beyond, such as of the moment in which a joint breaks loose, count linearly
_OF_MEDIAN = 0.674  # standard deviations, is the median of the size of a normal deviate
_LEAST = 1e-4  # scaled error; what has less never changes
_DRAWN = 9  # stream of random numbers
_BLOCK = 100  # updates between two reports


class Stretches(NamedTuple):
    """``n`` stretches of recorded movement, each of so many ``steps``, scaled as the simulation is."""

    state: NDArray[np.float32]
    """States in which they begin, shape (n, state_size)."""
    command: NDArray[np.float32]
    """Shape (n, steps, 2 joints)."""
    observed: NDArray[np.float32]
    """What the networks have to predict, shape (n, steps, outputs)."""


class StretchTape(NamedTuple):
    """What is kept of stretches on their way. Made by :func:`_tape`."""

    x: NDArray[np.float32]
    """States with their commands in place, shape (steps + 1, size, n)."""
    hidden: NDArray[np.float32]
    """Shape (steps, units, n)."""
    free: NDArray[np.float32]
    """1 where a prediction was not cut off at the limits of its sensor, else 0, shape (steps, outputs, n)."""
    command: NDArray[np.float32]
    """Shape (steps, 2 joints, n)."""
    observed: NDArray[np.float32]
    """Shape (steps, outputs, n)."""
    weight: NDArray[np.float32]
    """By which errors are multiplied, shape (steps, outputs)."""
    work: StepWorkspace
    later: NDArray[np.float32]
    """Workspace, shape (size, n)."""
    sooner: NDArray[np.float32]
    """Workspace, shape (size, n)."""


def stretches(source: Iterable[Rows], simulation: Simulation, steps: int) -> Stretches:
    """Return stretches of ``steps`` from ``source``, blocks of whole sequences that are not held out.

    At most 20,000 are kept: those with the smallest hashes, so that the choice does not depend on the blocks.
    """
    window, scaling, outputs = simulation.window, simulation.scaling, simulation.outputs
    kept = Stretches(
        np.zeros((0, window.state_size), np.float32),
        np.zeros((0, steps, window.command_size), np.float32),
        np.zeros((0, steps, len(outputs)), np.float32),
    )
    draws = np.zeros(0)
    for rows in source:
        found = transitions(rows, window)
        goes_on = (np.diff(found.sequence) == 0) & (np.diff(found.step) == 1)
        breaks = np.concatenate([[0], np.cumsum(~goes_on)])  # two rows with the same number belong together
        first = np.arange(max(len(breaks) - steps + 1, 0))
        first = first[breaks[first] == breaks[first + steps - 1]]
        first = first[~held_out(found.sequence[first], simulation.held_out, simulation.seed)]
        each = first[:, None] + np.arange(steps)
        sigma, command = np.split(found.inputs, [window.state_size], axis=1)
        new = Stretches(
            scaling.inputs(sigma[first], window).astype(np.float32),
            (command[each] / scaling.command_scale).astype(np.float32),
            ((found.target[each] - scaling.observation_offset) / scaling.observation_scale)[..., outputs].astype(
                np.float32
            ),
        )
        kept = Stretches(*(np.concatenate(pair) for pair in zip(kept, new, strict=True)))
        draws = np.concatenate([draws, hashed_uniform(simulation.seed, found.sequence[first], found.step[first])])
        if len(draws) > _MOST:
            chosen = np.sort(np.argpartition(draws, _MOST - 1)[:_MOST])
            kept, draws = Stretches(*(values[chosen] for values in kept)), draws[chosen]
    return kept


def fitted_ahead(
    simulation: Simulation,
    recorded: Stretches,
    seed: int,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Return ``simulation`` with networks fitted on, to all steps of what was ``recorded``.

    ``progress`` is told the share that is done. Where nothing was recorded that is long enough it stays as it is.
    """
    if not len(recorded.state):
        return simulation
    parameters = simulation_parameters(simulation)
    if len(parameters.direct):
        raise ValueError("a linear model has no hidden units that could be fitted over several steps")
    random = np.random.default_rng([seed, _DRAWN])
    net, parameters = _trainable(parameters)
    tape = _tape(simulation, parameters, recorded)
    _weigh(parameters, tape, recorded, random)
    updates = UPDATES // simulation.window.joints
    for number in range(updates):
        _put(tape, recorded, random)
        learn_ahead(net, parameters, tape)
        adam(net, _RATE * (1 - number / updates), _LONGEST_GRADIENT, number + 1)
        if progress is not None and number % _BLOCK == 0:
            progress(number / updates)
    parameters.output[:] = net.layers[-1][:-1].T
    return replace(simulation, networks=_networks(simulation, parameters))


def _trainable(parameters: SimulationParameters) -> tuple[Trainable, SimulationParameters]:
    """Return the networks as one that is trained, and parameters of which the hidden weights are in its memory.

    What connects units and outputs of different networks stays 0.
    """
    (size, units), outputs = parameters.hidden.shape, len(parameters.output_bias)
    unused = np.zeros((1, units), np.float32)  # the biases are weights of the 1 in the state
    layers = [np.concatenate([parameters.hidden, unused])]
    sizes = [size, units]
    if len(parameters.second):
        layers.append(np.concatenate([parameters.second, parameters.second_bias[None]]))
        sizes.append(len(parameters.second_bias))
    layers.append(np.concatenate([parameters.output.T, parameters.output_bias[None]]))
    flat = np.concatenate([layer.ravel() for layer in layers])
    net = trainable(flat, (*sizes, outputs), 1, (flat != 0).astype(np.float32))
    trained = parameters._replace(
        hidden=net.layers[0][:-1], output=parameters.output.copy(), output_bias=net.layers[-1][-1]
    )
    if len(parameters.second):
        trained = trained._replace(second=net.layers[1][:-1], second_bias=net.layers[1][-1])
    return net, trained


def _tape(simulation: Simulation, parameters: SimulationParameters, recorded: Stretches) -> StretchTape:
    (size, units), (_, steps, outputs) = parameters.hidden.shape, recorded.observed.shape
    commands = simulation.window.command_size

    def zeros(*shape: int) -> NDArray[np.float32]:
        return np.zeros((*shape, _AT_ONCE), np.float32)

    tape = StretchTape(
        x=zeros(steps + 1, size),
        hidden=zeros(steps, units),
        free=zeros(steps, outputs + parameters.stops.size),
        command=zeros(steps, commands),
        observed=zeros(steps, outputs),
        weight=np.ones((steps, outputs), np.float32),
        work=step_workspace(parameters, _AT_ONCE),
        later=zeros(size),
        sooner=zeros(size),
    )
    tape.x[:, parameters.layout.one] = 1
    return tape


def _put(tape: StretchTape, recorded: Stretches, random: np.random.Generator) -> None:
    """Put stretches drawn at random on the tape."""
    chosen = random.integers(len(recorded.state), size=_AT_ONCE)
    tape.x[0, : recorded.state.shape[1]] = recorded.state[chosen].T
    tape.command[...] = recorded.command[chosen].transpose(1, 2, 0)
    tape.observed[...] = recorded.observed[chosen].transpose(1, 2, 0)


def _weigh(
    parameters: SimulationParameters, tape: StretchTape, recorded: Stretches, random: np.random.Generator
) -> None:
    """Make the errors of each step and output as large as those of the others are."""
    sizes = []
    for _ in range(8):
        _put(tape, recorded, random)
        move_ahead(parameters, tape)
        sizes.append(np.abs(tape.x[1:, parameters.place] - tape.observed))
    usual = np.median(np.concatenate(sizes, axis=2), axis=2) / _OF_MEDIAN
    tape.weight[...] = 1 / np.maximum(usual, _LEAST)


@kernel(fastmath=FASTMATH)
def move_ahead(simulation, tape):  # type: ignore[no-untyped-def]
    """Let the simulation make all steps of the stretches on the tape."""
    first, commanded = simulation.layout.command, simulation.layout.commanded
    for t in range(tape.command.shape[0]):
        put(tape.x[t, first : first + commanded], tape.command[t])
        step_all(simulation, tape.x[t], tape.x[t + 1], tape.work)
        put(tape.hidden[t], tape.work.hidden)
        put(tape.free[t], tape.work.free)


@kernel(fastmath=FASTMATH)
def learn_ahead(net, simulation, tape):  # type: ignore[no-untyped-def]
    """Add the gradient of the mean cost of a step to ``net.gradient``."""
    net, simulation, tape = borrowed((net, simulation, tape))
    last = len(net.layers) - 1
    for o in range(simulation.output.shape[0]):
        for u in range(simulation.output.shape[1]):
            simulation.output[o, u] = net.layers[last][u, o]
    move_ahead(simulation, tape)
    first, commanded, clip = simulation.layout.command, simulation.layout.commanded, np.float32(_CLIP)
    steps, outputs, n = tape.observed.shape
    share = np.float32(1.0 / (steps * n))
    later, sooner, work = tape.later, tape.sooner, tape.work
    later[:] = np.float32(0.0)
    for back in range(steps):
        t = steps - 1 - back
        for o in range(outputs):
            place, weight = simulation.place[o], tape.weight[t, o]
            for e in range(n):
                error = (tape.x[t + 1, place, e] - tape.observed[t, o, e]) * weight
                later[place, e] += min(max(error, -clip), clip) * weight * share
        put(work.hidden, tape.hidden[t])
        put(work.free, tape.free[t])
        step_back(simulation, later, sooner, work)
        add_slopes(tape.x[t], work.slope, net.slopes[0])
        if last == 2:
            add_slopes(work.hidden, work.second_slope, net.slopes[1])
        add_slopes(work.second if last == 2 else work.hidden, work.change, net.slopes[last])
        put(later, sooner)
        later[first : first + commanded] = np.float32(0.0)  # commands are as they were


def _networks(simulation: Simulation, parameters: SimulationParameters) -> tuple[Network, ...]:
    """Return the networks of which ``parameters`` are made."""
    inputs, one = simulation.window.input_size, parameters.layout.one
    networks, u, s, o = [], 0, 0, 0
    for network in simulation.networks:
        units = last = slice(u, u + network.hidden_bias.size)
        outputs = slice(o, o + network.output_bias.size)
        u, o = units.stop, outputs.stop
        if network.second_bias is not None:
            last = slice(s, s + network.second_bias.size)
            s = last.stop
            network = replace(
                network,
                second_weights=parameters.second[units, last].astype(np.float64),
                second_bias=parameters.second_bias[last].astype(np.float64),
            )
        networks.append(
            replace(
                network,
                hidden_weights=parameters.hidden[:inputs, units].astype(np.float64),
                hidden_bias=parameters.hidden[one, units].astype(np.float64),
                output_weights=parameters.output[outputs, last].T.astype(np.float64),
                output_bias=parameters.output_bias[outputs].astype(np.float64),
            )
        )
    return tuple(networks)
