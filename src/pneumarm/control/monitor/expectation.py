"""What the sensors should read next by a simulation of the arm, under every hypothesis of what may be wrong."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.control.monitor.hypotheses import at_once, carried_out, leaked
from pneumarm.kernels import inner
from pneumarm.random import random_state
from pneumarm.simulation.kernel import (
    SimulationParameters,
    SimulationState,
    predict_change,
    remember,
    simulation_parameters,
    simulation_state,
)
from pneumarm.simulation.layout import command_at, further_at, reading_at, velocity_at
from pneumarm.simulation.simulation import Simulation

_LEAST_STD = 0.5  # counts; below this the converter's rounding is all there is
_LOW = 0.5  # of the highest pressure; an empty muscle has less
_LOST = 0.25  # of what comes in while both valves are open, standard deviation


class Predictor(NamedTuple):
    """A simulation that says what is expected. Made by :func:`predictor`."""

    simulation: SimulationParameters
    state: SimulationState
    offset: NDArray[np.float64]
    """Shape (joints, 4) [sensor units]."""
    scale: NDArray[np.float64]
    """Shape (joints, 4) [sensor units]."""
    command_scale: NDArray[np.float64]
    """Shape (2 joints,)."""
    std: NDArray[np.float64]
    """Standard deviation of the error on held-out sequences, shape (joints, 4) [sensor units]."""
    lowest: NDArray[np.float64]
    """Lowest pressures of the muscles, shape (2 joints,) [counts]."""
    highest: float
    """Highest pressure of a muscle [counts]."""
    period: float
    """Control period [s]."""
    measured: NDArray[np.float64]
    """What the further sensors of its window said, newest first, as :attr:`~pneumarm.transitions.Window.needs` calls
    them, shape (history, needs) [sensor units]. The monitor writes it; the kernel reads it."""
    velocities: int
    """How many of these are velocities, which stand in place of the derived ones: joints or 0."""
    further_offset: NDArray[np.float64]
    """Of the others, shape (further,) [sensor units]."""
    further_scale: NDArray[np.float64]
    """Shape (further,) [sensor units]."""
    following: NDArray[np.float64]
    """Workspace: pressures that follow, shape (2 joints,) [counts]."""


def predictor(simulation: Simulation) -> Predictor:
    """Return ``simulation`` for kernels."""
    packed, joints = simulation_parameters(simulation), simulation.window.joints
    scaling, window = simulation.scaling, simulation.window
    return Predictor(
        simulation=packed,
        state=simulation_state(packed, random_state(0)),
        offset=np.ascontiguousarray(window.of_joints(scaling.observation_offset)),
        scale=np.ascontiguousarray(window.of_joints(scaling.observation_scale)),
        command_scale=scaling.command_scale,
        std=_usual_errors(simulation),
        lowest=np.minimum(simulation.pressure_range[..., 0].ravel(), _LOW * simulation.spec.max_pressure_counts),
        highest=simulation.spec.max_pressure_counts,
        period=simulation.spec.period,
        measured=np.zeros((window.history, len(window.needs))),
        velocities=joints if window.velocity == "measured" else 0,
        further_offset=scaling.observation_offset[window.joint_size :].copy(),
        further_scale=scaling.observation_scale[window.joint_size :].copy(),
        following=np.zeros(2 * joints),
    )


def _usual_errors(simulation: Simulation) -> NDArray[np.float64]:
    """Return the standard deviations of errors (joints, 4) [sensor units]; boundless where nothing is measured."""
    std = np.maximum(simulation.error_std, _LEAST_STD)
    if not simulation.spec.pressure_sensors:
        std[:, 2:] = np.inf
    return std


@inner
def expect_further(predictor, lag):  # type: ignore[no-untyped-def]
    """Put what further sensors said ``lag`` readings ago where the networks read it."""
    layout, velocities = predictor.simulation.layout, predictor.velocities
    for j in range(velocities):
        scaled = (predictor.measured[lag, j] - predictor.offset[j, 1]) / predictor.scale[j, 1]
        predictor.state.x[velocity_at(layout, lag, j)] = np.float32(scaled)
    for i in range(predictor.further_scale.shape[0]):
        scaled = (predictor.measured[lag, velocities + i] - predictor.further_offset[i]) / predictor.further_scale[i]
        predictor.state.x[further_at(layout, lag, i)] = np.float32(scaled)


@inner
def expect_by_simulation(predictor, readings, memory):  # type: ignore[no-untyped-def]
    """Set in ``memory`` the pressures that are expected under every hypothesis, and the angles of a healthy arm.

    What comes in and what goes out while both valves of a muscle are open is added: no simulation has seen that, so
    a part of what comes in is doubt.
    """
    layout, x = predictor.simulation.layout, predictor.state.x
    for lag in range(layout.history):
        for j in range(layout.joints):
            for q in range(4):
                scaled = (memory.observed[lag, j, q] - predictor.offset[j, q]) / predictor.scale[j, q]
                x[reading_at(layout, lag, j, q)] = np.float32(scaled)
        expect_further(predictor, lag)
    for i in range(memory.stops.shape[0]):
        x[layout.memory + i] = memory.stops[i]
    for j in range(layout.joints):
        moved = np.float32((memory.observed[0, j, 0] - memory.observed[1, j, 0]) / predictor.scale[j, 0])
        remember(layout, predictor.simulation.stops, x, j, moved, np.float32(1.0))
    for i in range(memory.stops.shape[0]):
        memory.stops[i] = x[layout.memory + i]
    for h in range(memory.expected.shape[0]):
        expected, doubt = memory.expected[h], memory.doubt[h]
        if readings.leak[h].any():
            for m in range(expected.shape[0]):
                read, rate = memory.observed[0, m // 2, 2 + m % 2], readings.leak[h, m]
                healthy = memory.expected[0, m]
                expected[m] = leaked(rate, predictor.period, read, predictor.lowest[m], healthy)
                doubt[m] = 0.0
            continue
        both_open = expect_under(predictor, readings, memory, h, -1.0)
        for m in range(expected.shape[0]):
            expected[m], doubt[m] = predictor.following[m], 0.0
        if both_open:
            expect_under(predictor, readings, memory, h, 0.0)
            for m in range(expected.shape[0]):
                expected[m] -= predictor.following[m]
                doubt[m] = predictor.following[m]
            expect_under(predictor, readings, memory, h, 1.0)
            for m in range(expected.shape[0]):
                expected[m] = max(expected[m] + predictor.following[m], predictor.lowest[m])
                doubt[m] = _LOST * abs(predictor.following[m] - doubt[m])


@inner
def expect_under(predictor, readings, memory, h, both):  # type: ignore[no-untyped-def]
    """Set in ``predictor`` the pressures that follow under hypothesis ``h`` if two open valves do ``both``.

    Returned is whether both valves of a muscle were open at once.
    """
    simulation, state = predictor.simulation, predictor.state
    x, layout, both_open = state.x, simulation.layout, False
    for m in range(layout.commanded):
        lowest = predictor.lowest[m]
        level = (memory.observed[0, m // 2, 2 + m % 2] - lowest) / (predictor.highest - lowest)
        source = readings.source[h, m]
        for lag in range(layout.history):
            told = memory.command[lag, source]
            done = carried_out(readings, h, m, told, level, both)
            x[command_at(layout, lag) + m] = np.float32(done / predictor.command_scale[m])
            both_open = both_open or at_once(readings, h, m, told)
    predict_change(simulation, state)
    for o in range(simulation.place.shape[0] - predictor.further_scale.shape[0]):
        j, q = simulation.place[o] // 4, simulation.place[o] % 4
        scaled = (memory.observed[0, j, q] - predictor.offset[j, q]) / predictor.scale[j, q] + state.change[o]
        scaled = min(max(scaled, simulation.lowest[o]), simulation.highest[o])
        following = predictor.offset[j, q] + predictor.scale[j, q] * scaled
        if q >= 2:
            m = 2 * j + q - 2
            predictor.following[m] = following
        elif q == 0 and h == 0:
            memory.angle[j] = following
    return both_open
