"""Evolving networks in simulated arms, generation after generation."""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.learning.evolution.acting import arms_of, input_count, measure_fitness, world
from pneumarm.learning.evolution.agent import EvolvedAgent
from pneumarm.learning.evolution.populations import burst, draw_networks, first_neurons, mean_fitness, recombine
from pneumarm.learning.evolution.settings import EvolutionSettings
from pneumarm.learning.training import Learner, Training, identity_of, train_side_by_side
from pneumarm.random import random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.movements import Movements

_NEURONS, _EPISODES, _CHAMPION, _VALIDATION = 0, 1, 2, 3  # streams of random numbers
_TOGETHER = 1024  # arms that move at once; more do not fit the processor's cache


def evolve(
    simulation: Simulation, begin_states: BeginStates, settings: EvolutionSettings, seed: int = 0, **how: Any
) -> Training[EvolvedAgent]:
    """Evolve agents and return the best; ``how`` as of :func:`~pneumarm.learning.training.train_side_by_side`.

    Raises:
        UnusableInput: there are fewer units than muscles.

    """
    outputs = simulation.spec.joints * simulation.spec.muscles
    if settings.hidden < outputs:
        raise UnusableInput(f"hidden: expected {outputs} units or more, one a muscle, got {settings.hidden}")
    there = world(simulation, begin_states, settings)
    return train_side_by_side(
        lambda number: EvolutionLearner(simulation, begin_states, settings, seed, number),
        settings.agents,
        settings.validation_episodes,
        identity_of(there.environment, settings, seed),
        **how,
    )


class EvolutionLearner(Learner[EvolvedAgent]):
    """Subpopulations and the best network so far; its curve tells what that earns in always the same episodes."""

    columns = ("episodes", "reward", "fitness")

    def __init__(
        self, simulation: Simulation, begin_states: BeginStates, settings: EvolutionSettings, seed: int, number: int
    ) -> None:
        super().__init__()
        self._simulation, self._begin, self._settings = simulation, begin_states, settings
        self._seed, self._number = seed, number
        self._world = world(simulation, begin_states, settings)
        self._episodes = random_states((seed, _CHAMPION), settings.champion_episodes)
        self._together = max(1, min(_TOGETHER // settings.episodes, settings.neurons * settings.trials))
        self._arms = arms_of(self._world, self._together, settings.hidden, settings.episodes)
        self._trial = arms_of(self._world, 1, settings.hidden, settings.champion_episodes)
        genes = input_count(simulation.window, settings) + settings.hidden
        self.neurons = first_neurons(settings.hidden, genes, settings, self._random(_NEURONS, 0))
        self.best = self.neurons[:, 0].copy()
        """The best network so far, shape (units, genes)."""
        self.highest = np.full(1, -np.inf)
        """Its mean reward."""
        self.counts = np.zeros(3, np.int64)
        """Generations, those since the best network was found or there was a burst, and steps."""

    def _random(self, stream: int, generation: int) -> np.random.Generator:
        """Return random numbers that depend on how far evolution is alone, so that a checkpoint needs none."""
        return np.random.default_rng((self._seed, stream, self._number, generation))

    @property
    def ended(self) -> bool:
        """Whether all generations are over."""
        return int(self.counts[0]) >= self._settings.generations

    @property
    def share(self) -> float:
        """How far it is, 0 to 1."""
        return float(self.counts[0]) / self._settings.generations

    @property
    def episodes(self) -> int:
        """Episodes so far, those of the best networks among them."""
        settings = self._settings
        each = settings.neurons * settings.trials * settings.episodes + settings.champion_episodes
        return int(self.counts[0]) * each

    @property
    def steps(self) -> int:
        """Steps of all arms so far."""
        return int(self.counts[2])

    def warm_up(self) -> None:
        """Evolve for a generation."""
        self.learn_on()

    def learn_on(self) -> None:
        """Evolve for a generation."""
        settings, began, generation = self._settings, time.thread_time(), int(self.counts[0])
        random = self._random(_NEURONS, generation + 1)
        chosen, networks = draw_networks(self.neurons, settings.trials, random)
        earned = self._fitness(networks, generation)
        champion = networks[earned.argmax()]
        reward = np.zeros(1)
        self.counts[2] += measure_fitness(self._world, champion[None], self._trial, self._episodes, reward)
        self.counts[:2] += 1
        if reward[0] > self.highest[0]:
            self.best[...], self.highest[...], self.counts[1] = champion, reward, 0
        if self.counts[1] >= settings.stagnation:
            self.neurons[...], self.counts[1] = burst(self.best, settings, random), 0
        else:
            fitness = mean_fitness(chosen, earned, settings.neurons)
            self.neurons[...] = recombine(self.neurons, fitness, settings, random)
        self.add_row((self.episodes, self.highest[0], earned.max()), time.thread_time() - began)

    def _fitness(self, networks: NDArray[np.float32], generation: int) -> NDArray[np.float64]:
        """Return the mean reward of each of ``networks`` (n, units, genes)."""
        seeds = random_states((self._seed, _EPISODES, self._number, generation), self._settings.episodes)
        found = np.zeros(len(networks))
        for first in range(0, len(networks), self._together):
            some = networks[first : first + self._together]
            part = found[first : first + self._together]
            self.counts[2] += measure_fitness(self._world, some, self._arms, seeds, part)
        return found

    def validate(self, episodes: int) -> Movements:
        """Return movements of the best network."""
        return self.agent().test(self._simulation, self._begin, episodes, (self._seed, _VALIDATION))

    def agent(self) -> EvolvedAgent:
        """Return the best network so far as an agent."""
        return EvolvedAgent(self._simulation, self.best.ravel().copy(), self._settings)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        return {"neurons": self.neurons, "best": self.best, "highest": self.highest, "counts": self.counts}
