"""An agent that has learned nothing but the simulation: it plans in it, every turn anew, to reach goals.

It can be tested in a simulation, act step by step, and be put onto an arm. Its file is that of its simulation. It
decides as :func:`~pneumarm.planning.planner.simulated_planner` does, and does not learn on an arm.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import to_actions
from pneumarm.errors import UnusableInput
from pneumarm.learning.agents import SimulationAgent
from pneumarm.planning.planner import SIMULATED, SimulationModel, simulated_planner
from pneumarm.planning.search import PlanSettings
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.settings import TaskSettings


@dataclass(frozen=True, repr=False)
class PlanAgent(SimulationAgent):
    """A simulation that is planned in."""

    settings: TaskSettings = field(default_factory=TaskSettings)
    """What is asked of its movements."""
    plan: PlanSettings = SIMULATED
    """Which plans are considered."""

    def actor(self) -> "PlanActor":
        """Return it acting."""
        return PlanActor(self)

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
        return cls(simulation_of_valves(path))


def simulation_of_valves(path: Path) -> Simulation:
    """Return the simulation in ``path``.

    Raises:
        UnusableInput: it is none, or one of continuous commands.

    """
    simulation = Simulation.load(path)
    if not simulation.valves:
        raise UnusableInput(f"{path}: was fitted to continuous commands; a plan needs a simulation of valves")
    return simulation


class PlanActor:
    """A :class:`PlanAgent` acting step by step."""

    def __init__(self, agent: PlanAgent) -> None:
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
