"""A trained policy and its file, which holds all it needs to act, and its training in many simulated arms.

The file holds the policy and the simulation to look ahead in. When the arm has changed, training goes on.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.guard import guarded
from pneumarm.arm.valves import ACTIONS
from pneumarm.learning.fleet import FleetLearner, train_fleet
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.policy.acting import Mind
from pneumarm.learning.policy.actor import PolicyActor
from pneumarm.learning.policy.inputs import input_parameters, policy_input_size
from pneumarm.learning.policy.proximal import Rule, batch, collect_batch, improve_policy
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.learning.policy.testing import run_policy
from pneumarm.learning.possible import leave_out
from pneumarm.learning.training import Training
from pneumarm.networks.layers import initial_weights, split, trainable
from pneumarm.random import random_state, random_states
from pneumarm.simulation.arm import SimulationArm
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.acting import test_acting
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, environment
from pneumarm.task.fleet import begin_all, fleet, limits
from pneumarm.task.movements import Movements
from pneumarm.transitions.fill_times import find_fill_times
from pneumarm.transitions.window import Window

KIND = "pneumarm policy"
_LOOKAHEAD = 5  # seed of the noise in which it looks ahead
_WEIGHTS, _ARMS, _ORDER, _VALIDATION = 0, 1, 2, 3  # streams of random numbers
_FIRST_OUTPUT = 0.01  # the first policy chooses by its bonus for holding alone
_WIDER = 4.0  # times as wide the tolerances of several joints are when training begins ...
_CHEAPER = 0.2  # ... and this share of its price is what a switch costs,
_EASING = 0.08  # until both are what they are, at this share of the training
_VALUE_RATE = 4e-3  # of a policy's training, whose values begin at random, too


@dataclass(frozen=True, repr=False)
class PolicyAgent(NetworkAgent):
    """A policy by state and goal, the simulation that it was trained in, and how it was trained."""

    kind = KIND
    settings_type = PolicySettings

    settings: PolicySettings

    @property
    def sizes(self) -> tuple[int, ...]:
        """Units of each layer of the policy, inputs first."""
        return policy_sizes(self.window, self.settings)

    def mind(self, begin: BeginStates | None = None) -> Mind:
        """Return what decides, for kernels; with ``begin`` states its simulated arms can begin episodes, too."""
        return mind(self.simulation, begin, self.settings, self.policy)

    def actor(self) -> PolicyActor:
        """Return the policy acting greedily; it does not learn while it moves an arm."""
        return PolicyActor(self.mind(), self.sizes, self.settings, self.simulation)

    def adapted(
        self, simulation: Simulation, begin: BeginStates, updates: int, warm_up: int, learning_rate: float, seed: int
    ) -> Self:
        """Return the policy after learning in ``simulation``; only the values of states learn while it warms up."""
        tuned = replace(self.settings, updates=warm_up + updates, learning_rate=learning_rate)
        policy = tuned_policy(self.policy, simulation, begin, tuned, seed, warm_up)
        return self.revised(simulation, policy)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let the policy move greedily in ``simulation``, without lookahead."""
        decider = mind(simulation, begin, self.settings, self.policy)
        return run_policy(decider, self.sizes, episodes, seed)

    def test_ahead(
        self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]
    ) -> Movements | None:
        """Let it move in ``simulation`` as on an arm, looking ahead; None where its settings have no lookahead.

        A decision takes a hundred times as long as in :meth:`test`, whose first movements these are.
        """
        if self.settings.lookahead == 0:
            return None
        return test_acting(self.actor(), environment(simulation, begin, self.settings), episodes, seed)


def policy_sizes(window: Window, settings: PolicySettings) -> tuple[int, ...]:
    """Return the units of each layer of a policy, inputs first."""
    return (policy_input_size(window, settings.squash), *settings.hidden, ACTIONS * window.joints)


def mind(
    simulation: Simulation, begin: BeginStates | None, settings: PolicySettings, policy: NDArray[np.float32]
) -> Mind:
    """Return what decides by the weights ``policy``; changes of them take effect at once."""
    window, scaling = simulation.window, simulation.scaling
    nowhere = BeginStates(window, np.zeros((0, window.state_size), np.float32), np.zeros((0, window.joints)))
    return Mind(
        environment=environment(simulation, begin or nowhere, settings),
        limits=limits(simulation, settings.reward.angle_tolerance, settings.still, settings.patience),
        inputs=input_parameters(
            window, scaling, tuple(error * simulation.spec.angle_unit for error in settings.squash)
        ),
        layers=split(policy, policy_sizes(window, settings)),
        hold=float(settings.hold),
        seeds=random_states(_LOOKAHEAD, max(settings.lookahead, 1)),
    )


def train_policy(
    simulation: Simulation, begin_states: BeginStates, settings: PolicySettings, seed: int = 0, **how: Any
) -> Training[PolicyAgent]:
    """Train policies and return the best; ``how`` as of :func:`~pneumarm.learning.fleet.train_fleet`."""
    settings = scaled_for_joints(with_longer_cutoff(settings, simulation), simulation)
    return train_fleet(lambda n: PolicyLearner(simulation, begin_states, settings, seed, n), settings, seed, **how)


def with_longer_cutoff(settings: PolicySettings, simulation: Simulation) -> PolicySettings:
    """Return ``settings`` with as many actions until a movement is cut off as this arm may need.

    Valves can be so small that the joint is still on its way after 100 actions; how slow muscles are is found by
    filling and emptying those of the simulation.
    """
    if settings.fillings == 0:
        return settings
    with guarded(SimulationArm(simulation)) as arm:
        longest = settings.fillings * sum(find_fill_times(arm))
    return replace(settings, cutoff=max(settings.cutoff, round(longest / simulation.spec.period)))


def scaled_for_joints(settings: PolicySettings, simulation: Simulation) -> PolicySettings:
    """Return ``settings`` with as many updates, and as little noise, as suit the joints of this arm."""
    joints = simulation.spec.joints
    if joints == 1:
        return settings
    noise = replace(settings.noise, factor=settings.noise.factor * settings.noise_share)
    return replace(settings, updates=settings.updates * settings.practice ** (joints - 1), noise=noise)


class PolicyLearner(FleetLearner[PolicyAgent, PolicySettings]):
    """A policy and the value of states under it, with the arms in which they are learned.

    With several joints all have to be near their goals and slow at once, which a policy that knows nothing hardly
    ever is. So its training begins with wider tolerances and cheap switches.
    """

    networks = ("policy", "value")
    easing = _EASING
    """Share of the training in which goals are easier; 0 for none."""

    def __init__(
        self, simulation: Simulation, begin_states: BeginStates, settings: PolicySettings, seed: int, number: int
    ) -> None:
        window = simulation.window
        random = np.random.default_rng([seed, _WEIGHTS, number])
        self.sizes = policy_sizes(window, settings)
        value_sizes = (*self.sizes[:-1], 1)
        weights = initial_weights(self.sizes, _FIRST_OUTPUT, random)
        mask = np.ones_like(weights)
        leave_out(simulation.spec, weights, mask, self.sizes)
        self.policy = trainable(weights, self.sizes, settings.arms, mask)
        self.value = trainable(initial_weights(value_sizes, 1.0, random), value_sizes, settings.arms)
        self.mind = mind(simulation, begin_states, settings, self.policy.flat)
        arms = fleet(self.mind.environment, random_states((seed, _ARMS, number), settings.arms))
        begin_all(self.mind.environment, arms)
        super().__init__(settings, self.mind.environment, arms, random_state((seed, _ORDER, number)))
        self._batch = batch(settings.steps, self.sizes[0], window.joints, settings.arms)
        self._rule = rule(settings)
        self._simulation, self._seed = simulation, seed

    def update(self) -> tuple[int, int, float]:
        """Act for a batch of steps and learn from them."""
        now, counts, (_, limits, inputs) = self._rule, self.counts, self.mind[:3]
        world = self._eased()
        seen: tuple[int, int, float] = collect_batch(world, limits, inputs, now, self.policy, self.fleet, self._batch)
        counts[1] = improve_policy(now, self.policy, self.value, self._batch, self.rates(), counts[1], self.random)
        return seen

    def _eased(self) -> Environment:
        """Return the environment with goals as easy to reach as they are now."""
        left = 1 - self.share / self.easing if self.easing and self._simulation.window.joints > 1 else 0.0
        if left <= 0:
            return self.environment
        task = self.environment.task
        wider, cheaper = 1 + (_WIDER - 1) * left, 1 - (1 - _CHEAPER) * left
        reward = task.reward._replace(
            switch=task.reward.switch * cheaper,
            angle_tolerance=task.reward.angle_tolerance * wider,
            velocity_tolerance=task.reward.velocity_tolerance * wider,
        )
        return self.environment._replace(task=task._replace(reward=reward))

    def rates(self) -> tuple[float, float]:
        """Return the learning rates of policy and values."""
        rate = self.settings.learning_rate * (1 - self.counts[0] / self.settings.updates)
        return rate, rate

    def agent(self) -> PolicyAgent:
        """Return the agent as it is now."""
        return PolicyAgent(self._simulation, self.policy.flat.copy(), self.settings)

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


class _Tuner(PolicyLearner):
    """A policy that is kept as it is until the values of states are known."""

    easing = 0.0

    def __init__(
        self, simulation: Simulation, begin: BeginStates, settings: PolicySettings, seed: int, warm_up: int
    ) -> None:
        super().__init__(simulation, begin, settings, seed, 0)
        self._warm_up = warm_up

    def rates(self) -> tuple[float, float]:
        """Return the learning rates of policy and values."""
        done, updates = int(self.counts[0]), self.settings.updates
        left = 1 - max(done - self._warm_up, 0) / (updates - self._warm_up)
        return (self.settings.learning_rate * left if done >= self._warm_up else 0.0), _VALUE_RATE * left


def tuned_policy(
    policy: NDArray[np.float32],
    simulation: Simulation,
    begin: BeginStates,
    settings: PolicySettings,
    seed: int,
    warm_up: int,
) -> NDArray[np.float32]:
    """Return the weights ``policy`` after learning in ``simulation``, or as they were where those are better."""
    learner = _Tuner(simulation, begin, settings, seed, warm_up)
    learner.policy.flat[:] = policy
    before = learner.validate(settings.validation_episodes).reward.mean()
    learner.learn(settings.updates)
    after = learner.validate(settings.validation_episodes).reward.mean()
    return learner.policy.flat if after > before else policy
