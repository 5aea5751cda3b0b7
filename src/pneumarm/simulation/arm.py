"""A fitted simulation behind the seam of an arm: whatever moves an arm can move it, and cannot tell."""

import json
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm, Reading, with_measured
from pneumarm.arm.valves import Command
from pneumarm.errors import UnusableInput
from pneumarm.random import random_state
from pneumarm.simulation.kernel import (
    begin,
    raw_observations,
    scaled_state,
    simulation_parameters,
    simulation_state,
    step,
)
from pneumarm.simulation.noise import NoiseSettings, noise_parameters
from pneumarm.simulation.simulation import Simulation

_SETTLE = 1.0  # s with closed valves, in which the begin state comes to rest
_EARLY = 1e-9  # s; sums of waits fall short of a period's end by rounding


class SimulationArm(Arm):
    """The arm that ``simulation`` was fitted to.

    The simulation knows the arm only at the ends of control periods. So the state advances when time crosses the
    end of a period, under the valves as they are set then: those that a control cycle sets after its latency hold
    for the whole period, as they did when the transitions were recorded. Between these moments readings stay as
    they are.

    It begins at rest in the middle of the range of goals; without pressure sensors it begins vented, as the guard
    presumes. A simulation is as good as its data: seconds of venting or resting with closed valves are outside of it,
    and so is what it then says. No heat, no creep, no supply that fluctuates.
    """

    def __init__(self, simulation: Simulation, *, seed: int = 0, noise: NoiseSettings | None = None) -> None:
        if not simulation.valves:
            raise UnusableInput("the simulation was fitted to continuous commands; this arm has on/off valves")
        # Of pulses it knows nothing unless it has seen some: then they are rounded to whole periods.
        pulses = simulation.spec.pulses and simulation.commands == "pulses"
        self.spec = replace(simulation.spec, pulses=pulses)
        self._simulation = simulation
        self._parameters = simulation_parameters(simulation)
        self._noise = noise_parameters(noise or NoiseSettings(), simulation)
        self._state = simulation_state(self._parameters, random_state(seed))
        self._commanded = np.zeros((self.spec.joints, 2))
        self._periods = 0
        self._since = 0.0
        self._settle()

    def _settle(self) -> None:
        simulation = self._simulation
        window = simulation.window
        observation = simulation.scaling.observation_offset.copy()
        observation[: window.joint_size : 4] = simulation.goal_range.mean(axis=1)
        observation[1 : window.joint_size : 4] = 0.0
        if not self.spec.pressure_sensors:
            window.of_joints(observation)[:, 2:] = 0.0
        others = np.zeros(window.state_size - window.history * window.observation_size)
        sigma = np.concatenate([np.tile(observation, window.history), others])
        begin(self._parameters, self._noise, self._state, scaled_state(sigma, window, simulation.scaling))
        quiet = noise_parameters(NoiseSettings(kind="none"), simulation)
        for _ in range(round(_SETTLE / self.spec.period)):
            step(self._parameters, quiet, self._state, self._command())

    def _command(self) -> NDArray[np.float32]:
        return (self._commanded.ravel() / self._simulation.scaling.command_scale).astype(np.float32)

    def read(self) -> Reading:
        """Return the newest simulated observation."""
        window = self._simulation.window
        newest = raw_observations(self._state.x[: window.state_size], self._simulation.scaling)
        observation, further = window.of_joints(newest), newest[window.joint_size :]
        time = self._periods * self.spec.period + self._since
        reading = Reading(time, observation[:, 0].copy())
        if self.spec.pressure_sensors:
            reading = replace(reading, pressure=observation[:, 2:].copy())
        velocity = observation[:, 1] if self.spec.velocity_sensor else ()
        return with_measured(reading, self.spec, [*velocity, *further])

    def set_valves(self, valves: Command) -> None:
        """Set the valves; they take effect at the end of the running period."""
        self._commanded = np.array(valves, np.float64).reshape(self.spec.joints, 2)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses; they take effect at the end of the running period, and are over then."""
        self._commanded = command.copy()
        return True

    def wait(self, seconds: float) -> None:
        """Let time pass, a step of the simulation at the end of every control period."""
        self._since += max(seconds, 0.0)
        while self._since >= self.spec.period - _EARLY:
            self._since = max(self._since - self.spec.period, 0.0)
            self._periods += 1
            step(self._parameters, self._noise, self._state, self._command())
            self._commanded = np.where(np.abs(self._commanded) < 1, 0.0, self._commanded)

    def close(self) -> None:
        """Close all valves."""
        self._commanded = np.zeros_like(self._commanded)

    def get_state(self) -> bytes:
        """Return the whole state, bit for bit."""
        state = {name: getattr(self._state, name).tolist() for name in ("x", "average", "random")}
        clock = {"commanded": self._commanded.tolist(), "periods": self._periods, "since": self._since}
        return json.dumps(state | clock).encode()

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`.

        Raises:
            UnusableInput: it is none, or one of another simulation's arm.

        """
        try:
            saved = json.loads(state)
            arrays = {
                name: np.array(saved[name], getattr(self._state, name).dtype).reshape(
                    getattr(self._state, name).shape
                )
                for name in ("x", "average", "random")
            }
            commanded = np.array(saved["commanded"], np.float64).reshape(self._commanded.shape)
            periods, since = int(saved["periods"]), float(saved["since"])
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            raise UnusableInput(
                f"{self.spec.name}: expected a state of this simulation's arm, got another ({error})"
            ) from error
        for name, array in arrays.items():
            getattr(self._state, name)[:] = array
        self._commanded, self._periods, self._since = commanded, periods, since
