"""What a user can choose about learning the thesis' networks in many simulated arms at once."""

from dataclasses import dataclass, field
from typing import Annotated

from pneumarm.learning.fleet import FleetSettings
from pneumarm.learning.online.settings import Exploration, TrainSettings
from pneumarm.settings import PythonOnly, Units


@dataclass(frozen=True)
class BatchedExploration(Exploration):
    """Exploration while little is learned."""

    epsilon: float = 0.5
    """Probability of an exploring action (thesis: 0.5 at the start of shaping)."""
    temperature: float = 10.0
    """Temperature T of its Boltzmann distribution, in units of reward (thesis: 20 at the start of shaping)."""


@dataclass(frozen=True)
class BatchedSettings(FleetSettings):
    """The thesis' nine networks a joint, learned in many simulated arms at once by Q(lambda) and Adam."""

    updates: int = 400
    """How often experience is collected and learned from."""
    arms: int = 256
    """Simulated arms that move at once."""
    steps: int = 16
    """Steps of each arm in a batch of experience."""
    learning_rate: float = 5e-3
    """Of Adam at the start; falls linearly to 0."""
    epochs: int = 3
    """How often each batch is learned from."""
    discount: float = 0.98
    """gamma (thesis: 0.98)."""
    trace_decay: float = 0.8
    """lambda (thesis: 0)."""
    largest_gradient: Annotated[float, PythonOnly] = 1.0
    """Longer gradients are cut to this length."""
    hidden: Units = 10
    """Hidden units of each network (thesis: 5)."""
    first_exploration: Annotated[BatchedExploration, PythonOnly] = field(default_factory=BatchedExploration)
    """At the start; goes linearly to the last."""
    last_exploration: Annotated[Exploration, PythonOnly] = field(default_factory=Exploration)
    """At the end, and when going on to learn on an arm."""

    @property
    def online(self) -> TrainSettings:
        """The settings with which the agent is used and goes on learning, step by step."""
        return TrainSettings(
            method="q-learning",
            hidden=self.hidden,
            discount=self.discount,
            cutoff=self.cutoff,
            agents=self.agents,
            return_scale=self.return_scale,
            validation_episodes=self.validation_episodes,
            reward=self.reward,
            exploration=self.last_exploration,
            shaping=None,
            noise=self.noise,
        )
