"""Movements in the simulation, and the gradient of what they cost through all of their steps.

    forward:   u_k = pi(s_k + noise, r),  s_{k+1} = simulation(s_k, u_k),
               cost = sum_k price(s_{k+1}, r_{k+1}, u_k, u_{k-1})
    backward:  the derivatives by s_{k+1} give those by u_k and s_k; those by u_k go through pi, whose weights
               gather them, to s_k as well

The simulation is differentiable and fast, so the policy's gradient is had exactly instead of being sampled: an
analytic policy gradient, or back-propagation through time (P. J. Werbos, Proc. IEEE 78(10), 1990).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import borrowed, inner, kernel
from pneumarm.learning.servo.commands import CommandParameters, write_commands
from pneumarm.learning.servo.inputs import SeenParameters, input_size, inputs_back, write_inputs
from pneumarm.networks.layers import Trainable, backward, forward, through_weights
from pneumarm.networks.tansig import FASTMATH
from pneumarm.simulation.gradient import StepWorkspace, step_all, step_back, step_workspace
from pneumarm.simulation.kernel import SimulationParameters
from pneumarm.simulation.layout import angle_at, command_at, pressure_at
from pneumarm.task.price import (
    PriceParameters,
    price_of_changes,
    price_of_cocontraction,
    price_of_error,
    price_of_slack,
)
from pneumarm.vectors import put

_ZERO = np.float32(0.0)


class ServoTask(NamedTuple):
    """What does not change while a servo learns."""

    simulation: SimulationParameters
    inputs: SeenParameters
    commands: CommandParameters
    prices: PriceParameters
    lowest: NDArray[np.float32]
    """Lowest pressures, shape (joints, 2) [scaled]."""
    to_share: NDArray[np.float32]
    """From scaled pressures to shares of the range, shape (joints, 2)."""
    past_the_limit: float
    """Share of the gradient that passes where a prediction was cut off at the limit of its sensor.

    The pressure of an empty muscle is: without that share nothing would ever teach a policy to fill it again.
    """
    steepest: float
    """Most that the cost to come changes with the state of an arm, in prices of a step for an error of a tolerance.

    Where a policy does well it changes by 10 to 40. Where one makes an arm swing, the change grows with every step
    that it is traced back through, to 1e10 and beyond, and a single arm decides the direction of an update; where it
    is cut off, all arms have a say.
    """


class Tape(NamedTuple):
    """Movements of ``n`` arms over some ``steps``, and what the gradient needs of them. Made by :func:`tape`."""

    x: NDArray[np.float32]
    """States with their commands in place, shape (steps + 1, size, n) [scaled]."""
    hidden: NDArray[np.float32]
    """Hidden units of the simulation, shape (steps, units, n)."""
    free: NDArray[np.float32]
    """1 where a prediction was not cut off, else the share of the gradient that passes, shape (steps, outputs, n)."""
    inputs: NDArray[np.float32]
    """What the policy saw, shape (steps, inputs, n)."""
    units: NDArray[np.float32]
    """Hidden units of the policy, layer after layer, shape (steps, units, n)."""
    slope: NDArray[np.float32]
    """Derivatives of the commands by the policy's outputs, shape (steps, 2 joints, n)."""
    noise: NDArray[np.float32]
    """Of readings of angle and pressures, shape (steps + history - 1, 3 joints, n) [scaled]."""
    reference: NDArray[np.float32]
    """What is asked for at each step, shape (steps + 1, joints, n) [scaled]."""
    preview: NDArray[np.float32]
    """What the policy is shown of it, shape (steps, previews, joints, n) [scaled]."""
    work: StepWorkspace
    later: NDArray[np.float32]
    """Workspace, shape (size, n)."""
    sooner: NDArray[np.float32]
    """Workspace, shape (size, n)."""
    seen: NDArray[np.float32]
    """Derivatives by the policy's inputs, shape (inputs, n)."""
    row: NDArray[np.float32]
    """Workspace, shape (3, n)."""
    underway: NDArray[np.bool_]
    """Which joints are on their way to a goal that stays, now, shape (joints, n)."""


def tape(task: ServoTask, steps: int, n: int, hidden: int = 0) -> Tape:
    """Return room for movements of ``n`` arms over ``steps``, by a policy with so many ``hidden`` units if by one."""
    simulation, joints = task.simulation, task.simulation.layout.joints
    (size, units), outputs = simulation.hidden.shape, simulation.output_bias.size
    inputs, previews = input_size(task.inputs), task.inputs.steps.size

    def zeros(*shape: int) -> NDArray[np.float32]:
        return np.zeros((*shape, n), np.float32)

    return Tape(
        x=zeros(steps + 1, size),
        hidden=zeros(steps, units),
        free=zeros(steps, outputs + simulation.stops.size),
        inputs=zeros(steps, inputs),
        units=zeros(steps, hidden),
        slope=zeros(steps, 2 * joints),
        noise=zeros(steps + simulation.layout.history - 1, 3 * joints),
        reference=zeros(steps + 1, joints),
        preview=zeros(steps, previews, joints),
        work=step_workspace(simulation, n),
        later=zeros(size),
        sooner=zeros(size),
        seen=zeros(inputs),
        row=zeros(3),
        underway=np.zeros((joints, n), np.bool_),
    )


@kernel(fastmath=FASTMATH)
def move_forward(task, net, tape):  # type: ignore[no-untyped-def]
    """Let the policy ``net`` move all arms from ``tape.x[0]`` on."""
    task, net, tape = borrowed((task, net, tape))
    simulation = task.simulation
    first, commanded = simulation.layout.command, simulation.layout.commanded
    for t in range(tape.slope.shape[0]):
        x = tape.x[t]
        write_inputs(task.inputs, x, tape.noise, t + simulation.layout.history - 1, tape.preview[t], tape.inputs[t])
        forward(net.layers, tape.inputs[t], net.units)
        end = 0
        for layer in range(len(net.units) - 1):
            begin, end = end, end + net.units[layer].shape[0]
            put(tape.units[t, begin:end], net.units[layer])
        if task.commands.coarse > 0:
            note_underway(task, tape, t)
        write_commands(task.commands, x, tape.underway, net.units[-1], tape.slope[t], x[first : first + commanded])
        step_all(simulation, x, tape.x[t + 1], tape.work)
        put(tape.hidden[t], tape.work.hidden)
        note_free(task, tape, t)


@inner(fastmath=FASTMATH)
def note_free(task, tape, t):  # type: ignore[no-untyped-def]
    """Note what share of the gradient passes at step ``t``."""
    least, free = np.float32(task.past_the_limit), tape.work.free
    put(tape.free[t], free)
    for o in range(tape.work.change.shape[0]):
        for e in range(free.shape[1]):
            tape.free[t, o, e] = max(free[o, e], least)


@inner(fastmath=FASTMATH)
def note_underway(task, tape, t):  # type: ignore[no-untyped-def]
    """Note which joints are on their way to a goal that stays, at step ``t``."""
    layout, commands = task.simulation.layout, task.commands
    lag = layout.history - 1
    near, slow = np.float32(commands.near), np.float32(commands.slow * lag)
    for joint in range(tape.underway.shape[0]):
        scale, now, then = task.inputs.tolerances[joint], angle_at(layout, 0, joint), angle_at(layout, lag, joint)
        for e in range(tape.underway.shape[1]):
            angle, wanted = tape.x[t, now, e], tape.preview[t, 0, joint, e]
            moves = abs(angle - tape.x[t, then, e]) * scale > slow or abs(angle - wanted) * scale > near
            tape.underway[joint, e] = moves and wanted == tape.preview[t, -1, joint, e]


@inner(fastmath=FASTMATH)
def errors_at(task, tape, t, joint, error):  # type: ignore[no-untyped-def]
    """Set ``error`` (n,) to how far ``joint`` is from what is asked for at step ``t`` [tolerances]."""
    scale, angle = task.inputs.tolerances[joint], angle_at(task.simulation.layout, 0, joint)
    for e in range(error.shape[0]):
        error[e] = (tape.x[t, angle, e] - tape.reference[t, joint, e]) * scale


@inner(fastmath=FASTMATH)
def prices_of_pressures(task, tape, t, joint, row):  # type: ignore[no-untyped-def]
    """Set ``row`` (3, n) to the price of the pressures of ``joint`` at step ``t`` and its slopes by both [scaled]."""
    layout, scale = task.simulation.layout, task.inputs.tolerances[joint]
    angle, first = angle_at(layout, 0, joint), pressure_at(layout, 0, joint, 0)
    empty, to_share = task.lowest[joint], task.to_share[joint]
    for e in range(row.shape[1]):
        wanted = tape.reference[t, joint, e]
        one = (tape.x[t, first, e] - empty[0]) * to_share[0]
        two = (tape.x[t, first + 1, e] - empty[1]) * to_share[1]
        if wanted == tape.reference[t - 1, joint, e]:
            error = (tape.x[t, angle, e] - wanted) * scale
            price_one, by_one = price_of_slack(task.prices, error, one)
            price_two, by_two = price_of_slack(task.prices, error, two)
            price = price_one + price_two
        else:
            price, by_mean = price_of_cocontraction(task.prices, np.float32(0.5) * (one + two))
            by_one = by_two = np.float32(0.5) * by_mean
        row[0, e], row[1, e], row[2, e] = price, by_one * to_share[0], by_two * to_share[1]


@inner(fastmath=FASTMATH)
def price_of_a_step(task, tape, t, share):  # type: ignore[no-untyped-def]
    """Return the price of all arms at step ``t``; set ``tape.sooner`` to ``share`` of its derivatives.

    They are those by the state and the command of step ``t``; ``tape.later``, which is used up, are those of the
    steps that follow, by the state after it.
    """
    simulation, later, sooner, row = task.simulation, tape.later, tape.sooner, tape.row
    layout, n = simulation.layout, tape.row.shape[1]
    first, commanded, before_first = layout.command, layout.commanded, command_at(layout, 1)
    total = 0.0
    for joint in range(layout.joints):
        errors_at(task, tape, t + 1, joint, row[0])
        total += price_of_error(task.prices, row[0], row[1])
        scale, angle = task.inputs.tolerances[joint] * share, angle_at(layout, 0, joint)
        pressure = pressure_at(layout, 0, joint, 0)
        for e in range(n):
            later[angle, e] += row[1, e] * scale
        prices_of_pressures(task, tape, t + 1, joint, row)
        for e in range(n):
            total += row[0, e]
            later[pressure, e] += row[1, e] * share
            later[pressure + 1, e] += row[2, e] * share
    put(tape.work.hidden, tape.hidden[t])
    put(tape.work.free, tape.free[t])
    step_back(simulation, later, sooner, tape.work)
    for c in range(commanded):
        command, before = tape.x[t, first + c], row[0]
        before[:] = _ZERO
        if layout.history > 1:
            for e in range(n):
                before[e] = tape.x[t, before_first + c, e]
        total += price_of_changes(task.prices, command, before, row[1], row[2])
        for e in range(n):
            sooner[first + c, e] += row[1, e] * share
        if layout.history > 1:
            for e in range(n):
                sooner[before_first + c, e] += row[2, e] * share
    return total


@kernel(fastmath=FASTMATH)
def move_back(task, net, tape):  # type: ignore[no-untyped-def]
    """Add the gradient of the mean cost a step to ``net.gradient``, after :func:`move_forward`; return the cost."""
    task, net, tape = borrowed((task, net, tape))
    simulation = task.simulation
    first, commanded = simulation.layout.command, simulation.layout.commanded
    steps, n = tape.slope.shape[0], tape.slope.shape[2]
    share = np.float32(1.0 / (steps * n))
    later, sooner = tape.later, tape.sooner
    later[:] = _ZERO
    total = 0.0
    for back in range(steps):
        t = steps - 1 - back
        total += price_of_a_step(task, tape, t, share)
        end = 0
        for layer in range(len(net.units) - 1):
            begin, end = end, end + net.units[layer].shape[0]
            put(net.units[layer], tape.units[t, begin:end])
        for c in range(commanded):
            for e in range(n):
                net.errors[-1][c, e] = sooner[first + c, e] * tape.slope[t, c, e]
                sooner[first + c, e] = _ZERO
        backward(net, tape.inputs[t])
        through_weights(net.layers[0], net.errors[0], tape.seen)
        inputs_back(task.inputs, tape.inputs[t], tape.seen, sooner)
        go_sooner(task, tape, share)
    return total * share


@inner(fastmath=FASTMATH)
def go_sooner(task, tape, share):  # type: ignore[no-untyped-def]
    """Make the derivatives by a step's state those of the steps that follow the one before it, cut off."""
    put(tape.later, tape.sooner)
    cut_off(tape.later, np.float32(task.steepest) * share * task.inputs.tolerances.max(), tape.row[0])


@inner(fastmath=FASTMATH)
def cut_off(vectors, longest, square):  # type: ignore[no-untyped-def]
    """Shorten the ``vectors`` (size, n) that are longer than ``longest`` to that; ``square`` (n,) is workspace."""
    square[:] = _ZERO
    for i in range(vectors.shape[0]):
        for e in range(vectors.shape[1]):
            square[e] += vectors[i, e] * vectors[i, e]
    for e in range(square.shape[0]):
        square[e] = min(np.float32(1.0), longest / np.sqrt(max(square[e], longest * longest)))
    for i in range(vectors.shape[0]):
        for e in range(vectors.shape[1]):
            vectors[i, e] *= square[e]


def learn_once(task: ServoTask, net: Trainable, tape: Tape) -> float:
    """Move forward and back; return the mean cost of a step."""
    move_forward(task, net, tape)
    return float(move_back(task, net, tape))


def errors_of(task: ServoTask, tape: Tape) -> NDArray[np.float32]:
    """Return the errors (steps, joints, n) of the movements on ``tape`` [tolerances]."""
    angle = tape.x[1:, task.simulation.layout.angles]
    difference: NDArray[np.float32] = (angle - tape.reference[1:]) * task.inputs.tolerances[:, None]
    return difference


__all__ = [
    "ServoTask",
    "Tape",
    "Trainable",
    "errors_of",
    "go_sooner",
    "learn_once",
    "move_back",
    "move_forward",
    "note_free",
    "price_of_a_step",
    "prices_of_pressures",
    "tape",
]
