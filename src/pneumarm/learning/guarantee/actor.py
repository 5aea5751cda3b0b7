"""A filter that passes only actions that bring the goal nearer in expectation (thesis section 4.4).

    V(s) = actions of the shortest plan from s to the goal, in the simulation without noise
    pass the agent's action a where E V(s') <= V(s) - d, s' being what follows s and a in the simulation with noise
    else take the first action of that plan where E V(s') <= V(s) - d holds for it
    else take the one of the two whose E V(s') is lower, and count a decision without a guarantee

Where every decision has the guarantee, a movement from s takes no more than V(s) / d actions on average: V falls by d
a step and ends at 0 (Foster's criterion). It holds in the simulation, not on the arm, and up to the sampling of the
expectation. States from which no plan is known have none.

Source: T. J. Perkins and A. G. Barto, "Lyapunov design for safe reinforcement learning", JMLR 3, 2002.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import to_actions, to_valves
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.learning.agents import Acts, SimulationAgent
from pneumarm.planning.planner import SIMULATED, SimulationModel
from pneumarm.planning.search import find, problem, tree
from pneumarm.random import random_states
from pneumarm.settings import PositiveFloat, PositiveInt, PythonOnly, Settings
from pneumarm.simulation.noise import NoiseSettings, noise_parameters
from pneumarm.simulation.rollout import advance_simulated
from pneumarm.task.acting import Acting

_NOISE = 7  # seed of the noise of expectations, the same in every decision


@dataclass(frozen=True)
class GuaranteeSettings(Settings):
    """What is guaranteed, and how closely it is looked at."""

    decrease: PositiveFloat = 0.25
    """d, by how many actions V has to fall in expectation."""
    samples: PositiveInt = 4
    """States that may follow, over which the expectation is taken."""
    switches: Annotated[PositiveInt, PythonOnly] = 2
    """Most switches of a plan."""
    farthest: Annotated[PositiveInt, PythonOnly] = 100
    """V where no plan reaches the goal."""


class GuaranteedActor:
    """What an agent does, filtered; ``passed``, ``replaced`` and ``without`` count its decisions."""

    def __init__(
        self, agent: Acts, settings: GuaranteeSettings = GuaranteeSettings(), actor: Acting | None = None
    ) -> None:
        """Filter what ``agent`` does, or an ``actor`` that acts in its place.

        Raises:
            UnusableInput: it settles at its goals, or keeps no simulation to plan in.

        """
        if agent.settles or not isinstance(agent, SimulationAgent):
            raise UnusableInput(
                "a guarantee: expected an agent that reaches goals and keeps its simulation, as of esp or policy"
            )
        simulation, plans = agent.simulation, replace(SIMULATED, cutoff=settings.farthest, switches=settings.switches)
        joints = simulation.window.joints
        self._agent, self._settings = actor or agent.actor(), settings
        self._model = model = SimulationModel(simulation, plans)
        self._reward = replace(agent.settings.reward, switch=0.0).on(simulation.spec)  # V counts actions alone
        self._problem = problem(
            np.zeros(joints), self._reward, plans, muscles=simulation.spec.muscles, agility=model.agility
        )
        self._tree = tree(plans, joints)
        self._noisy = model.world._replace(noise=noise_parameters(NoiseSettings(kind="white"), simulation))
        self._seeds = random_states(_NOISE, settings.samples)
        self._state: NDArray[np.float32] | None = None
        self._chosen: NDArray[np.int64] | None = None
        self.passed = self.replaced = self.without = 0

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        self._problem.goal[:] = goal
        self._agent.begin(state, goal)
        self._state, self._chosen = np.array(state, np.float32), None

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state; they stay the same until the next state."""
        if self._state is None:
            raise PneumarmError("begin an episode before acting")
        if self._chosen is None:
            self._chosen = self._filtered(self._state, np.asarray(self._agent.act(), np.int64))
        return self._chosen.copy()

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in the scaled ``next_state`` (state_size,)."""
        self._agent.follow(next_state)
        self._state, self._chosen = np.array(next_state, np.float32), None

    def _filtered(self, state: NDArray[np.float32], wanted: NDArray[np.int64]) -> NDArray[np.int64]:
        distance, planned = self.distance(state)
        highest = distance - self._settings.decrease
        after = self.expected(state, wanted)
        if distance < self._settings.farthest and after <= highest:
            self.passed += 1
            return wanted
        after_plan = self.expected(state, planned)
        if distance < self._settings.farthest and after_plan <= highest:
            self.replaced += 1
            return planned
        self.without += 1
        return planned if after_plan < after else wanted

    def distance(self, state: NDArray[np.float32]) -> tuple[float, NDArray[np.int64]]:
        """Return V of the scaled ``state`` (state_size,), and the first actions (joints,) of the plan from there."""
        self._model.put(state)
        return self._distance()

    def expected(self, state: NDArray[np.float32], actions: NDArray[np.int64]) -> float:
        """Return the mean of V over what may follow the scaled ``state`` (state_size,) and ``actions`` (joints,)."""
        valves, total = to_valves(actions), 0.0
        for seed in self._seeds:
            self._model.put(state)
            self._noisy.workspace.random[:] = seed
            advance_simulated(self._noisy, self._model.states, 0, valves)
            states = self._model.states
            if not self._reward.reached(states.angle[0], states.velocity[0], self._problem.goal):
                total += self._distance()[0]
        return total / len(self._seeds)

    def _distance(self) -> tuple[float, NDArray[np.int64]]:
        """Return what :meth:`distance` does of the state that the model is in."""
        plan = find(self._model.world, self._model.states, self._problem, self._tree)
        actions = to_actions(self._problem.commands[plan.actions[0]])
        return float(len(plan.actions) if plan.reached else self._settings.farthest), actions
