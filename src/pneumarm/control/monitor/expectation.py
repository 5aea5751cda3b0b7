"""What the sensors should read next: by the simulation, or before there is one by a few rules of pneumatics.

Both say for every hypothesis which pressures are expected and how far off they usually are. The rules know only what
all arms of this kind have in common: how fast a muscle fills and empties, about, and that its pressure changes when
the joint moves. They are wrong by several counts where the simulation is wrong by one.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.control.monitor.hypotheses import carried_out
from pneumarm.kernels import part
from pneumarm.random import random_state
from pneumarm.settings import Settings, Valid
from pneumarm.simulation.kernel import (
    SimulationParameters,
    SimulationState,
    places,
    predict_change,
    simulation_parameters,
    simulation_state,
)
from pneumarm.simulation.simulation import Simulation

ATMOSPHERE = 1.013  # bar
_LEAST_STD = 0.5  # counts; below this the converter's rounding is all there is


@dataclass(frozen=True)
class RuleSettings(Settings):
    """What the rules take for granted of an arm, until a simulation knows better; presets of the thesis' arm."""

    filling: float = 1.5
    """Rise of the pressure in a muscle far below the supply's pressure with the inlet open [bar/s]."""
    supply: float = 1.02
    """Pressure of the supply [bar gauge]; filling slows down in proportion in the last half bar below."""
    emptying: float = 4.3
    """Fall of the pressure at 1 bar with the outlet open [bar/s]; in proportion to the root of the pressure."""
    delay: float = 0.019
    """Time from a reading until the air notices the valves that were chosen after it [s]."""
    compression: float = 0.0075
    """Part of its absolute pressure by which a closed muscle's changes when its joint turns by a degree."""
    noise: float = 2.5
    """Standard deviation of what the rules do not explain of an arm at rest [counts]."""
    unsure_moving: float = 0.7
    """... of a moving arm [counts per degree]."""

    def _valid(self) -> Valid:
        positive = {name: 0 < value < math.inf or "above 0" for name, value in vars(self).items()}
        return {**positive, "delay": 0 <= self.delay < math.inf or "0 or more"}


class RuleParameters(NamedTuple):
    """The rules in counts and control periods. Made by :func:`rule_parameters`."""

    filling: float
    supply: float
    near: float
    """Distance from the supply's pressure at which filling slows down [counts]."""
    emptying: float
    bar: float
    """Counts of a bar."""
    before: float
    """Share of a period in which the valves are those chosen the period before."""
    compression: float
    """By count of the angle."""
    atmosphere: float
    noise: float
    unsure_moving: float
    """By count of the angle."""


def rule_parameters(settings: RuleSettings, spec: ArmSpec) -> RuleParameters:
    """Return ``settings`` for an arm ``spec``."""
    per_period = spec.counts_per_bar * spec.period
    return RuleParameters(
        filling=settings.filling * per_period,
        supply=settings.supply * spec.counts_per_bar,
        near=0.5 * spec.counts_per_bar,
        emptying=settings.emptying * per_period,
        bar=spec.counts_per_bar,
        before=min(1.0, settings.delay / spec.period),
        compression=settings.compression / spec.counts_per_degree,
        atmosphere=ATMOSPHERE * spec.counts_per_bar,
        noise=settings.noise,
        unsure_moving=settings.unsure_moving / spec.counts_per_degree,
    )


@part
def flow_by_rules(rules, pressure, setting):  # type: ignore[no-untyped-def]
    """Return the change of ``pressure`` in a whole period at a valve ``setting`` from -1 to 1 [counts]."""
    if setting > 0.0:
        return setting * rules.filling * min(1.0, (rules.supply - pressure) / rules.near)
    return setting * rules.emptying * math.sqrt(max(0.0, pressure) / rules.bar)


@part
def end_of_pulse(command, before):  # type: ignore[no-untyped-def]
    """Return the last command in the share ``before`` of a period in which it still acts: the end of a long pulse."""
    share = max(0.0, before - (1.0 - abs(command))) / before if before > 0.0 else 0.0
    return share if command > 0.0 else -share


@part
def begin_of_pulse(command, before):  # type: ignore[no-untyped-def]
    """Return a command in the share of a period that is left after the share ``before`` of the last one."""
    share = min(1.0, abs(command) / (1.0 - before)) if before < 1.0 else 0.0
    return share if command > 0.0 else -share


@part
def expect_by_rules(rules, readings, memory, angle, expected, std):  # type: ignore[no-untyped-def]
    """Set ``expected`` (n, m) pressures and their ``std`` (m,) [counts]; ``angle`` (joints,) is what was read."""
    for m in range(std.shape[0]):
        j, side = m // 2, m % 2
        pressure = memory.observed[0, j, 2 + side]
        turned = angle[j] - memory.observed[0, j, 0]
        squeezed = (2.0 * side - 1.0) * rules.compression * turned * (pressure + rules.atmosphere)
        for h in range(expected.shape[0]):
            source = readings.source[h, m]
            ended = end_of_pulse(memory.command[1, source], rules.before)
            begun = begin_of_pulse(memory.command[0, source], rules.before)
            before = carried_out(readings, h, m, ended, pressure / rules.bar)
            now = carried_out(readings, h, m, begun, pressure / rules.bar)
            flow = rules.before * flow_by_rules(rules, pressure, before)
            flow += (1.0 - rules.before) * flow_by_rules(rules, pressure + flow, now)
            expected[h, m] = max(0.0, pressure * (1.0 - readings.leak[h, m]) + flow + squeezed)
        moving = rules.unsure_moving * turned
        std[m] = math.sqrt(rules.noise**2 + moving * moving)


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
    first_command: int
    """Place of the command among the inputs."""
    bar: float
    """Counts of a bar."""
    measured: NDArray[np.float64]
    """What the further sensors of its window said, newest first, as :attr:`~pneumarm.transitions.Window.needs` calls
    them, shape (history, needs) [sensor units]. The monitor writes it; the kernel reads it."""
    velocities: int
    """How many of these are velocities, which stand in place of the derived ones: joints or 0."""
    further_offset: NDArray[np.float64]
    """Of the others, shape (further,) [sensor units]."""
    further_scale: NDArray[np.float64]
    """Shape (further,) [sensor units]."""


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
        std=np.maximum(simulation.error_std, _LEAST_STD),
        first_command=places(simulation.window).command,
        bar=simulation.spec.counts_per_bar,
        measured=np.zeros((window.history, len(window.needs))),
        velocities=joints if window.velocity == "measured" else 0,
        further_offset=scaling.observation_offset[window.joint_size :].copy(),
        further_scale=scaling.observation_scale[window.joint_size :].copy(),
    )


@part
def expect_further(predictor, lag):  # type: ignore[no-untyped-def]
    """Put what further sensors said ``lag`` readings ago where the networks read it."""
    first, joints, velocities = predictor.simulation.observed * lag, predictor.simulation.joints, predictor.velocities
    for j in range(velocities):
        scaled = (predictor.measured[lag, j] - predictor.offset[j, 1]) / predictor.scale[j, 1]
        predictor.state.x[first + 4 * j + 1] = np.float32(scaled)
    for i in range(predictor.further_scale.shape[0]):
        scaled = (predictor.measured[lag, velocities + i] - predictor.further_offset[i]) / predictor.further_scale[i]
        predictor.state.x[first + 4 * joints + i] = np.float32(scaled)


@part
def expect_by_simulation(predictor, readings, memory, expected, angle):  # type: ignore[no-untyped-def]
    """Set ``expected`` (n, m) pressures, and the ``angle`` (joints,) expected of a healthy arm [counts]."""
    simulation, state = predictor.simulation, predictor.state
    x, joints, history = state.x, simulation.joints, simulation.history
    muscles = 2 * joints
    for lag in range(history):
        for j in range(joints):
            for q in range(4):
                scaled = (memory.observed[lag, j, q] - predictor.offset[j, q]) / predictor.scale[j, q]
                x[simulation.observed * lag + 4 * j + q] = np.float32(scaled)
        expect_further(predictor, lag)
    for h in range(expected.shape[0]):
        for m in range(muscles):
            bar = memory.observed[0, m // 2, 2 + m % 2] / predictor.bar
            source = readings.source[h, m]
            now = carried_out(readings, h, m, memory.command[0, source], bar) / predictor.command_scale[m]
            x[predictor.first_command + m] = np.float32(now)
            for lag in range(1, history):
                told = memory.command[lag, source]
                earlier = carried_out(readings, h, m, told, bar) / predictor.command_scale[m]
                x[simulation.observed * history + muscles * (lag - 1) + m] = np.float32(earlier)
        predict_change(simulation, state)
        for o in range(simulation.place.shape[0] - predictor.further_scale.shape[0]):
            j, q = simulation.place[o] // 4, simulation.place[o] % 4
            scaled = (memory.observed[0, j, q] - predictor.offset[j, q]) / predictor.scale[j, q] + state.change[o]
            scaled = min(max(scaled, simulation.lowest[o]), simulation.highest[o])
            following = predictor.offset[j, q] + predictor.scale[j, q] * scaled
            if q >= 2:
                m = 2 * j + q - 2
                expected[h, m] = following - readings.leak[h, m] * max(0.0, memory.observed[0, j, q])
            elif q == 0 and h == 0:
                angle[j] = following
