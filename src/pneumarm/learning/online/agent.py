"""A trained agent and its file, and the agent acting and learning step by step: on a real arm, or anywhere else.

The file holds all that is needed to use it: neither simulation nor store. Step by step the agent runs the same
kernels as training does, so it learns the same.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import VALVES
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.kernels import part
from pneumarm.learning.agents import ReachesGoals
from pneumarm.learning.online.loop import learn, look_ahead, loop_workspace, remember, spread
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.settings import Exploration, TrainSettings
from pneumarm.learning.online.testing import run_test
from pneumarm.learning.online.values import (
    Networks,
    action_values,
    forget_traces,
    learner,
    network_shapes,
    pack,
    unpack,
)
from pneumarm.random import random_state
from pneumarm.simulation.layout import layout_of
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.movements import Movements
from pneumarm.task.reward import has_reached
from pneumarm.task.tracker import scaled_goal
from pneumarm.transitions.window import Window

KIND = "pneumarm agent"
_MOST_JOINTS, _MOST_HISTORY = 16, 64  # beyond these a file is damaged, not ambitious
_SAVED = ("weights", "traces", "traced", "random", "x", "chosen", "next_chosen", "next_actions", "next_values", "cut")


class AgentHeader(msgspec.Struct, forbid_unknown_fields=True):
    """What the file of an agent says besides its arrays."""

    spec: ArmSpec
    window: Window
    settings: TrainSettings


@dataclass(frozen=True)
class Agent(ReachesGoals):
    """Action values by state, goal and action, and how they were learned."""

    spec: ArmSpec
    window: Window
    scaling: Scaling
    goal_range: NDArray[np.float64]
    """Goals that it has learned to reach, shape (joints, 2) [counts]."""
    networks: Networks
    settings: TrainSettings
    """How it was trained; ``settings.exploration`` holds the end-of-shaping values to go on learning with."""

    def weights(self) -> NDArray[np.float32]:
        """Return a fresh copy of the networks as a kernel uses them, see :class:`~.values.ActionValues`."""
        return pack(self.networks, self.window)

    def with_weights(self, weights: NDArray[np.float32]) -> Self:
        """Return the agent with other ``weights``, as of :meth:`weights`."""
        return replace(self, networks=unpack(weights, self.window, self.settings.hidden, self.settings.team))

    def actor(self) -> "OnlineLearner":
        """Return the agent acting step by step, greedily."""
        return OnlineLearner(self)

    def learner(self, learning_rate: float, seed: int = 0) -> "OnlineLearner":
        """Return the agent acting and learning step by step, exploring as at the end of its training."""
        return OnlineLearner(self, learning_rate, self.settings.exploration, seed)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let the agent move greedily in ``simulation``."""
        env = environment(simulation, begin, self.settings)
        return run_test(env, self.weights(), self.settings, episodes, seed)

    def save(self, path: Path) -> None:
        """Write the agent to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        settings = msgspec.to_builtins(AgentHeader(self.spec, self.window, self.settings))
        scaling = {name: getattr(self.scaling, name) for name in _SCALING}
        write_arrays(path, KIND, settings, self.networks._asdict() | scaling | {"goal_range": self.goal_range})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent in ``path``.

        Raises:
            UnusableInput: ``path`` is no agent, is damaged, or does not fit together.

        """
        read, arrays = read_arrays(path, KIND)
        try:
            known = msgspec.convert(read, AgentHeader)
        except (msgspec.ValidationError, UnusableInput) as error:
            raise UnusableInput(f"{path}: expected the settings of an agent; {error}") from error
        window = known.window
        sizes_fit = 1 <= window.joints <= _MOST_JOINTS and 1 <= window.history <= _MOST_HISTORY
        if not sizes_fit or window.joints != known.spec.joints:
            raise UnusableInput(f"{path}: {window} and an arm of {known.spec.joints} joint(s) are no agent's")
        expected = _expected(window, known.settings)
        if arrays.keys() != expected.keys():
            raise UnusableInput(f"{path}: expected the arrays {sorted(expected)}, got {sorted(arrays)}")
        for name, like in expected.items():
            if arrays[name].shape != like.shape or arrays[name].dtype != like.dtype:
                raise UnusableInput(
                    f"{path}: expected {name} of shape {like.shape} and type {like.dtype}, "
                    f"got {arrays[name].shape} of {arrays[name].dtype}"
                )
        if not ((arrays["observation_scale"] > 0).all() and (arrays["command_scale"] > 0).all()):
            raise UnusableInput(f"{path}: scales must be positive")
        if not (arrays["goal_range"][:, 0] <= arrays["goal_range"][:, 1]).all():
            raise UnusableInput(f"{path}: goal_range must hold lower and upper ends in this order")
        return cls(
            spec=known.spec,
            window=window,
            scaling=Scaling(*(arrays[name] for name in _SCALING)),
            goal_range=arrays["goal_range"],
            networks=Networks(*(arrays[name] for name in Networks._fields)),
            settings=known.settings,
        )


_SCALING = ("observation_offset", "observation_scale", "command_scale")


def _expected(window: Window, settings: TrainSettings) -> dict[str, NDArray[Any]]:
    observed, commanded = np.zeros(window.observation_size), np.zeros(window.command_size)
    scaling = dict(zip(_SCALING, (observed, observed, commanded), strict=True))
    return (
        network_shapes(window, settings.hidden, settings.team)._asdict()
        | scaling
        | {"goal_range": np.zeros((window.joints, 2))}
    )


class OnlineLearner:
    """``agent`` acting step by step, and learning if ``learning_rate`` is not 0.

    ::

        learner.begin(state, goal)
        while True:
            actions = learner.act()
            ...  # set the valves, let the period pass, read
            learner.observe(reward, next_state, terminal)

    States are scaled windows as of :class:`~pneumarm.task.tracker.StateTracker`. Without ``exploration`` it is
    greedy; with a learning rate of 0 as well it is a controller and nothing else. An episode that is cut off just
    begins the next one.
    """

    def __init__(
        self, agent: Agent, learning_rate: float = 0.0, exploration: Exploration | None = None, seed: int = 0
    ) -> None:
        if not 0 <= learning_rate < np.inf:
            raise UnusableInput(f"the learning rate must be 0 or more, got {learning_rate!r}")
        self._agent = agent
        self.learning_rate = learning_rate
        chosen = exploration or Exploration(0.0, 1.0)
        self.schedule = Schedule(np.inf, float(chosen.epsilon), float(chosen.temperature), 0.0)
        """How it explores from now on."""
        self._random = random_state(seed)
        self._layout = layout_of(agent.window)
        self._x = np.zeros(self._layout.size, np.float32)
        self._x[self._layout.one] = 1
        self._learner, self._workspace = self._made()

    def _made(self) -> tuple[Any, Any]:
        """Return what kernels learn by and what they remember; with the next two, all that depends on the kernels."""
        made = learner(self._agent.weights(), self._agent.settings, self.learning_rate)
        return made, loop_workspace(made, self._agent.window.joints)

    def _begin_acting(self) -> None:
        begin_acting(self._learner, self.schedule, self._x, self._workspace, self._random)

    def _learn_and_act(self, seen: tuple[Any, ...], is_over: bool) -> None:
        learn_and_act(self._learner, self.schedule, self._x, self._workspace, self._random, seen, is_over)

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        window, scaling = self._agent.window, self._agent.scaling
        goal = np.asarray(goal, np.float64).reshape(window.joints)
        self._x[self._layout.goal : self._layout.one] = scaled_goal(goal, scaling)
        self._x[: self._layout.command] = self._checked(state)
        self._begin_acting()

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until :meth:`observe`."""
        if self._workspace.next_actions[0] < 0:
            raise PneumarmError("begin an episode before acting")
        return self._workspace.next_actions.copy()

    def greedy(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of highest value in the current state; changes nothing."""
        best = np.zeros_like(self._workspace.next_actions)
        spread.py_func(self.values().argmax(axis=1), best)
        return best

    def valves(self) -> NDArray[np.int8]:
        """Return the valves (joints, 2) of :meth:`act`."""
        valves: NDArray[np.int8] = VALVES[self.act()]
        return valves

    def values(self) -> NDArray[np.float32]:
        """Return the action values in the current state, shape (agents, choices), in units of reward.

        That is (joints, 9), unless one agent acts for all joints.
        """
        values = np.zeros(self._learner.traced.shape, np.float32)
        for agent in range(len(values)):
            action_values(self._learner, agent, self._x, values[agent])
        return values

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state`` without learning, as if an episode began there."""
        self._x[: self._layout.command] = self._checked(next_state)
        self._begin_acting()

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the weights as they are now."""
        return self._learner.weights.copy()

    def observe(self, reward: ArrayLike, next_state: ArrayLike, terminal: bool) -> None:
        """Learn from what the actions of :meth:`act` led to.

        ``reward`` is a number or one a joint (joints,), ``next_state`` (state_size,) scaled, and ``terminal`` says
        whether the goals are reached: the value of a terminal state is 0, a cut-off is not terminal. Agents with
        goals of their own see in ``next_state`` who is there.
        """
        self.act()
        paid = np.broadcast_to(np.asarray(reward, np.float64), self._workspace.paid.shape).copy()
        next_state = self._checked(next_state)
        seen = paid, self._there(next_state), next_state
        self._learn_and_act(seen, bool(terminal))

    def _there(self, state: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which joints are at their goals in the scaled ``state``, shape (joints,)."""
        window, scaling = self._agent.window, self._agent.scaling
        offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
        seen = window.of_joints(state[: window.observation_size]) * scale + offset
        goal = self._x[self._layout.goal : self._layout.one] * scale[:, 0] + offset[:, 0]
        reward = self._agent.settings.reward.on(self._agent.spec)
        there: NDArray[np.bool_] = has_reached.py_func(reward, seen[:, 0], seen[:, 1], goal)
        return there

    @property
    def agent(self) -> Agent:
        """The agent with the weights as they are now."""
        return self._agent.with_weights(self.weights())

    def get_state(self) -> bytes:
        """Return everything that the future depends on, besides what the learner was made with."""
        return json.dumps({name: array.tolist() for name, array in self._arrays().items()}).encode()

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit.

        Raises:
            UnusableInput: it is none, or one of a learner of another kind.

        """
        try:
            saved = json.loads(state)
            like = self._arrays()
            arrays = {name: np.array(saved[name], array.dtype).reshape(array.shape) for name, array in like.items()}
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            raise UnusableInput(f"expected the state of a learner like this one, got another ({error})") from error
        for name, array in like.items():
            array[...] = arrays[name]

    def _arrays(self) -> dict[str, NDArray[np.generic]]:
        holders = (self._learner, self._workspace)
        found = {name: getattr(holder, name) for holder in holders for name in _SAVED if hasattr(holder, name)}
        return found | {"random": self._random, "x": self._x}

    def _checked(self, state: ArrayLike) -> NDArray[np.float32]:
        checked = np.asarray(state, np.float32)
        if checked.shape != (self._layout.command,):
            raise PneumarmError(f"a state must have the shape ({self._layout.command},), got {checked.shape}")
        return checked


@part(entry=True)
def begin_acting(learner, schedule, x, workspace, random):  # type: ignore[no-untyped-def]
    """Begin an episode in the state and goal ``x``: choose its first actions."""
    for agent in range(workspace.chosen.shape[0]):
        forget_traces(learner, agent)
    look_ahead(learner, schedule, x, workspace, random)


@part(entry=True)
def learn_and_act(learner, schedule, x, workspace, random, seen, terminal):  # type: ignore[no-untyped-def]
    """Do what the training loop does after an action.

    ``seen`` are the rewards (joints,), who is at its goal (joints,), and the next state.
    """
    paid, there, next_state = seen
    remember(workspace, x)
    for i in range(next_state.shape[0]):
        x[i] = next_state[i]
    if not terminal:
        look_ahead(learner, schedule, x, workspace, random)
    if learner.rate == 0.0:
        return
    for joint in range(paid.shape[0]):
        workspace.paid[joint], workspace.there[joint] = paid[joint], there[joint]
    learn(learner, workspace, terminal)
