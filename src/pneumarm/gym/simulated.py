"""A single movement in a simulation."""

from copy import deepcopy
from typing import Any, Self, cast

import gymnasium
import numpy as np
from gymnasium import Space
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from numba import types
from numba.experimental import structref
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.gym.batch import act, begin_movement, outcome, simulated_arms, write_observation
from pneumarm.gym.options import chosen_goal
from pneumarm.gym.spaces import action_space, numbered, observation_space, sensor_ranges
from pneumarm.kernels import kernel
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, environment
from pneumarm.task.settings import TaskSettings
from pneumarm.task.tracker import scaled_goal

Observation = NDArray[np.float32]


@structref.register
class _HandleType(types.StructRef):
    """Numba's type of a :class:`_Handle`."""


class _Handle(structref.StructRefProxy):
    """The dozens of arrays of a movement as one reference: handing them over singly takes longer than a step."""


structref.define_proxy(_Handle, _HandleType, ["environment", "many", "result"])


@kernel
def _handle(environment, many, result):  # type: ignore[no-untyped-def]
    return _Handle(environment, many, result)


@kernel
def _begin(handle):  # type: ignore[no-untyped-def]
    environment, many = handle.environment, handle.many
    begin_movement(environment, many, 0, 0)
    write_observation(environment, many, 0, handle.result.observation)


@kernel
def _step(handle, actions):  # type: ignore[no-untyped-def]
    """Take ``actions`` (1, joints); return the reward, whether the goal is reached, and whether it is cut off."""
    environment, many, result = handle.environment, handle.many, handle.result
    act(environment, many, 0, 0, actions, result)
    write_observation(environment, many, 0, result.observation)
    return result.reward[0], result.terminated[0], result.truncated[0]


class Copied:
    """Lets a simulated environment be copied and pickled amid its movements, which then go on independently."""

    simulation: Simulation
    _world: Environment
    _remade: str
    """Name of what every copy makes anew, by :meth:`_remake`."""

    def _remake(self) -> None:
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != self._remade}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._remake()

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        memo[id(self)] = twin = type(self).__new__(type(self))
        for shared in (self.simulation, self._world):  # megabytes that nobody writes to
            memo[id(shared)] = shared
        twin.__setstate__(deepcopy(self.__getstate__(), memo))
        return twin


class SimulatedPointToPoint(Copied, gymnasium.Env[Observation, Any]):
    """The task of :func:`pneumarm.gym.point_to_point` in a simulation."""

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium wants it
    _remade = "_handle"

    def __init__(self, simulation: Simulation, begin: BeginStates, settings: TaskSettings = TaskSettings()) -> None:
        """Move in ``simulation`` from ``begin`` states, as ``settings`` ask."""
        self.simulation = simulation
        self._world = environment(simulation, begin, settings)
        window = simulation.window
        self._many = simulated_arms(self._world, 1, 1)
        self._result = outcome(1, window.state_size + window.joints)
        self._remake()
        self._over = True
        self.action_space = action_space(simulation.spec)
        self._numbered = numbered(simulation.spec)
        self._count = len(self._numbered)
        self.observation_space = cast("Space[Observation]", simulated_space(simulation, begin))
        self._scalar, self._is_new = window.joints == 1, True
        self._actions = np.zeros((1, window.joints), np.int64)

    def _remake(self) -> None:
        self._handle = _handle(self._world, self._many, self._result)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a movement; ``options={"goal": [counts]}`` or ``{"goal_deg": [degrees]}`` chooses its goal."""
        goal = chosen_goal(options, self.simulation.spec, self._world.task.goal_range)
        super().reset(seed=seed)
        if seed is not None:
            self._many.random[0] = random_state(seed)
        elif self._is_new:
            self._many.random[0] = random_state(int(self.np_random.integers(2**63)))
        self._is_new = False
        _begin(self._handle)
        if goal is not None:
            self._set_goal(goal)
        self._over = False
        return self._result.observation[0].copy(), {"goal": self._many.goal[0].copy()}

    def _set_goal(self, goal: NDArray[np.float64]) -> None:
        scaled = scaled_goal(goal, self.simulation.scaling)
        place = self._world.task.layout.goal
        self._many.goal[0] = goal
        self._many.x[0, place : place + goal.size] = scaled
        self._result.observation[0, -goal.size :] = scaled

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Take ``action`` for a control period."""
        if self._over:
            raise ResetNeeded("the movement is over; call reset() to begin another")
        if self._scalar:
            # A plain number is checked in a tenth of the time that the space takes.
            number = int(action)
            if not 0 <= number < self._count or number != action:
                raise UnusableInput(f"an action must be one of 0 to {self._count - 1}, got {action!r}")
            self._actions[0, 0] = self._numbered[number]
        else:
            if not self.action_space.contains(np.asarray(action)):
                raise UnusableInput(f"actions must be in {self.action_space}, got {action!r}")
            self._actions[0] = self._numbered[np.asarray(action)]
        reward, terminated, truncated = _step(self._handle, self._actions)
        self._over = terminated or truncated
        return self._result.observation[0].copy(), reward, terminated, truncated, {"is_success": terminated}


def simulated_space(simulation: Simulation, begin: BeginStates) -> Box:
    """Return the space of what can be observed in ``simulation``."""
    window, scaling = simulation.window, simulation.scaling
    flat = sensor_ranges(simulation.spec, window)
    flat[: window.joint_size].reshape(window.joints, -1, 2)[:, 2:] = simulation.pressure_range
    flat[window.joint_size :] = simulation.further_range
    recorded = begin.states[:, : window.history * window.observation_size].reshape(-1, window.observation_size)
    raw = recorded * scaling.observation_scale + scaling.observation_offset
    flat[:, 0] = np.minimum(flat[:, 0], raw.min(axis=0))
    flat[:, 1] = np.maximum(flat[:, 1], raw.max(axis=0))
    return observation_space(window, scaling, flat, simulation.goal_range)
