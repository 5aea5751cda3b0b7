"""Training a hierarchy, episode after episode, with the thesis' shaping."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.hierarchy.agent import HierarchicalAgent
from pneumarm.learning.hierarchy.loop import hierarchy, level_memory, train_levels, upper_shape
from pneumarm.learning.hierarchy.settings import HierarchySettings
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.training import ShapedLearner
from pneumarm.learning.training import Training, identity_of, train_side_by_side
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, Episode, environment
from pneumarm.task.movements import Movements

_UPPER, _VALIDATION = 3, 2  # streams of random numbers


def train_hierarchy(
    simulation: Simulation, begin_states: BeginStates, settings: HierarchySettings, seed: int = 0, **how: Any
) -> Training[HierarchicalAgent]:
    """Train hierarchies and return the best; ``how`` as of :func:`~pneumarm.learning.training.train_side_by_side`.

    Training of one ends as that of the thesis' agents does, see :func:`~.online.training.train_online`.
    """
    env = environment(simulation, begin_states, settings)
    return train_side_by_side(
        lambda number: HierarchicalLearner(env, simulation, begin_states, settings, seed, number),
        settings.agents,
        settings.validation_episodes,
        identity_of(env, settings, seed),
        **how,
    )


class HierarchicalLearner(ShapedLearner[HierarchicalAgent, HierarchySettings]):
    """Two levels of the thesis' networks, learning in episodes that begin ever farther from their goals."""

    def __init__(
        self,
        env: Environment,
        simulation: Simulation,
        begin_states: BeginStates,
        settings: HierarchySettings,
        seed: int,
        number: int,
    ) -> None:
        super().__init__(env, simulation, settings, seed, number)
        random, most = np.random.default_rng([seed, _UPPER, number]), settings.initial_weight
        shape = upper_shape(simulation.window, settings)
        self._upper = random.uniform(-most, most, shape).astype(np.float32)
        self._begin = begin_states

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        return {**super().arrays(), "upper": self._upper}

    def _run(self, schedule: Schedule, one: Episode, count: int) -> tuple[float, int, int]:
        window, scaling = self._simulation.window, self._simulation.scaling
        levels = hierarchy((self._upper, self._weights), self._simulation.spec, window, scaling, self._settings)
        found: tuple[float, int, int] = train_levels(
            self._env, levels, schedule, one, level_memory(levels), count, float(self._shaping[1])
        )
        return found

    def validate(self, episodes: int) -> Movements:
        """Return greedy movements."""
        return self.agent().test(self._simulation, self._begin, episodes, (self._seed, _VALIDATION))

    def agent(self) -> HierarchicalAgent:
        """Return the agent as it is now."""
        simulation = self._simulation
        return HierarchicalAgent(simulation, self._upper.copy(), self._weights.copy(), self._settings)
