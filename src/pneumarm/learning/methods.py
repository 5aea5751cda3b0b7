"""Agents of all kinds: what they have in common, and the methods that train them.

Whatever kind an agent is of, it is trained, saved, loaded, tested, transferred and used as a controller by the same
commands. A kind is a class like :class:`Agent`; a method is a learner for :func:`train_fleet`, or
a function of its own.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Protocol, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.files import kind_of
from pneumarm.learning.batched.training import ValueLearner
from pneumarm.learning.fleet_settings import BatchedSettings, PolicySettings
from pneumarm.learning.imported import KIND as IMPORTED
from pneumarm.learning.imported import ImportedPolicy
from pneumarm.learning.online.agent import KIND as ACTION_VALUES
from pneumarm.learning.online.agent import Agent
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.online.training import Progress, Training
from pneumarm.learning.online.training import train as train_online
from pneumarm.learning.policy.agent import KIND as POLICY
from pneumarm.learning.policy.agent import PolicyAgent
from pneumarm.learning.policy.training import FleetTraining, PolicyLearner, train_fleet
from pneumarm.settings import Settings, Valid
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.movements import TEST, Movements
from pneumarm.task.settings import TaskSettings
from pneumarm.transitions.window import Window

Method = Literal["policy", "batched", "sarsa", "q-learning"]
"""A policy, by default; the thesis' nine networks learned in many arms at once; the thesis' own two."""
METHODS: tuple[Method, ...] = get_args(Method)
MethodSettings = PolicySettings | BatchedSettings | TrainSettings
"""Settings of a training; their type says which method is meant."""
Trained = FleetTraining[PolicyAgent] | FleetTraining[Agent] | Training

LOOKING_AHEAD = 500
"""Movements of a test that looks ahead; they take seconds."""


@dataclass(frozen=True)
class LearnSettings(Settings):
    """Which method learns, and the settings of each."""

    method: Method = "policy"
    """policy, batched (the thesis' networks learned in many arms at once), sarsa or q-learning (the thesis')."""
    policy: PolicySettings = field(default_factory=PolicySettings)
    """Of the method policy."""
    batched: BatchedSettings = field(default_factory=BatchedSettings)
    """Of the method batched."""
    thesis: TrainSettings = field(default_factory=TrainSettings)
    """Of the methods sarsa and q-learning."""

    def _valid(self) -> Valid:
        return {"method": self.method in METHODS or f"one of {', '.join(METHODS)}"}

    @property
    def chosen(self) -> MethodSettings:
        """The settings of the method."""
        if self.method == "policy":
            return self.policy
        if self.method == "batched":
            return self.batched
        return replace(self.thesis, method=self.method)


class Actor(Protocol):
    """An agent acting step by step, see :class:`~pneumarm.learning.online.learner.OnlineLearner`."""

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state."""

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state`` without learning."""

    def observe(self, reward: ArrayLike, next_state: ArrayLike, terminal: bool) -> None:
        """Go on in ``next_state``, and learn from it if it is one that learns."""

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the weights as they are now."""

    def get_state(self) -> bytes:
        """Return everything that the future depends on, besides what it was made with."""

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit."""


class AnyAgent(Protocol):
    """What every kind of agent can do."""

    @property
    def spec(self) -> ArmSpec:
        """The arm that it was trained for."""

    @property
    def window(self) -> Window:
        """Of its state."""

    @property
    def scaling(self) -> Scaling:
        """Of its state."""

    @property
    def goal_range(self) -> NDArray[np.float64]:
        """Goals that it has learned to reach, shape (joints, 2) [counts]."""

    @property
    def settings(self) -> TaskSettings:
        """How it was trained, and for which task."""

    @property
    def learns(self) -> bool:
        """Whether its actor can learn on an arm."""

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of what it has learned."""

    def with_weights(self, weights: NDArray[np.float32]) -> Self:
        """Return the agent with other ``weights``, as of :meth:`weights`."""

    def actor(self, learning_rate: float = 0.0, explores: bool = False, seed: int = 0) -> Actor:
        """Return it acting: greedily, or exploring as at the end of training; learning by ``learning_rate``."""

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let it move greedily in ``simulation``; ``seed`` decides begin states and goals."""

    def save(self, path: Path) -> None:
        """Write it to ``path``, whole or not at all."""


def fingerprint(agent: AnyAgent) -> str:
    """Return what tells ``agent`` from others: of its kind, its settings, what it has learned, and its simulation."""
    digest = hashlib.sha256(f"{type(agent).__name__} {agent.settings!r}".encode())
    arrays = [agent.weights(), agent.goal_range, *vars(agent.scaling).values()]
    simulation = getattr(agent, "simulation", None)  # it decides too, in agents that look ahead or adapt
    if isinstance(simulation, Simulation):
        header, parts = simulation.parts()
        digest.update(repr(header).encode())
        arrays += [parts[name] for name in sorted(parts)]
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def load_agent(path: Path) -> AnyAgent:
    """Return the agent in ``path``, of whatever kind.

    Raises:
        UnusableInput: ``path`` is no agent, is damaged, or does not fit together.

    """
    kind = kind_of(path)
    if kind == POLICY:
        return PolicyAgent.load(path)
    if kind == ACTION_VALUES:
        return Agent.load(path)
    if kind == IMPORTED:
        return ImportedPolicy.load(path)
    raise UnusableInput(f"{path}: expected an agent written by pneumarm train, its kind is {kind!r}")


def train(
    simulation: Simulation,
    begin_states: BeginStates,
    settings: MethodSettings | None = None,
    seed: int = 0,
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Trained:
    """Train agents by the method that ``settings`` are of (default: a policy) and return the best.

    The same seed gives the same agents, bit for bit, with any number of ``threads`` (default: one a core). With a
    ``checkpoint`` a killed training goes on from there; the file is left when training is done.

    Raises:
        UnusableInput: begin states and simulation do not fit, or the checkpoint is of another training.

    """
    how: dict[str, Any] = {"progress": progress, "checkpoint": checkpoint, "threads": threads}
    if isinstance(settings, TrainSettings):
        return train_online(simulation, begin_states, settings, seed, **how)
    if isinstance(settings, BatchedSettings):
        batched = settings
        return train_fleet(lambda n: ValueLearner(simulation, begin_states, batched, seed, n), batched, seed, **how)
    policy = settings or PolicySettings()
    return train_fleet(lambda n: PolicyLearner(simulation, begin_states, policy, seed, n), policy, seed, **how)


def test(
    agent: AnyAgent,
    simulation: Simulation,
    begin_states: BeginStates,
    episodes: int = 10_000,  # noqa: PT028 - this is no test case
    seed: int = 0,  # noqa: PT028
) -> Movements:
    """Let ``agent`` move greedily and without learning, from all begin states to all goals.

    A policy moves as it says at once; what looking ahead adds on an arm is told by :func:`test_ahead`. Begin states
    and goals depend on ``seed`` alone, not on what the agent does, so baselines get the same ones.

    Raises:
        UnusableInput: the agent was made for an arm or a window of another kind, or there is no episode.

    """
    _check_made_for(agent, simulation)
    return agent.test(simulation, begin_states, episodes, (seed, TEST))


test.__test__ = False  # type: ignore[attr-defined]


def test_ahead(
    agent: AnyAgent,
    simulation: Simulation,
    begin_states: BeginStates,
    episodes: int = LOOKING_AHEAD,  # noqa: PT028 - this is no test case
    seed: int = 0,  # noqa: PT028
) -> Movements | None:
    """Let ``agent`` make the first movements of :func:`test` as it makes them on an arm, looking ahead.

    None for an agent that acts on an arm as it does in :func:`test`: there is nothing to add.

    Raises:
        UnusableInput: the agent was made for an arm or a window of another kind, or there is no episode.

    """
    _check_made_for(agent, simulation)
    if not isinstance(agent, PolicyAgent):
        return None
    return agent.test_ahead(simulation, begin_states, episodes, (seed, TEST))


test_ahead.__test__ = False  # type: ignore[attr-defined]


def results_with_lookahead(tested: Movements, ahead: Movements | None) -> dict[str, Any]:
    """Return what ``results.json`` holds of :func:`test` and, under ``lookahead``, of :func:`test_ahead`."""
    return {**tested.results(), "lookahead": None if ahead is None else ahead.results()}


def _check_made_for(agent: AnyAgent, simulation: Simulation) -> None:
    if agent.window != simulation.window:
        raise UnusableInput(f"an agent for {agent.window} cannot be tested on a simulation of {simulation.window}")
    scaling, other = agent.scaling, simulation.scaling
    if not all(np.array_equal(getattr(scaling, name), getattr(other, name)) for name in vars(scaling)):
        raise UnusableInput("the agent was trained in another simulation: its inputs are scaled differently")
