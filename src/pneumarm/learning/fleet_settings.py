"""What a user can choose about the learners that work in many simulated arms at once."""

import math
from dataclasses import dataclass, field

from pneumarm.learning.online.settings import Exploration, TrainSettings
from pneumarm.settings import Valid
from pneumarm.task.settings import TaskSettings


@dataclass(frozen=True)
class FleetSettings(TaskSettings):
    """What learning in many simulated arms at once needs, whatever is learned."""

    agents: int = 2
    """Agents trained at once from different weights, of which the best is kept; one a core takes no longer."""
    updates: int = 90
    """How often experience is collected and learned from."""
    arms: int = 128
    """Simulated arms that move at once."""
    steps: int = 64
    """Steps of each arm in a batch of experience."""
    learning_rate: float = 4e-3
    """Of Adam at the start; falls linearly to 0."""
    epochs: int = 6
    """How often each batch is learned from."""
    discount: float = 0.99
    """gamma (thesis: 0.98)."""
    trace_decay: float = 0.95
    """lambda (thesis: 0)."""
    largest_gradient: float = 0.5
    """Longer gradients are cut to this length."""
    return_scale: float = 50.0
    """Return that a network's output of 1 stands for."""
    validation_episodes: int = 2_000
    """Greedy episodes, without lookahead, on which the best agent is chosen."""

    def _valid(self) -> Valid:
        return {
            "agents": 1 <= self.agents <= 256,
            "updates": self.updates >= 1,
            "arms": 1 <= self.arms <= 65_536,
            "steps": 1 <= self.steps <= 4096,
            "learning_rate": 0 < self.learning_rate < math.inf,
            "epochs": self.epochs >= 1,
            "discount": 0 <= self.discount <= 1,
            "trace_decay": 0 <= self.trace_decay <= 1,
            "largest_gradient": 0 < self.largest_gradient < math.inf,
            "return_scale": 0 < self.return_scale < math.inf,
            "validation_episodes": self.validation_episodes >= 1,
        }


@dataclass(frozen=True)
class PolicySettings(FleetSettings):
    """A policy, improved by proximal policy optimisation, and how it acts on the arm."""

    hidden: tuple[int, ...] = (32, 32)
    """Hidden units of each layer, of the policy and of the state's value alike."""
    clip: float = 0.2
    """How much more or less probable an action may become by one batch."""
    entropy: float = 0.01
    """Price of being certain, in standard deviations of the advantage."""
    hold: float = 3.0
    """Bonus, on its logit, of the action that is being held: a first guess at what switches cost."""
    squash: tuple[float, ...] = (25.0, 100.0)
    """Errors of the angle at which the inputs that tell them bend, finely and coarsely [counts]."""
    still: float = 2.5
    """Changes of angle and pressures up to this count as none [counts]."""
    patience: int = 2
    """Steps without change, off the goal, after which another action must be taken; 0: never."""
    lookahead: int = 192
    """Simulated movements by which a decision that is not clear is made on the arm; 0: as the policy says."""
    horizon: int = 25
    """Longest of these movements [steps]."""
    clear: float = 0.001
    """Actions less probable than this are not looked at; where only one is left the decision is clear."""

    def _valid(self) -> Valid:
        return {
            "hidden": 1 <= len(self.hidden) <= 8 and all(1 <= size <= 1024 for size in self.hidden),
            "clip": 0 < self.clip < 1,
            "entropy": 0 <= self.entropy < math.inf,
            "hold": math.isfinite(self.hold),
            "squash": len(self.squash) <= 16 and all(0 < error < math.inf for error in self.squash),
            "still": 0 <= self.still < math.inf,
            "patience": self.patience >= 0,
            "lookahead": 0 <= self.lookahead <= 65_536,
            "horizon": self.horizon >= 1,
            "clear": 0 <= self.clear < 1,
        }


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
    largest_gradient: float = 1.0
    """Longer gradients are cut to this length."""
    hidden: int = 10
    """Hidden units of each network (thesis: 5)."""
    first_exploration: BatchedExploration = field(default_factory=BatchedExploration)
    """At the start; goes linearly to the last."""
    last_exploration: Exploration = field(default_factory=Exploration)
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

    def _valid(self) -> Valid:
        return {"hidden": 1 <= self.hidden <= 1024}
