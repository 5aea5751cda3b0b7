"""The state window of a real arm, built from its readings one by one."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import Reading, measured
from pneumarm.arm.velocity import derived_velocity
from pneumarm.kernels import kernel
from pneumarm.simulation.kernel import remember, shift, stops_by_angle
from pneumarm.simulation.layout import angle_at, layout_of
from pneumarm.simulation.simulation import Scaling
from pneumarm.transitions.window import QUANTITIES, Window


@kernel
def write_observation(layout, scale, by_angle, observation, first, command, state):  # type: ignore[no-untyped-def]
    """Put the newest ``observation`` [counts] into the window at the begin of ``state``, the scaled ``command`` too.

    ``scale`` holds the offsets and scales of observations, ``by_angle`` (joints, remembered) the change of stop
    operators by that of their angle. The ``first`` observation of an episode fills the whole window.
    """
    if not first:
        for joint in range(layout.joints):
            angle = angle_at(layout, 0, joint)
            moved = np.float32((observation[angle] - scale[0, angle]) / scale[1, angle]) - state[angle]
            remember(layout, by_angle, state, joint, moved, np.float32(1.0))
        shift(layout, state, command)
    for i in range(layout.observed):
        newest = np.float32((observation[i] - scale[0, i]) / scale[1, i])
        state[i] = newest
        if first:
            for lag in range(1, layout.history):
                state[lag * layout.observed + i] = newest


class StateTracker:
    """Turns the readings of an episode, and the valves set after them, into scaled state windows (eq. 3.5).

    The first reading of an episode is taken at rest with closed valves: the window is filled with copies of it, and
    its velocity is 0. The velocity after that is derived from the time stamps (section 2.3.4), unless the window
    takes that of a sensor, which says what it is at any time.
    """

    def __init__(self, window: Window, scaling: Scaling) -> None:
        self.window = window
        self._scale = np.stack([scaling.observation_offset, scaling.observation_scale])
        self._layout = layout_of(window)
        self._measures = window.velocity == "measured"
        self._command_scale = scaling.command_scale
        self._by_angle = stops_by_angle(window, scaling)
        self.reset()

    def reset(self) -> None:
        """Begin an episode: the next reading is one at rest."""
        self.velocity: NDArray[np.float64] = np.zeros(self.window.joints)
        """Angular velocities at the newest reading, shape (joints,) [counts/ms]."""
        self._time = 0.0
        self._angle: NDArray[np.float64] | None = None
        self._state = np.zeros(self.window.state_size, np.float32)
        self._command = np.zeros(self.window.command_size)

    def push(
        self, time: float, angle: ArrayLike, pressure: ArrayLike, measured: Sequence[float] = ()
    ) -> NDArray[np.float32]:
        """Return the scaled state window after a reading.

        ``time`` [s], ``angle`` (joints,) [counts], ``pressure`` (joints, 2) [counts], and what the further sensors
        that the window needs have ``measured``, in the order of :attr:`~pneumarm.transitions.Window.needs`.
        """
        window, state = self.window, self._state
        angle = np.array(angle, np.float64).reshape(window.joints)
        observed = window.observation_size
        first = self._angle is None
        if self._measures:
            self.velocity = np.array(measured[: window.joints], np.float64)
        elif self._angle is not None and time > self._time:
            self.velocity = derived_velocity(angle, self._angle, time - self._time)
        self._time, self._angle = time, angle
        observation = np.empty(observed)
        joints = window.of_joints(observation)
        joints[:, 0], joints[:, 1] = angle, self.velocity
        joints[:, 2:] = np.asarray(pressure, np.float64).reshape(window.joints, 2)
        if window.further:
            observation[window.joint_size :] = measured[-len(window.further) :]
        write_observation(self._layout, self._scale, self._by_angle, observation, first, self._command, state)
        return state.copy()

    def reading(self, reading: Reading) -> NDArray[np.float32]:
        """Return the scaled state window after ``reading``."""
        further = measured(reading, self.window.needs) if self.window.needs else ()
        return self.push(reading.time, reading.angle, reading.pressure, further)

    def commanded(self, valves: ArrayLike) -> None:
        """Note the ``valves`` (joints, 2) as applied after the newest reading."""
        self._command = np.asarray(valves, np.float64).ravel() / self._command_scale


def scaled_goal(goal: NDArray[np.float64], scaling: Scaling) -> NDArray[np.float64]:
    """Return goals (..., joints) [counts] scaled as angles are."""
    angle = slice(0, goal.shape[-1] * len(QUANTITIES), len(QUANTITIES))
    scaled: NDArray[np.float64] = (goal - scaling.observation_offset[angle]) / scaling.observation_scale[angle]
    return scaled
