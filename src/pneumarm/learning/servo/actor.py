"""A servo that acts state by state: the policy's network, once, on one arm."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.servo.commands import write_commands
from pneumarm.learning.servo.inputs import input_size, write_inputs
from pneumarm.learning.servo.task import servo_task
from pneumarm.networks.layers import forward, split
from pneumarm.networks.layers import workspace as layers_workspace


class ServoNetwork:
    """The policy's network and its workspace, for the commands of ``n`` arms at once."""

    def __init__(self, agent: NetworkAgent, n: int) -> None:
        window, self.task = agent.window, servo_task(agent.simulation, agent.settings)
        self._layers, self._units = split(agent.policy, agent.sizes), layers_workspace(agent.sizes, n)
        self._inputs = np.zeros((input_size(self.task.inputs), n), np.float32)
        self._command, self._slope = (np.zeros((2 * window.joints, n), np.float32) for _ in range(2))
        self._no_noise = np.zeros((window.history, 3 * window.joints, n), np.float32)

    def command(
        self, x: NDArray[np.float32], previews: NDArray[np.float32], underway: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """Return the commands (2 joints, n) in the states ``x`` (size, n); they are overwritten next time.

        The reference will be at ``previews`` (previews, joints, n) [scaled], and ``underway`` (joints, n) tells which
        joints are on their way to a goal that stays.
        """
        write_inputs(self.task.inputs, x, self._no_noise, len(self._no_noise) - 1, previews, self._inputs)
        forward(self._layers, self._inputs, self._units)
        write_commands(self.task.commands, x, underway, self._units[-1], self._slope, self._command)
        return self._command


class ServoActor:
    """Gives commands for scaled states (state_size,), with a goal that stays or with previews of a reference."""

    def __init__(self, agent: NetworkAgent) -> None:
        window = agent.window
        self._network = ServoNetwork(agent, 1)
        self.task = self._network.task
        self._x = np.zeros((self.task.simulation.hidden.shape[0], 1), np.float32)
        self._underway = np.zeros((window.joints, 1), bool)
        self._offset = window.of_joints(agent.scaling.observation_offset)[:, 0]
        self._scale = window.of_joints(agent.scaling.observation_scale)[:, 0]
        self._state = np.zeros(window.state_size, np.float32)
        self._previews = np.zeros((self.task.inputs.steps.size, window.joints))

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        self._previews[:] = np.asarray(goal, np.float64)
        self.follow(state)

    def act(self) -> NDArray[np.float64]:
        """Return the pulses (joints, 2) of the current state."""
        return self.pulses(self._state, self._previews)

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state``."""
        self._state = np.asarray(next_state, np.float32).copy()

    def pulses(
        self, state: NDArray[np.float32], previews: NDArray[np.float64], underway: ArrayLike = False
    ) -> NDArray[np.float64]:
        """Return the pulses (joints, 2) in ``state``; the reference will be at ``previews`` (previews, joints).

        ``underway`` (joints,) tells which joints are on their way to a goal that stays.
        """
        self._underway[:, 0] = underway
        self._x[: state.size, 0] = state
        scaled = ((previews - self._offset) / self._scale).astype(np.float32)[:, :, None]
        return self._network.command(self._x, scaled, self._underway).astype(np.float64).reshape(-1, 2)
