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

_LOOK = 0.134  # s over which readings are averaged before an arm is left alone, or no longer
_STILL = 0.1  # tolerances that the average of half of them may differ from that of the other half


class ServoController:
    """Maps readings to pulses with a :class:`~.agent.ServoAgent`.

    Where the goal stays the same and the arm stands still near to it, all valves stay closed: closed muscles are
    springs of air that hold the joint, nothing wears, and no noise of the sensors is answered. That ends as soon as
    the mean of the last readings is off by more than ``alert`` tolerances.
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
        self._quiet = np.zeros(window.joints, bool)

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
        self._quiet[:] = False

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
        self._x[: state.size, 0] = state
        scaled = ((preview - self._offset) / self._scale).astype(np.float32)[:, :, None]
        write_inputs(self._task.inputs, self._x, self._no_noise, len(self._no_noise) - 1, scaled, self._inputs)
        forward(self._layers, self._inputs, self._units)
        write_commands(self._task.commands, self._x, self._units[-1], self._slope, self._command)
        command = self._command.astype(np.float64).reshape(-1, 2)
        command[self._is_quiet(now, preview)] = 0.0
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

    def _is_quiet(self, now: NDArray[np.float64], preview: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which joints (joints,) are left alone."""
        read = np.array(self._angles)
        error = np.abs(read.mean(axis=0) - now)
        half = len(read) // 2
        is_still = np.abs(read[:half].mean(axis=0) - read[half:].mean(axis=0)) < self._still if half else False
        settles = (error < self._quiet_below) & is_still & (len(read) == self._angles.maxlen)
        stays = self._quiet & (error < self._alert_above)
        self._quiet = (settles | stays) & (np.ptp(preview, axis=0) == 0) & (preview[0] == now)
        return self._quiet
