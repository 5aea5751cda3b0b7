"""What the joints will do once a pulse has been given and all valves stay closed, as the simulation has it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.kernels import kernel
from pneumarm.random import random_states
from pneumarm.simulation.kernel import predict_change, push, put_command, simulation_parameters, simulation_state
from pneumarm.simulation.layout import angle_at
from pneumarm.simulation.simulation import Simulation


class Foresight:
    """Rolls a simulation on; what it needs is compiled when it is made."""

    def __init__(self, simulation: Simulation) -> None:
        window, scaling = simulation.window, simulation.scaling
        self._parameters = simulation_parameters(simulation)
        self._state = simulation_state(self._parameters, random_states(0, 1)[0])
        self._scale = window.of_joints(scaling.observation_scale)[:, 0]
        self._offset = window.of_joints(scaling.observation_offset)[:, 0]
        self.angles(np.zeros(window.state_size, np.float32), np.zeros((1, window.command_size)), 1)

    def angles(self, state: NDArray[np.float32], commands: ArrayLike, steps: int) -> NDArray[np.float64]:
        """Return the angles (n, steps, joints) [counts] in the periods after the scaled ``state`` (state_size,).

        In the first of them each of the ``commands`` (n, 2 joints) is given, and none in the others.
        """
        commands = np.asarray(commands, np.float32)
        angle = np.zeros((len(commands), steps, len(self._scale)), np.float32)
        _roll(self._parameters, self._state, np.asarray(state, np.float32), commands, angle)
        return angle * self._scale + self._offset


@kernel
def _roll(simulation, state, begin, commands, angle):  # type: ignore[no-untyped-def]
    closed = np.zeros(commands.shape[1], np.float32)
    for c in range(commands.shape[0]):
        for i in range(begin.shape[0]):
            state.x[i] = begin[i]
        for step in range(angle.shape[1]):
            command = commands[c] if step == 0 else closed
            put_command(simulation, state.x, command)
            predict_change(simulation, state)
            push(simulation, state.x, state.change, command)
            for joint in range(angle.shape[2]):
                angle[c, step, joint] = state.x[angle_at(simulation.layout, 0, joint)]
