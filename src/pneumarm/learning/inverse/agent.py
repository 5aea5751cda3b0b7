"""An agent that has learned nothing but the inverse simulation: it acts by the clouds of its goals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.learning.agents import SimulationAgent
from pneumarm.learning.inverse.cloud import Cloud, InverseSettings, cloud_of
from pneumarm.simulation.inverse import inverse_of
from pneumarm.task.begin import begin_states
from pneumarm.transitions.store import Store


@dataclass(frozen=True, repr=False)
class InverseAgent(SimulationAgent):
    """Clouds of goals all over the range, as far apart as tolerances are wide; a goal takes that of the nearest.

    Its ``simulation`` is the backward one: a state is a single observation.
    """

    clouds: tuple[Cloud, ...]
    goals_of_clouds: NDArray[np.float64]
    """Shape (clouds,) [counts]."""
    settings: InverseSettings

    @classmethod
    def of(cls, store: Store, settings: InverseSettings = InverseSettings(), seed: int = 0) -> "InverseAgent":
        """Return the agent for the arm of ``store``; it takes some seconds for each cloud.

        Raises:
            UnusableInput: the arm has several joints, or the store holds too little.

        """
        if store.joints > 1:
            raise UnusableInput(f"{store.address}: expected an arm of one joint, got one of {store.joints}")
        inverse = inverse_of(store, seed)
        simulation = inverse.backward
        rest = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
        resting = simulation.scaling.observation_offset + rest.states * simulation.scaling.observation_scale
        (low, high), apart = simulation.goal_range[0], settings.reward.on(simulation.spec).angle_tolerance
        goals = np.linspace(low, high, int((high - low) // (2 * apart)) + 2)
        random = np.random.default_rng(seed)
        clouds = tuple(cloud_of(inverse, goal, resting, settings, random) for goal in goals)
        return cls(simulation, clouds, goals, settings)

    def actor(self) -> "InverseActor":
        """Return it acting."""
        return InverseActor(self)


class InverseActor:
    """An :class:`InverseAgent` acting step by step."""

    def __init__(self, agent: InverseAgent) -> None:
        self._agent, self._last = agent, -1
        self._cloud, self._shift = agent.clouds[0], 0.0
        self._state: NDArray[np.float64] | None = None

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (1,) [counts]."""
        aim = float(np.asarray(goal, np.float64).reshape(1)[0])
        nearest = int(np.abs(self._agent.goals_of_clouds - aim).argmin())
        self._cloud = self._agent.clouds[nearest]
        # As far from the cloud's goal as the arm is from its own: over so little, muscles are the same.
        self._shift = (self._agent.goals_of_clouds[nearest] - aim) / self._agent.scaling.observation_scale[0]
        self._last = -1
        self.follow(state)

    def act(self) -> NDArray[np.int64]:
        """Return the action (1,) of the current state; it stays the same until the next state."""
        if self._state is None:
            raise PneumarmError("begin an episode before acting")
        return np.array([self._last])

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in the scaled ``next_state`` (state_size,)."""
        self._state = np.array(next_state, np.float64)
        self._state[0] += self._shift
        settings, cloud = self._agent.settings, self._cloud
        distance, place = cloud.states.query(self._state, k=min(settings.neighbours, cloud.states.n))
        distance, place = np.atleast_1d(distance), np.atleast_1d(place)
        is_switch = (self._last >= 0) & (cloud.actions[place] != self._last)
        cost = cloud.steps[place] + settings.far * distance + settings.hold * is_switch
        self._last = int(cloud.actions[place[cost.argmin()]])
