"""The simulation's step over many states at once, without noise, and the derivatives by state and command.

A state is a column of ``x`` (size, n), laid out as :mod:`.layout` says. One step is

    h = tansig(W1^T x),  change = W2 h + D x + b2,  o' = clip(o + change),  sigma' = (o', o, ..., a, a_{k-1}, ...)

where h may go through a second hidden layer,

and its transpose carries the derivatives of a later cost by sigma' back to those by sigma and a.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner
from pneumarm.networks.layers import through_layer, weighted_sums
from pneumarm.networks.tansig import FASTMATH, tansig
from pneumarm.simulation.kernel import SimulationParameters
from pneumarm.simulation.layout import angle_at, velocity_at
from pneumarm.vectors import add_sums, put


class StepWorkspace(NamedTuple):
    """What one step of ``n`` states computes on its way. Made by :func:`step_workspace`."""

    hidden: NDArray[np.float32]
    """Hidden units, shape (units, n)."""
    second: NDArray[np.float32]
    """Those of the second layer, shape (second units, n)."""
    change: NDArray[np.float32]
    """Predicted changes, shape (outputs, n)."""
    free: NDArray[np.float32]
    """1 where a prediction was not cut off at the limits of its sensor, and a stop operator not at its end, else 0;
    shape (outputs + memory, n)."""
    slope: NDArray[np.float32]
    """Derivatives by what enters the hidden units, shape (units, n)."""
    second_slope: NDArray[np.float32]
    """Derivatives by what enters those of the second layer, shape (second units, n)."""


def step_workspace(simulation: SimulationParameters, n: int) -> StepWorkspace:
    """Return workspace for steps of ``n`` states."""
    units, second, outputs = simulation.hidden.shape[1], simulation.second_bias.size, simulation.output_bias.size
    sizes = units, second, outputs, outputs + simulation.stops.size, units, second
    return StepWorkspace(*(np.zeros((rows, n), np.float32) for rows in sizes))


@inner(fastmath=FASTMATH)
def last_units(simulation, work):  # type: ignore[no-untyped-def]
    """Return the units of the last hidden layer (units, n), those of the first being ``work.hidden``."""
    if simulation.second.shape[0] == 0:
        return work.hidden
    weighted_sums(simulation.second, work.hidden, work.second)
    for u in range(work.second.shape[0]):
        row = work.second[u]
        for e in range(row.shape[0]):
            row[e] += simulation.second_bias[u]
        tansig(row)
    return work.second


@inner(fastmath=FASTMATH)
def predict_all(simulation, x, work):  # type: ignore[no-untyped-def]
    """Set the hidden units and ``work.change`` to what the networks make of ``x`` (size, n), commands in place."""
    change = work.change
    work.hidden[:] = np.float32(0.0)
    for begin, end in simulation.read:
        add_sums(simulation.hidden[begin:end], x[begin:end], work.hidden)
    for u in range(work.hidden.shape[0]):
        tansig(work.hidden[u])
    hidden = last_units(simulation, work)
    weighted_sums(simulation.output.T, hidden, change)
    for o in range(change.shape[0]):
        for e in range(change.shape[1]):
            change[o, e] += simulation.output_bias[o]
    if simulation.direct.shape[0] > 0:
        for begin, end in simulation.read:
            add_sums(simulation.direct[:, begin:end].T, x[begin:end], change)


@inner(fastmath=FASTMATH)
def step_all(simulation, x, following, work):  # type: ignore[no-untyped-def]
    """Set ``following`` (size, n) to the states one period after ``x`` (size, n), whose commands are in place."""
    predict_all(simulation, x, work)
    layout, n = simulation.layout, x.shape[1]
    observed, commanded, command = layout.observed, layout.commanded, layout.command
    newest = layout.history * observed
    put(following[observed:newest], x[: newest - observed])
    put(following[newest + commanded : layout.memory], x[newest : layout.memory - commanded])
    if layout.history > 1:
        put(following[newest : newest + commanded], x[command : command + commanded])
    put(following[command:], x[command:])
    put(following[:observed], x[:observed])
    for o in range(work.change.shape[0]):
        place, lowest, highest = simulation.place[o], simulation.lowest[o], simulation.highest[o]
        for e in range(n):
            value = x[place, e] + work.change[o, e]
            work.free[o, e] = np.float32(1.0) if lowest < value < highest else np.float32(0.0)
            following[place, e] = min(max(value, lowest), highest)
    for joint in range(simulation.velocity.shape[0]):
        angle, velocity = angle_at(layout, 0, joint), velocity_at(layout, 0, joint)
        rate, rest = simulation.velocity[joint, 0], simulation.velocity[joint, 1]
        for e in range(n):
            following[velocity, e] = (following[angle, e] - x[angle, e]) * rate + rest
    one, zero = np.float32(1.0), np.float32(0.0)
    for i in range(simulation.stops.size):
        joint, place, o = i // layout.remembered, layout.memory + i, work.change.shape[0] + i
        angle, by_angle = angle_at(layout, 0, joint), simulation.stops[joint, i % layout.remembered]
        for e in range(n):
            followed = x[place, e] + by_angle * (following[angle, e] - x[angle, e])
            work.free[o, e] = one if abs(followed) < one else zero
            following[place, e] = min(max(followed, -one), one)


@inner(fastmath=FASTMATH)
def step_back(simulation, later, sooner, work):  # type: ignore[no-untyped-def]
    """Set ``sooner`` (size, n) to the derivatives by ``x``, those by ``following`` being ``later`` (size, n).

    ``work`` must be that of :func:`step_all` for this step; ``later`` is used up. In the places of the command are
    then the derivatives by the command.
    """
    layout, n = simulation.layout, later.shape[1]
    observed, commanded, command = layout.observed, layout.commanded, layout.command
    newest = layout.history * observed
    sooner[:] = np.float32(0.0)
    put(sooner[: newest - observed], later[observed:newest])
    put(sooner[newest : layout.memory - commanded], later[newest + commanded : layout.memory])
    if layout.history > 1:
        put(sooner[command : command + commanded], later[newest : newest + commanded])
    for i in range(simulation.stops.size):
        joint, place, o = i // layout.remembered, layout.memory + i, work.change.shape[0] + i
        angle, by_angle = angle_at(layout, 0, joint), simulation.stops[joint, i % layout.remembered]
        for e in range(n):
            by_stop = work.free[o, e] * later[place, e]
            sooner[place, e] += by_stop
            later[angle, e] += by_angle * by_stop
            sooner[angle, e] -= by_angle * by_stop
    for joint in range(simulation.velocity.shape[0]):
        angle, velocity = angle_at(layout, 0, joint), velocity_at(layout, 0, joint)
        rate = simulation.velocity[joint, 0]
        for e in range(n):
            later[angle, e] += rate * later[velocity, e]
            sooner[angle, e] -= rate * later[velocity, e]
    for o in range(work.change.shape[0]):
        place = simulation.place[o]
        for e in range(n):
            work.change[o, e] = work.free[o, e] * later[place, e]
            sooner[place, e] += work.change[o, e]
    hidden = last_units(simulation, work)
    slope = work.slope if simulation.second.shape[0] == 0 else work.second_slope
    weighted_sums(simulation.output, work.change, slope)
    for u in range(slope.shape[0]):
        for e in range(n):
            slope[u, e] *= np.float32(1.0) - hidden[u, e] * hidden[u, e]
    if simulation.second.shape[0] > 0:
        through_layer(simulation.second, slope, work.hidden, work.slope)
        slope = work.slope
    last = command + commanded  # beyond are the goal, the 1 and nothing, which no command changes
    for begin, beyond in simulation.read:
        end = min(beyond, last)
        if begin < end:
            add_sums(simulation.hidden[begin:end].T, slope, sooner[begin:end])
            if simulation.direct.shape[0] > 0:
                add_sums(simulation.direct[:, begin:end], work.change, sooner[begin:end])
