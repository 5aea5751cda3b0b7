"""What a user can choose about learning; the defaults are the thesis' (section 5.4.2)."""

import math
from dataclasses import dataclass, field
from typing import Literal

from pneumarm.settings import Settings, Valid
from pneumarm.task.settings import TaskSettings

Method = Literal["sarsa", "q-learning"]
Team = Literal["common", "own", "one"]


@dataclass(frozen=True)
class Exploration(Settings):
    """Max-Boltzmann exploration with the greedy action disabled (section 4.2.2)."""

    epsilon: float = 0.05
    """Probability of an exploring action (thesis: 0.05 at the end of shaping)."""
    temperature: float = 1.0
    """Temperature T of its Boltzmann distribution, in units of reward (thesis: 1 at the end of shaping)."""

    def _valid(self) -> Valid:
        return {"epsilon": 0 <= self.epsilon <= 1, "temperature": 0 < self.temperature < math.inf}


@dataclass(frozen=True)
class FirstExploration(Exploration):
    """Exploration at the initial deviation of shaping."""

    epsilon: float = 0.5
    """Probability of an exploring action (thesis: 0.5 at the start of shaping)."""
    temperature: float = 20.0
    """Temperature T of its Boltzmann distribution, in units of reward (thesis: 20 at the start of shaping)."""


@dataclass(frozen=True)
class Shaping(Settings):
    """From begin states next to the goal to all begin states (section 4.3.2)."""

    initial_deviation: float = 5.0
    """Deviation that training begins with [degrees] (thesis: a few degrees)."""
    episodes: int = 500
    """Episodes between two adjustments of the deviation (thesis: 500)."""
    grow: float = 0.10
    """Relative growth of the deviation when the performance exceeds the criterion (thesis: 10 %)."""
    shrink: float = 0.03
    """Relative loss of the deviation when it does not (thesis: 3 %)."""
    performance_rate: float = 0.002
    """Weight of the newest episode in the performance (thesis eq. 4.14: 0.002)."""
    initial_criterion: float = 0.5
    """Success rate demanded at the initial deviation (thesis: 50 %)."""
    criterion: float = 0.95
    """Success rate demanded at the whole range of angles (thesis: 95 %)."""
    exploration: FirstExploration = field(default_factory=FirstExploration)
    """Exploration at the initial deviation (thesis: 0.5 and 20)."""
    weights: tuple[float, ...] = (0.4, 0.3, 0.2, 0.1)
    """Weights of the sub-intervals of begin states on each side of the goal, the farthest first (thesis: these)."""

    def _valid(self) -> Valid:
        return {
            "initial_deviation": 0 < self.initial_deviation < math.inf,
            "episodes": self.episodes >= 1,
            "grow": 0 < self.grow < math.inf,
            "shrink": 0 <= self.shrink < 1,
            "performance_rate": 0 < self.performance_rate <= 1,
            "initial_criterion": 0 <= self.initial_criterion <= 1,
            "criterion": 0 <= self.criterion <= 1,
            "weights": len(self.weights) > 0 and min(self.weights) >= 0 and 0 < sum(self.weights) < math.inf,
        }


@dataclass(frozen=True)
class TrainSettings(TaskSettings):
    """Everything that decides a training phase, besides the simulation, the begin states and the seed."""

    method: Method = "sarsa"
    """Which action value is the target: the next one taken (eq. 4.9) or the highest (eq. 4.10) (thesis: SARSA)."""
    team: Team = "common"
    """Who acts for several joints: an agent a joint, each paid when all are at their goals (common) or when its own
    joint is (own), or one agent with a network for each combination of actions (one) (thesis 6.1.2: common)."""
    learning_rate: float = 0.05
    """beta (thesis: 0.05)."""
    hidden: int = 5
    """Hidden units of each of the nine networks of a joint (thesis: 5)."""
    trace_decay: float = 0.0
    """lambda of the eligibility traces (thesis: 0)."""
    discount: float = 0.98
    """gamma (thesis: 0.98)."""
    agents: int = 16
    """Agents trained at once from different weights, of which the best is kept (section 5.4.2: they decide most)."""
    initial_weight: float = 0.3
    """Initial weights are uniform between this and its negative (thesis: 0.3)."""
    return_scale: float = 50.0
    """Return that a network's output of 1 stands for (thesis: outputs are normalised; returns are about -50..50)."""
    max_episodes: int = 50_000
    """Episodes after which training ends although the criterion is not met (thesis: the longest is 50,000)."""
    stops: bool = True
    """Whether training ends when the criterion is met; otherwise at ``max_episodes`` (thesis: yes; not in 5.4.3)."""
    validation_episodes: int = 2_000
    """Greedy episodes on which the best agent is chosen."""
    exploration: Exploration = field(default_factory=Exploration)
    """Exploration at the end of shaping, or all the time without shaping."""
    shaping: Shaping | None = field(default_factory=Shaping)
    """Shaping, or None: then all begin states from the first episode on."""

    @property
    def begin_weights(self) -> tuple[float, ...]:
        """Weights of the sub-intervals of begin states, see :class:`Shaping`."""
        return self.shaping.weights if self.shaping else (1.0,)

    def _valid(self) -> Valid:
        return {
            "method": self.method in ("sarsa", "q-learning"),
            "team": self.team in ("common", "own", "one"),
            "learning_rate": 0 <= self.learning_rate < math.inf,
            "hidden": 1 <= self.hidden <= 1024,
            "trace_decay": 0 <= self.trace_decay <= 1,
            "discount": 0 <= self.discount <= 1,
            "agents": 1 <= self.agents <= 4096,
            "initial_weight": 0 < self.initial_weight < math.inf,
            "return_scale": 0 < self.return_scale < math.inf,
            "max_episodes": self.max_episodes >= 1,
            "validation_episodes": self.validation_episodes >= 1,
        }
