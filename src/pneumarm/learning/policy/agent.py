"""A trained policy and its file, which holds all it needs to act: the policy, and the simulation to look ahead in."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.policy.acting import Mind
from pneumarm.learning.policy.actor import PolicyActor
from pneumarm.learning.policy.inputs import input_parameters, input_size
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.learning.policy.testing import run_policy
from pneumarm.networks.layers import split
from pneumarm.random import random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.acting import test_acting
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.fleet import limits
from pneumarm.task.movements import Movements
from pneumarm.transitions.window import Window

KIND = "pneumarm policy"
_LOOKAHEAD = 5  # seed of the noise in which it looks ahead


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
        from pneumarm.learning.policy.training import tuned_policy  # which imports this module

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
    return (input_size(window, settings.squash), *settings.hidden, ACTIONS * window.joints)


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
