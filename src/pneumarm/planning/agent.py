"""An agent that has learned nothing but the simulation: it plans in it, every turn anew.

It can do what a trained agent can: be tested in a simulation, act step by step, be put onto an arm. Its file is that
of its simulation. It decides as :func:`~pneumarm.planning.planner.simulated_planner` does, and does not learn on an
arm.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import to_actions
from pneumarm.errors import UnusableInput
from pneumarm.networks.network import Network
from pneumarm.planning.planner import SIMULATED, SimulationModel, simulated_planner
from pneumarm.planning.search import PlanSettings
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.acting import test_acting
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.movements import Movements
from pneumarm.task.settings import TaskSettings
from pneumarm.transitions.window import Window


@dataclass(frozen=True)
class PlanAgent:
    """A simulation that is planned in."""

    simulation: Simulation
    settings: TaskSettings = field(default_factory=TaskSettings)
    """What is asked of its movements."""
    plan: PlanSettings = SIMULATED
    """Which plans are considered."""

    @property
    def spec(self) -> ArmSpec:
        """The arm that the simulation is of."""
        return self.simulation.spec

    @property
    def window(self) -> Window:
        """Of its state."""
        return self.simulation.window

    @property
    def scaling(self) -> Scaling:
        """Of its state."""
        return self.simulation.scaling

    @property
    def goal_range(self) -> NDArray[np.float64]:
        """Range of the goals, shape (joints, 2) [counts]."""
        return self.simulation.goal_range

    @property
    def learns(self) -> bool:
        """It cannot learn on an arm."""
        return False

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of all weights of the simulation's networks, one after the other."""
        layers = [layer.ravel() for network in self.simulation.networks for layer in _layers(network)]
        return np.concatenate(layers).astype(np.float32)

    def with_weights(self, weights: NDArray[np.float32]) -> Self:
        """Return the agent with other ``weights`` of the simulation's networks.

        Raises:
            UnusableInput: not as many as it has.

        """
        if weights.shape != self.weights().shape:
            raise UnusableInput(f"expected {self.weights().size} weights, got {weights.shape}")
        networks, place = [], 0
        for network in self.simulation.networks:
            layers = []
            for layer in _layers(network):
                layers.append(weights[place : place + layer.size].reshape(layer.shape).astype(np.float64))
                place += layer.size
            networks.append(Network(*layers))
        return replace(self, simulation=replace(self.simulation, networks=tuple(networks)))

    def actor(self, learning_rate: float = 0.0, explores: bool = False, seed: int = 0) -> "PlanActor":
        """Return it acting; it neither learns nor explores, whatever is asked."""
        return PlanActor(self)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let it move in ``simulation``; ``seed`` decides begin states and goals."""
        return test_acting(self.actor(), environment(simulation, begin, self.settings), episodes, seed)

    def save(self, path: Path) -> None:
        """Write its simulation to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        self.simulation.save(path)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent that plans in the simulation in ``path``.

        Raises:
            UnusableInput: ``path`` is no simulation, or one of continuous commands.

        """
        simulation = Simulation.load(path)
        if not simulation.valves:
            raise UnusableInput(f"{path}: was fitted to continuous commands; a plan needs a simulation of valves")
        return cls(simulation)


class PlanActor:
    """A :class:`PlanAgent` acting step by step."""

    def __init__(self, agent: PlanAgent) -> None:
        self._weights = agent.weights()
        self._planner = simulated_planner(agent.simulation, agent.settings.reward, agent.plan)
        self._valves: NDArray[np.int8] | None = None

    @property
    def _model(self) -> SimulationModel:
        model = self._planner.model
        assert isinstance(model, SimulationModel)
        return model

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        self._planner.reset(np.asarray(goal, np.float64))
        self.follow(state)

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state."""
        if self._valves is None:
            self._valves = self._planner.choose_valves()
        return to_actions(self._valves)

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state``."""
        self._model.put(np.asarray(next_state, np.float32))
        self._valves = None

    def observe(self, reward: ArrayLike, next_state: ArrayLike, terminal: bool) -> None:
        """Go on in ``next_state``; nothing is learned."""
        self.follow(next_state)

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the weights."""
        return self._weights.copy()

    def get_state(self) -> bytes:
        """Return nothing: between movements there is nothing to remember."""
        return b""

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`."""
        if state:
            raise UnusableInput("this state is not of an agent that plans")


def _layers(network: Network) -> list[NDArray[np.float64]]:
    layers = [network.hidden_weights, network.hidden_bias, network.output_weights, network.output_bias]
    return layers if network.direct is None else [*layers, network.direct]
