"""What an agent is: it acts, it can be saved, and it may learn on an arm. Everything else is up to its kind.

Whatever kind an agent is of, it is tested, transferred, saved, loaded and used as a controller by the same commands.
What only some can do is asked for by the class that says so, never by the kind: :class:`Learns`,
:class:`SelfTesting`, :class:`LooksAhead`, :class:`Adapts`, :class:`Retrainable`. Whether one settles at its goals, or
only reaches them, it says itself: ``settles``.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.controller import TrackingController
from pneumarm.arm.seam import ArmSpec
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.acting import Acting
from pneumarm.task.begin import BeginStates
from pneumarm.task.movements import Movement, Movements
from pneumarm.task.settings import TaskSettings
from pneumarm.transitions.goals import Goals
from pneumarm.transitions.window import Window


class OfAnArm(Protocol):
    """What was made to move an arm."""

    @property
    def spec(self) -> ArmSpec:
        """The arm that it was made for."""

    @property
    def window(self) -> Window:
        """Window of its state."""

    @property
    def scaling(self) -> Scaling:
        """Scaling of its state."""

    @property
    def goal_range(self) -> NDArray[np.float64]:
        """Goals that it reaches, shape (joints, 2) [counts]."""

    @property
    def settings(self) -> TaskSettings:
        """Its task, and how it was trained."""


class Acts(OfAnArm, Protocol):
    """An agent that acts."""

    settles: ClassVar[bool]
    """Whether it settles at goals, holds them and follows references; otherwise it only reaches goals."""

    def actor(self) -> Acting:
        """Return it acting step by step, as well as it can."""

    def controller(self) -> TrackingController | None:
        """Return what moves the arm if it ``settles``, ready: it waits for nothing to be compiled; otherwise None."""

    def worth(self, movement: Movement) -> float:
        """Return how good its ``movement`` was: more is better."""


class Saved(Protocol):
    """What can be saved."""

    def save(self, path: Path) -> None:
        """Write it to ``path``, whole or not at all.

        The kind of the file is the one by which its method loads it, see :mod:`~pneumarm.learning.methods`.
        """


class AnyAgent(Acts, Saved, Protocol):
    """An agent of any kind."""


@runtime_checkable
class LearningActor(Acting, Protocol):
    """An agent that acts and learns step by step, see :class:`~pneumarm.learning.online.agent.OnlineLearner`."""

    def observe(self, reward: ArrayLike, next_state: ArrayLike, terminal: bool) -> None:
        """Go on in ``next_state`` and learn from it; ``reward`` is a number or one a joint (joints,)."""

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the weights as they are now."""

    def get_state(self) -> bytes:
        """Return everything that the future depends on, besides what it was made with."""

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit."""


@runtime_checkable
class Learns(Acts, Saved, Protocol):
    """An agent that can learn on an arm."""

    def learner(self, learning_rate: float, seed: int = 0) -> LearningActor:
        """Return it acting, exploring as at the end of its training, and learning by ``learning_rate``."""

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of what it has learned."""

    def with_weights(self, weights: NDArray[np.float32]) -> Self:
        """Return the agent with other ``weights``, as of :meth:`weights`."""


@runtime_checkable
class SelfTesting(Protocol):
    """An agent with a test in a simulation that is faster than acting step by step."""

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let it move greedily in ``simulation``; ``seed`` decides begin states and goals."""


@runtime_checkable
class LooksAhead(Protocol):
    """An agent that looks ahead on an arm, which its :meth:`SelfTesting.test` leaves out."""

    def test_ahead(
        self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]
    ) -> Movements | None:
        """Let it move as on an arm; None where it does not look ahead."""


@runtime_checkable
class Knows(Protocol):
    """An agent whose controllers learn in which ways the joints of its arm are best treated: their ``ways``."""

    def knowing(self, ways: tuple[float, ...]) -> Self:
        """Return the agent with the ``ways`` of a controller, which the next one begins with."""


@runtime_checkable
class Retrainable(Protocol):
    """An agent that can be made anew for joints that are kept stiffer, which swing less and are slower."""

    def stiffer(self) -> Self:
        """Return the agent with joints to be kept stiffer wherever it learns from now on."""

    def retrained(self, simulation: Simulation, begin: BeginStates, seed: int) -> Self:
        """Return the agent trained from the beginning in ``simulation``, from states ``begin``."""


@runtime_checkable
class Adapts(Acts, Saved, Protocol):
    """An agent that adapts between movements: its simulation is fitted anew, and it goes on learning in that."""

    @property
    def simulation(self) -> Simulation:
        """Simulation of its arm."""

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of what it has learned."""

    def revised(self, simulation: Simulation, weights: NDArray[np.float32]) -> Self:
        """Return the agent with another ``simulation`` of its arm and other ``weights``."""

    def adapted(
        self, simulation: Simulation, begin: BeginStates, updates: int, warm_up: int, learning_rate: float, seed: int
    ) -> Self:
        """Return the agent after learning in ``simulation``, or with the weights as they were where that is better.

        Args:
            simulation: of the arm as it is now.
            begin: begin states of the arm as it is now.
            updates: how often it collects experience and learns from it.
            warm_up: updates before these that prepare that; the weights stay as they are.
            learning_rate: at the start; falls linearly to 0.
            seed: of everything that is drawn.

        """


class ReachesGoals:
    """What every agent that only reaches goals says of itself."""

    settles: ClassVar[bool] = False

    def controller(self) -> TrackingController | None:
        """Return None: states are made for it, and its actions taken one by one."""
        return None

    def worth(self, movement: Movement) -> float:
        """Return the reward of ``movement``."""
        return movement.reward


@dataclass(frozen=True)
class SimulationAgent(ReachesGoals):
    """An agent that keeps the simulation that it was made in: it is for the arm of that."""

    simulation: Simulation

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.simulation!r}>"

    @property
    def spec(self) -> ArmSpec:
        """The arm that the simulation is of."""
        return self.simulation.spec

    @property
    def window(self) -> Window:
        """Window of its state."""
        return self.simulation.window

    @property
    def scaling(self) -> Scaling:
        """Scaling of its state."""
        return self.simulation.scaling

    @property
    def goal_range(self) -> NDArray[np.float64]:
        """Goals that it reaches, shape (joints, 2) [counts]."""
        return self.goals.range

    @property
    def goals(self) -> Goals:
        """Goals that its arm was seen to hold."""
        return self.simulation.goals


def goals_of(agent: AnyAgent | SimulationAgent) -> Goals:
    """Return the goals that ``agent`` is to reach: those that it knows, or all within its range."""
    known: Goals | NDArray[np.float64] = getattr(agent, "goals", agent.goal_range)
    return Goals.of(known)


def fingerprint(agent: AnyAgent) -> str:
    """Return what tells ``agent`` from others: its kind, its settings and all that its file holds."""
    digest = hashlib.sha256(f"{type(agent).__name__} {agent.settings!r}".encode())
    with TemporaryDirectory() as folder:
        file = Path(folder) / "agent"
        agent.save(file)
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
