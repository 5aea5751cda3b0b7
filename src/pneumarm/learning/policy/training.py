"""Training in many simulated arms: several learners at once, of which the best is kept; and the policy's learner."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.fleet_settings import FleetSettings, PolicySettings
from pneumarm.learning.online.training import Progress
from pneumarm.learning.policy.acting import Mind
from pneumarm.learning.policy.agent import PolicyAgent, mind, policy_sizes
from pneumarm.learning.policy.proximal import Rule, batch, collect, improve
from pneumarm.learning.policy.testing import run_policy
from pneumarm.learning.side_by_side import Learner, identity_of, train_side_by_side
from pneumarm.networks.layers import initial_weights, trainable
from pneumarm.random import random_state, random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.fleet import begin_all, fleet
from pneumarm.task.movements import Movements

_WEIGHTS, _ARMS, _ORDER, _VALIDATION = 0, 1, 2, 3  # streams of random numbers
_FIRST_OUTPUT = 0.01  # the first policy chooses by its bonus for holding alone
AgentT = TypeVar("AgentT")


@dataclass(frozen=True)
class FleetTraining(Generic[AgentT]):
    """A training in many simulated arms: its best agent and all that it took."""

    agent: AgentT
    best: int
    """Index of the best learner, by mean reward in its validation."""
    validation: tuple[Movements, ...]
    """Validation of every learner, without lookahead, with seeds of its own."""
    curves: NDArray[np.float64]
    """Columns as in ``FLEET_CURVES``, shape (agents, rows, columns)."""
    episodes: int
    """Of all learners together."""
    steps: int
    """Of all simulated arms of all learners together."""
    seconds: float
    """Wall time of training and validation [s], without compiling."""
    core_seconds: float
    """Processor time of collecting and learning, all threads together [s], without compiling and validation."""

    def results(self) -> dict[str, Any]:
        """Return what ``train --json`` says."""
        return {
            "episodes": self.episodes,
            "steps": self.steps,
            "seconds": self.seconds,
            "steps_per_second": self.steps / max(self.seconds, 1e-9),
            "steps_per_second_per_core": self.steps / max(self.core_seconds, 1e-9),
            "best": self.best,
            "validation": [result.results() for result in self.validation],
        }


class FleetLearner(Learner, Generic[AgentT]):
    """A learner that becomes an agent."""

    mind: Mind
    """What acts in the simulated arms."""

    @abstractmethod
    def agent(self) -> AgentT:
        """Return the agent as it is now."""


def train_fleet(
    make: Callable[[int], FleetLearner[AgentT]],
    settings: FleetSettings,
    seed: int = 0,
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> FleetTraining[AgentT]:
    """Train ``settings.agents`` learners, of which ``make`` makes each by its number, and return the best agent.

    The same seed gives the same agents, bit for bit, with any number of ``threads`` (default: one a core). With a
    ``checkpoint`` a killed training goes on from there; the file is left when training is done.

    ``seed`` is the one that the learners are made with.

    Raises:
        UnusableInput: the checkpoint is of another training.

    """
    compiled = make(0)
    compiled.update()  # on a learner that is thrown away, so that compiling is not counted as training
    compiled.validate(1)
    learners = [make(number) for number in range(settings.agents)]
    trained = train_side_by_side(
        learners,
        settings.updates,
        settings.validation_episodes,
        identity_of(compiled.mind.environment, settings, seed),
        progress=progress,
        checkpoint=checkpoint,
        threads=threads,
    )
    return FleetTraining(
        agent=learners[trained.best].agent(),
        best=trained.best,
        validation=trained.validation,
        curves=np.stack([one.curve for one in learners]),
        episodes=sum(int(one.counts[2]) for one in learners),
        steps=sum(int(one.counts[0]) for one in learners) * settings.arms * settings.steps,
        seconds=trained.seconds,
        core_seconds=sum(float(one.seconds[0]) for one in learners),
    )


class PolicyLearner(FleetLearner[PolicyAgent]):
    """A policy and the value of states under it, with the arms in which they are learned."""

    networks = ("policy", "value")

    def __init__(
        self, simulation: Simulation, begin_states: BeginStates, settings: PolicySettings, seed: int, number: int
    ) -> None:
        window = simulation.window
        random = np.random.default_rng([seed, _WEIGHTS, number])
        self.sizes = policy_sizes(window, settings)
        value_sizes = (*self.sizes[:-1], 1)
        self.policy = trainable(initial_weights(self.sizes, _FIRST_OUTPUT, random), self.sizes, settings.arms)
        self.value = trainable(initial_weights(value_sizes, 1.0, random), value_sizes, settings.arms)
        self.mind = mind(simulation, begin_states, settings, self.policy.flat)
        arms = fleet(self.mind.environment, random_states((seed, _ARMS, number), settings.arms))
        begin_all(self.mind.environment, arms)
        super().__init__(arms, random_state((seed, _ORDER, number)))
        self._batch = batch(settings.steps, self.sizes[0], window.joints, settings.arms)
        self._rule = rule(settings)
        self._simulation, self._settings, self._seed = simulation, settings, seed

    def update(self) -> tuple[int, int, float]:
        """Act for a batch of steps and learn from them."""
        now, counts, (environment, limits, inputs) = self._rule, self.counts, self.mind[:3]
        seen: tuple[int, int, float] = collect(environment, limits, inputs, now, self.policy, self.fleet, self._batch)
        counts[1] = improve(now, self.policy, self.value, self._batch, self.rates(), counts[1], self.random)
        return seen

    def rates(self) -> tuple[float, float]:
        """Return the learning rates of policy and values."""
        rate = self._settings.learning_rate * (1 - self.counts[0] / self._settings.updates)
        return rate, rate

    def agent(self) -> PolicyAgent:
        """Return the agent as it is now."""
        return PolicyAgent(self._simulation, self.policy.flat.copy(), self._settings)

    def validate(self, episodes: int) -> Movements:
        """Return greedy movements, without lookahead."""
        return run_policy(self.mind, self.sizes, episodes, (self._seed, _VALIDATION))


def rule(settings: PolicySettings) -> Rule:
    """Return how the policy is improved, for kernels."""
    return Rule(
        hold=float(settings.hold),
        discount=float(settings.discount),
        decay=float(settings.trace_decay),
        clip=float(settings.clip),
        entropy=float(settings.entropy),
        epochs=int(settings.epochs),
        largest=float(settings.largest_gradient),
        scale=float(settings.return_scale),
    )
