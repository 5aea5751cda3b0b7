"""Training the thesis' nine networks in many simulated arms at once."""

from typing import Any

import numpy as np

from pneumarm.learning.batched.settings import BatchedSettings
from pneumarm.learning.batched.values import (
    ValueRule,
    collect_values,
    connections,
    improve_values,
    network_sizes,
    to_networks,
    value_batch,
)
from pneumarm.learning.fleet import FleetLearner, train_fleet
from pneumarm.learning.online.agent import Agent
from pneumarm.learning.policy.acting import Mind
from pneumarm.learning.policy.inputs import input_parameters
from pneumarm.learning.possible import leave_out
from pneumarm.learning.training import Training
from pneumarm.networks.layers import initial_weights, trainable
from pneumarm.random import random_state, random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.fleet import begin_all, fleet, limits
from pneumarm.task.movements import Movements

_WEIGHTS, _ARMS, _ORDER, _VALIDATION = 0, 1, 2, 3  # streams of random numbers
_LAST_LAYER = 0.1  # the first values are small


def train_batched(
    simulation: Simulation, begin_states: BeginStates, settings: BatchedSettings, seed: int = 0, **how: Any
) -> Training[Agent]:
    """Train agents and return the best; ``how`` as of :func:`~pneumarm.learning.fleet.train_fleet`."""
    return train_fleet(lambda n: ValueLearner(simulation, begin_states, settings, seed, n), settings, seed, **how)


class ValueLearner(FleetLearner[Agent, BatchedSettings]):
    """Nine networks a joint, with the arms in which they are learned."""

    networks = ("values",)

    def __init__(
        self, simulation: Simulation, begin_states: BeginStates, settings: BatchedSettings, seed: int, number: int
    ) -> None:
        window, scaling = simulation.window, simulation.scaling
        sizes = network_sizes(window, settings.hidden)
        mask = connections(window, settings.hidden)
        weights = initial_weights(sizes, _LAST_LAYER, np.random.default_rng([seed, _WEIGHTS, number])) * mask
        leave_out(simulation.spec, weights, mask, sizes)
        self.values = trainable(weights, sizes, settings.arms, mask)
        env = environment(simulation, begin_states, settings)
        tolerance = settings.reward.angle_tolerance
        self.mind = Mind(
            environment=env,
            limits=limits(simulation, tolerance, patience=0),
            inputs=input_parameters(window, scaling, ()),
            layers=self.values.layers,
            hold=0.0,
            seeds=random_states(0, 1),
        )
        arms = fleet(env, random_states((seed, _ARMS, number), settings.arms))
        begin_all(env, arms)
        super().__init__(settings, env, arms, random_state((seed, _ORDER, number)))
        self._batch = value_batch(settings.steps, sizes[0], window.joints, settings.arms)
        self._rule = ValueRule(
            discount=float(settings.discount),
            decay=float(settings.trace_decay),
            epochs=int(settings.epochs),
            largest=float(settings.largest_gradient),
            scale=float(settings.return_scale),
        )
        self._simulation, self._begin, self._seed = simulation, begin_states, seed

    def update(self) -> tuple[int, int, float]:
        """Act for a batch of steps and learn from them."""
        settings, counts = self.settings, self.counts
        first, last, share = settings.first_exploration, settings.last_exploration, counts[0] / settings.updates
        exploration = (
            float(first.epsilon + share * (last.epsilon - first.epsilon)),
            float(first.temperature + share * (last.temperature - first.temperature)),
        )
        seen: tuple[int, int, float] = collect_values(
            self.mind, self._rule, exploration, self.values, self.fleet, self._batch
        )
        rate = settings.learning_rate * (1 - share)
        counts[1] = improve_values(self._rule, self.values, self._batch, rate, counts[1], self.random)
        return seen

    def agent(self) -> Agent:
        """Return the agent as it is now."""
        window, simulation = self._simulation.window, self._simulation
        networks = to_networks(self.values.flat, window, self.settings.hidden)
        return Agent(
            simulation.spec, window, simulation.scaling, simulation.goal_range, networks, self.settings.online
        )

    def validate(self, episodes: int) -> Movements:
        """Return greedy movements."""
        return self.agent().test(self._simulation, self._begin, episodes, (self._seed, _VALIDATION))
