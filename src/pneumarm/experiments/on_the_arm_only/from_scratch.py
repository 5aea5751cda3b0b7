"""Learning on the arm from scratch, and beside it an agent that learned in the simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pneumarm.arm import Arm
from pneumarm.control.movement import BEGIN
from pneumarm.control.turns import player
from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.means import (
    series,
)
from pneumarm.experiments.moving import (
    MOVEMENTS,
    THESIS,
    OnTheArm,
    agent_of,
    clock,
    draws,
    greedy_test,
    means,
    new_arm,
)
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.words import words_of
from pneumarm.learning import Agent, TrainSettings
from pneumarm.learning.online.shaping import adjusted, initial_deviation, stage
from pneumarm.learning.online.values import draw_networks
from pneumarm.simulation.simulation import Scaling
from pneumarm.transitions.window import Window

ON_ARM, IN_SIMULATION = 1, 2
ONE = replace(THESIS, agents=1)
"""Trial 10 of table 5.3, a single agent: on an arm one cannot choose the best of eight."""
_LOOKS = 3  # stream of random numbers
_MIDDLE = 0.8  # share of the range of angles in which goals are
_FAST = 5.0  # counts/ms, that velocities are scaled by
_CHUNK = 500  # movements between two points of the course, where there is no shaping


@dataclass(frozen=True)
class FromScratchSizes:
    """How much is moved in a row."""

    looks: int = 200
    """Begin states that are visited before learning."""
    test: int = 300
    """Greedy movements after learning."""


@dataclass(frozen=True)
class Learned:
    """An agent that learned on the arm, and what it took."""

    agent: Agent
    met: bool
    movements: int
    steps: int
    seconds: float
    """On the arm's clock."""
    course: tuple[tuple[float, float, float], ...]
    """Hours, deviation [counts] and performance after every adjustment of the deviation."""


@dataclass(frozen=True)
class OnTheArmOnly(OnTheArm):
    """Learning from scratch on the arm."""

    name = "on-the-arm-only"
    words = words_of(__package__)
    runs = 1
    agent: TrainSettings = ONE
    sizes: FromScratchSizes = FromScratchSizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """Where the agent learned."""
        return {ON_ARM: "learned on the arm", IN_SIMULATION: "learned in the simulation"}

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Learn, and move greedily on the arm in another morning."""
        if trial == IN_SIMULATION:
            agent = agent_of(material, self.agent, run, settings)
            with new_arm(material, run, settings) as arm:
                goals = untrained_agent(arm, self.agent, self.sizes.looks, run_seed(settings, run)).goal_range
            same = replace(agent, goal_range=goals)  # it has learned goals in a wider range
            made = greedy_test(material, same, self.sizes.test, run, settings)
            return {**means(made), "hours": settings.transitions * agent.spec.period / 3600}
        most = settings.max_episodes or self.agent.max_episodes
        chosen, seed = replace(self.agent, max_episodes=most), run_seed(settings, run)
        with new_arm(material, run, settings) as arm:
            began = clock(arm)
            found = learn_on(arm, untrained_agent(arm, chosen, self.sizes.looks, seed), seed, began)
        tested = greedy_test(material, found.agent, self.sizes.test, run, settings)
        hours, deviation, performance = zip(*found.course, strict=True)
        return {
            **means(tested),
            "hours": found.seconds / 3600,
            "movements": float(found.movements),
            "steps": float(found.steps),
            "seconds of a movement": found.seconds / found.movements,
            "met": float(found.met),
            **series("hours so far", hours),
            **series("deviation", deviation),
            **series("performance", performance),
        }

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return the looks, the test, and all that learning on the arm may take."""
        most = settings.max_episodes or self.agent.max_episodes
        return self.sizes.looks + self.sizes.test + (most if trial == ON_ARM else 0)


def untrained_agent(arm: Arm, settings: TrainSettings, looks: int, seed: int) -> Agent:
    """Return an agent for ``arm`` that has learned nothing, after visiting ``looks`` begin states.

    Its goals are the middle of the range between the angles at rest with one muscle inflated and the other vented.
    """
    window, spec = Window(arm.spec.joints), arm.spec
    random = np.random.default_rng([seed, _LOOKS])
    networks = draw_networks(window, settings, random, spec.muscles)
    nothing = Scaling(np.zeros(4 * spec.joints), np.ones(4 * spec.joints), np.ones(2 * spec.joints))
    blank = Agent(spec, window, nothing, np.tile(spec.angle_range, (spec.joints, 1)), networks, settings)
    durations = random.uniform(0.0, BEGIN.inflate, (looks, spec.joints, 2))
    looking = player(blank, arm)
    angle, pressure = looking.visit(durations)
    one_side = np.tile([[BEGIN.inflate, 0.0], [0.0, BEGIN.inflate]], (spec.joints, 1, 1)).transpose(1, 0, 2)
    ends, _ = looking.visit(one_side)
    low, high = ends.min(axis=0), ends.max(axis=0)
    margin = (high - low) * (1 - _MIDDLE) / 2
    seen = np.stack([angle, np.zeros_like(angle), pressure[..., 0], pressure[..., 1]], axis=-1)
    spread = 2 * seen.std(axis=0)
    spread[:, 1] = _FAST
    scaling = Scaling(seen.mean(axis=0).ravel(), np.maximum(spread, 1.0).ravel(), nothing.command_scale)
    return replace(blank, scaling=scaling, goal_range=np.stack([low + margin, high - margin], axis=1))


def learn_on(arm: Arm, agent: Agent, seed: int, began: float = 0.0) -> Learned:
    """Let ``agent`` learn on ``arm`` until it meets the criterion of its settings, or for their ``max_episodes``.

    ``began`` is when the arm's clock began to count for it [s].
    """
    settings, spec = agent.settings, arm.spec
    learner = player(agent, arm, settings.learning_rate, settings.exploration, seed)
    deviation, made, steps, met = initial_deviation(settings, spec), 0, 0, False
    course: list[tuple[float, float, float]] = []
    while not met and made < settings.max_episodes:
        now = stage(deviation, settings, spec)
        chunk = min(settings.shaping.episodes if settings.shaping else _CHUNK, settings.max_episodes - made)
        played = learner.play(*draws(agent, seed, chunk, MOVEMENTS, made), now.schedule)
        made += played.n
        steps += int(played.actions.sum())
        met = now.whole and learner.performance >= now.criterion
        course.append(((learner.time - began) / 3600, deviation, learner.performance))
        deviation = adjusted(deviation, learner.performance, settings, spec)
    return Learned(learner.learned, met, made, steps, learner.time - began, tuple(course))
