"""A servo as a controller of an arm: it settles at goals, holds them and follows references."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.reference import Reference, constant
from pneumarm.arm.seam import Reading, checked
from pneumarm.errors import UnusableInput
from pneumarm.learning.servo.commands import write_commands
from pneumarm.learning.servo.inputs import input_size, write_inputs
from pneumarm.networks.layers import forward, split
from pneumarm.networks.layers import workspace as layers_workspace
from pneumarm.task.forecast import Forecast
from pneumarm.task.tracker import StateTracker

if TYPE_CHECKING:
    from pneumarm.learning.servo.agent import ServoAgent

_LOOK = 0.2  # s over which readings are averaged where the arm is nearly at rest
_STILL = 0.3  # tolerances that the average of half of them may differ from that of the other half
_LEAVING = 2.5  # as many times the error and drift of coming to rest end it
_NEAR = 1.0  # tolerances within which an arm can be nearly at rest
_INTEGRAL = 0.5  # share of the mean error that is added to what is asked for, after every look


class ServoController:
    """Maps readings to pulses with a :class:`~.agent.ServoAgent`.

    Where the goal stays the same and a joint is nearly at rest near to it, it moves by single pulses, and looks at
    what each did before the next; what is left of the error is added to what is asked for (integral action), so that
    no bias of the simulation remains. Where the mean of the readings is off by less than ``quiet`` tolerances its
    valves stay closed, until it is off by more than ``alert``: closed muscles are springs of air that hold the joint,
    nothing wears, and no noise of the sensors is answered.
    """

    def __init__(self, agent: ServoAgent) -> None:
        from pneumarm.learning.servo.agent import servo_sizes, servo_task  # which imports this module

        spec, window, wanted = agent.spec, agent.window, agent.settings
        self.spec, self.goal_range = spec, agent.goal_range
        self._task = servo_task(agent.simulation, wanted)
        sizes = servo_sizes(agent.simulation, wanted)
        self._layers = split(agent.policy, sizes)
        self._units = layers_workspace(sizes, 1)
        self._tracker = StateTracker(window, agent.scaling)
        self._x = np.zeros((self._task.simulation.hidden.shape[0], 1), np.float32)
        self._inputs = np.zeros((input_size(self._task.inputs), 1), np.float32)
        commands = (2 * window.joints, 1)
        self._command, self._slope = np.zeros(commands, np.float32), np.zeros(commands, np.float32)
        self._no_noise = np.zeros((window.history, 3 * window.joints, 1), np.float32)
        self._offset = window.of_joints(agent.scaling.observation_offset)[:, 0]
        self._scale = window.of_joints(agent.scaling.observation_scale)[:, 0]
        tolerance = wanted.tolerance * spec.counts_per_degree
        self._quiet_below, self._alert_above = wanted.quiet * tolerance, wanted.alert * tolerance
        self._still = _STILL * tolerance
        self._angles: deque[NDArray[np.float64]] = deque(maxlen=max(4, round(_LOOK / spec.period)))
        self._reference: Reference | None = None
        self._begin: float | None = None
        self._fresh = True
        self._near = _NEAR * tolerance
        self._rest = [_Rest() for _ in range(window.joints)]

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts], to be held; the arm is at rest with its valves closed."""
        goal = np.asarray(goal, np.float64).reshape(-1)
        if goal.shape != (self.spec.joints,) or not np.isfinite(goal).all():
            raise UnusableInput(f"a goal needs {self.spec.joints} finite angle(s) in counts, got {goal}")
        self._fresh = True
        self.track(constant(goal))

    def track(self, reference: Reference) -> None:
        """Follow ``reference``, which begins at the time of the next reading, from whatever the arm is doing."""
        self._reference, self._begin = reference, None
        self._forecast = Forecast()
        for rest in self._rest:
            rest.leave()

    def act(self, reading: Reading) -> NDArray[np.float64]:
        """Return the commands (joints, 2) after ``reading``, shares of the period for which a valve is open."""
        if self._reference is None:
            raise UnusableInput("call reset(goal) or track(reference) before act(reading)")
        reading = checked(reading, self.spec)
        if self._fresh:
            self._tracker.reset()
            self._angles.clear()
            self._fresh = False
        if self._begin is None:
            self._begin = reading.time
        state = self._tracker.reading(reading)
        self._angles.append(np.asarray(reading.angle, np.float64))
        now, preview = self._preview(reading.time - self._begin)
        acts = self._which_act(now, preview)
        bias = np.array([rest.bias for rest in self._rest])
        self._x[: state.size, 0] = state
        scaled = ((preview + bias - self._offset) / self._scale).astype(np.float32)[:, :, None]
        write_inputs(self._task.inputs, self._x, self._no_noise, len(self._no_noise) - 1, scaled, self._inputs)
        forward(self._layers, self._inputs, self._units)
        write_commands(self._task.commands, self._x, self._units[-1], self._slope, self._command)
        command = self._command.astype(np.float64).reshape(-1, 2)
        command[~acts] = 0.0
        self._tracker.commanded(command)
        return command

    def _preview(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what is asked for now (joints,) and ahead (previews, joints) [counts]."""
        assert self._reference is not None
        now, steps = self._reference.at(time), self._task.inputs.steps
        if self._reference.known_ahead:
            return now, np.array([self._reference.at(time + k * self.spec.period) for k in steps])
        self._forecast.see(now)
        return now, self._forecast.ahead(steps)

    def _which_act(self, now: NDArray[np.float64], preview: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which joints (joints,) may open valves now, and note which are nearly at rest."""
        read = np.array(self._angles)
        error, half = now - read.mean(axis=0), len(read) // 2
        drift = np.abs(read[:half].mean(axis=0) - read[half:].mean(axis=0)) if half else np.full(now.size, np.inf)
        known = (len(read) == self._angles.maxlen) & (np.ptp(preview, axis=0) == 0) & (preview[0] == now)
        acts = np.ones(now.size, bool)
        for j, rest in enumerate(self._rest):
            wide = _LEAVING if rest.calm else 1.0
            if not known[j] or abs(error[j]) > wide * self._near or drift[j] > wide * self._still:
                rest.leave()
                continue
            rest.calm = True
            rest.quiet = abs(error[j]) < (self._alert_above if rest.quiet else self._quiet_below)
            rest.look = max(rest.look - 1, 0)
            acts[j] = not rest.quiet and rest.look == 0
            if acts[j]:
                rest.look = len(read)
                rest.bias = float(np.clip(rest.bias + _INTEGRAL * error[j], -self._near, self._near))
        return acts


class _Rest:
    """How one joint is nearly at rest."""

    def __init__(self) -> None:
        self.leave()

    def leave(self) -> None:
        """Note that it is not."""
        self.calm, self.quiet, self.look, self.bias = False, False, 0, 0.0
