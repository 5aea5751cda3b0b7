"""What a user can choose about learning; the defaults are the thesis' (section 5.4.2)."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from pneumarm.errors import UnusableInput
from pneumarm.settings import (
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    PythonOnly,
    Settings,
    Share,
    Units,
    Valid,
)
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.reference import counts_of
from pneumarm.task.settings import TaskSettings
from pneumarm.transitions.goals import Goals

Method = Literal["sarsa", "q-learning"]
Team = Literal["common", "own", "one"]


@dataclass(frozen=True)
class Exploration(Settings):
    """Max-Boltzmann exploration with the greedy action disabled (section 4.2.2)."""

    epsilon: Share = 0.05
    """Probability of an exploring action (thesis: 0.05 at the end of shaping)."""
    temperature: PositiveFloat = 1.0
    """Temperature T of its Boltzmann distribution, in units of reward (thesis: 1 at the end of shaping)."""


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

    initial_deviation: PositiveFloat = 5.0
    """Deviation that training begins with [degrees] (thesis: a few degrees)."""
    episodes: PositiveInt = 500
    """Episodes between two adjustments of the deviation (thesis: 500)."""
    grow: PositiveFloat = 0.10
    """Relative growth of the deviation when the performance exceeds the criterion (thesis: 10 %)."""
    shrink: Annotated[float, Meta(ge=0, lt=1)] = 0.03
    """Relative loss of the deviation when it does not (thesis: 3 %)."""
    performance_rate: Annotated[float, Meta(gt=0, le=1)] = 0.002
    """Weight of the newest episode in the performance (thesis eq. 4.14: 0.002)."""
    initial_criterion: Share = 0.5
    """Success rate demanded at the initial deviation (thesis: 50 %)."""
    criterion: Share = 0.95
    """Success rate demanded at the whole range of angles (thesis: 95 %)."""
    exploration: FirstExploration = field(default_factory=FirstExploration)
    """Exploration at the initial deviation (thesis: 0.5 and 20)."""
    weights: Annotated[tuple[NonNegativeFloat, ...], Meta(min_length=1)] = (0.4, 0.3, 0.2, 0.1)
    """Weights of the sub-intervals of begin states on each side of the goal, the farthest first (thesis: these)."""
    sides: Literal["place", "length"] = "place"
    """Whether a side is drawn by the goal's place in the range of angles (thesis: eq. 4.16), or by its own length, as
    the deviation leaves it (table 4.1)."""
    each: bool = False
    """Whether each joint has a deviation of its own, by how often it is at its goal in the end (section 6.1.3)."""

    def _valid(self) -> Valid:
        return {"weights": sum(self.weights) > 0 or "one above 0"}


@dataclass(frozen=True)
class Help(Settings):
    """What may help in training besides shaping (sections 4.2.2, 4.2.3, 4.3.3); the thesis used none of it."""

    stray: NonNegativeFloat = 0.0
    """Deviations from its goal at which an episode that strays is cut off, more than 1; 0: never."""
    local: float = 0.0
    """Paid to a joint for each degree that an action brings it nearer to its goal, and taken for each farther."""
    retry: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    """Probability that after a failure the same goal and begin state are tried again."""
    by_position: bool = False
    """Whether it explores within the deviation as at the end of training, and as shaping has it only farther away, in
    full at twice the deviation; for off-policy methods (section 4.3.3)."""
    halving: NonNegativeInt = 0
    """Episodes in which the learning rate falls to a half, as 1/k does; 0: it stays (thesis)."""

    def _valid(self) -> Valid:
        return {"stray": self.stray == 0 or self.stray > 1 or "0 or more than 1"}


@dataclass(frozen=True)
class TrainSettings(TaskSettings):
    """Everything that decides a training phase, besides the simulation, the begin states and the seed."""

    method: Annotated[Method, PythonOnly] = "sarsa"
    """Which action value is the target: the next one taken (eq. 4.9) or the highest (eq. 4.10) (thesis: SARSA)."""
    team: Team = "common"
    """Who acts for several joints: an agent a joint, each paid when all are at their goals (common) or when its own
    joint is (own), or one agent with a network for each combination of actions (one) (thesis 6.1.2: common)."""
    learning_rate: NonNegativeFloat = 0.05
    """beta (thesis: 0.05)."""
    hidden: Units = 5
    """Hidden units of each of the nine networks of a joint (thesis: 5)."""
    trace_decay: Share = 0.0
    """lambda of the eligibility traces (thesis: 0)."""
    discount: Share = 0.98
    """gamma (thesis: 0.98)."""
    agents: Annotated[int, Meta(ge=1, le=4096)] = 16
    """Agents trained at once from different weights, of which the best is kept (section 5.4.2: they decide most)."""
    initial_weight: Annotated[PositiveFloat, PythonOnly] = 0.3
    """Initial weights are uniform between this and its negative (thesis: 0.3)."""
    return_scale: Annotated[PositiveFloat, PythonOnly] = 50.0
    """Return that a network's output of 1 stands for (thesis: outputs are normalised; returns are about -50..50)."""
    max_episodes: PositiveInt = 50_000
    """Episodes after which training ends although the criterion is not met (thesis: the longest is 50,000)."""
    stops: bool = True
    """Whether training ends when the criterion is met; otherwise at ``max_episodes`` (thesis: yes; not in 5.4.3)."""
    validation_episodes: PositiveInt = 2_000
    """Greedy episodes on which the best agent is chosen."""
    exploration: Exploration = field(default_factory=Exploration)
    """Exploration at the end of shaping, or all the time without shaping."""
    shaping: Annotated[Shaping | None, PythonOnly] = field(default_factory=Shaping)
    """Shaping, or None: then all begin states from the first episode on."""

    help: Help = field(default_factory=Help)
    """What may help besides."""
    goal: tuple[float, ...] = ()
    """The only goal to learn, an angle a joint [degrees]; by default all goals (thesis 5.4.1 and 6.1.4: one)."""

    def goals_in(self, simulation: Simulation) -> Goals:
        """Return the goals to learn."""
        if not self.goal:
            return simulation.goals
        if len(self.goal) != simulation.window.joints:
            raise UnusableInput(f"goal: expected {simulation.window.joints} angle(s) in degrees, got {self.goal}")
        only = counts_of(self.goal, simulation.spec)
        low, high = simulation.goal_range.T
        if not ((low <= only) & (only <= high)).all():
            within = ", ".join(f"{a:.0f} to {b:.0f}" for a, b in simulation.spec.degrees(simulation.goal_range))
            raise UnusableInput(f"goal: expected angles within {within} degrees, got {self.goal}")
        return Goals.of(np.stack([only, only], axis=1))

    @property
    def by_length(self) -> bool:
        """Whether sides are drawn by their length, see :class:`Shaping`."""
        return self.shaping is not None and self.shaping.sides == "length"

    @property
    def begin_weights(self) -> tuple[float, ...]:
        """Weights of the sub-intervals of begin states, see :class:`Shaping`."""
        return self.shaping.weights if self.shaping else (1.0,)
