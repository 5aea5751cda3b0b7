"""Movements after adapting, and typical ones of a given displacement."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ControlCycle, Reading, guarded
from pneumarm.control.agent import AgentController
from pneumarm.control.movement import BEGIN, move
from pneumarm.control.turns import player
from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.means import (
    series,
)
from pneumarm.experiments.moving import MOVEMENTS, OnTheArm, agent_of, draws, new_arm
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.words import words_of
from pneumarm.learning import Agent

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
_TYPICAL = 4  # stream of random numbers
_TRIES = 200  # begin states until one allows the displacement
AFTER = 0.8  # s that are recorded after the goal is reached
_FEW = 5  # switches; few movements use more (thesis figure 5.16)
SERIES = ("time", "angle", "pressure 1", "pressure 2", "valve 1", "valve 2")


@dataclass(frozen=True)
class DisplacementSizes:
    """How much is moved in a row."""

    adapting: int = 1000
    """Movements while the agent adapts."""
    shown: int = 300
    """Movements after that, which are looked at."""
    typical: int = 10
    """Movements of each typical displacement."""
    degrees: tuple[float, float, float] = (5.0, 30.0, 60.0)
    """Typical displacements [degrees]: small, middle, large (thesis figures 5.18, 5.17, 5.19: 5, 30, 70)."""
    learning_rate: float = 0.10
    """On the arm (thesis: 0.10)."""


@dataclass(frozen=True)
class TypicalMovement:
    """A movement of a given displacement: all that was read, also after its end."""

    time: Array
    """Shape (n,) [s]."""
    angle: Array
    """Shape (n, joints) [counts]."""
    pressure: Array
    """Shape (n, joints, 2) [counts]."""
    valves: Array
    """Shape (n, joints, 2)."""
    goal: Array
    """Shape (joints,) [counts]."""
    end: float | None
    """When the goal was reached [s], or None."""

    @property
    def beyond(self) -> float:
        """How far the first joint went out of the way between begin and goal until the end [counts]."""
        until = self.time <= (np.inf if self.end is None else self.end)
        angle = self.angle[until, 0]
        low, high = sorted((self.angle[0, 0], self.goal[0]))
        return float(max(0.0, low - angle.min(), angle.max() - high))

    @property
    def ringing(self) -> float:
        """How far it is from the goal at most after it was reached [counts]; NaN where it was not."""
        if self.end is None:
            return float("nan")
        return float(np.abs(self.angle[self.time >= self.end, 0] - self.goal[0]).max())


@dataclass(frozen=True)
class Displacement(OnTheArm):
    """What movements look like, short and long."""

    name = "displacement"
    words = words_of(__package__)
    sizes: DisplacementSizes = DisplacementSizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """The one agent."""
        return {1: f"learning rate {self.sizes.learning_rate:g}"}

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Adapt, move, and make the typical movements."""
        sizes, seed = self.sizes, run_seed(settings, run)
        agent = agent_of(material, self.agent, run, settings)
        with new_arm(material, run, settings) as arm:
            learner = player(agent, arm, sizes.learning_rate, self.agent.exploration, seed)
            learner.play(*draws(agent, seed, sizes.adapting, MOVEMENTS))
            made = learner.play(*draws(agent, seed, sizes.shown, MOVEMENTS, sizes.adapting))
            typical = [_typical(learner.learned, arm, one, sizes.typical, seed) for one in sizes.degrees]
        distance = made.distance[:, 0]
        won, switches = made.success, made.switches.sum(axis=1)
        found = {
            **relations(distance[won], made.actions[won], switches[won]),
            **thirds(distance, made.actions, switches, won),
            **series("distance", distance[won]),
            **series("actions", made.actions[won]),
            **series("switches", switches[won]),
        }
        for figures in typical:
            found |= figures
        return found

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return those while adapting and after it, and the typical ones."""
        sizes = self.sizes
        return sizes.adapting + sizes.shown + sizes.typical * len(sizes.degrees)


def relations(distance: Array, actions: Counts, switches: Counts) -> dict[str, float]:
    """Return correlations with the displacement, and the share of movements with few switches."""
    found = {"few switches": float((switches <= _FEW).mean())} if len(switches) else {}
    for name, counts in (("actions", actions), ("switches", switches)):
        if len(distance) > 1 and distance.std() > 0 and counts.std() > 0:
            found[f"correlation of {name}"] = float(np.corrcoef(distance, counts)[0, 1])
    return found


def thirds(distance: Array, actions: Counts, switches: Counts, won: NDArray[np.bool_]) -> dict[str, float]:
    """Return means of the third of the movements with the shortest and the longest displacements."""
    third, two_thirds = np.percentile(distance, (100 / 3, 200 / 3))
    found = {}
    for name, members in (("short", distance <= third), ("long", distance >= two_thirds)):
        found[f"success, {name}"] = float(won[members].mean())
        if (members & won).any():
            these = actions[members & won], switches[members & won]
            found |= {f"actions, {name}": float(these[0].mean()), f"switches, {name}": float(these[1].mean())}
            found[f"ratio, {name}"] = float(these[1].sum() / these[0].sum())
    return found


def typical_movement(agent: Agent, arm: Arm, degrees: float, random: np.random.Generator) -> TypicalMovement | None:
    """Let ``agent`` move greedily by ``degrees`` from a random begin state; None where none allows that.

    The direction is the one in which there is more workspace. All joints move alike.
    """
    cycle = ControlCycle(guarded(arm))
    step = degrees * arm.spec.counts_per_degree
    low, high = agent.goal_range.T
    for _ in range(_TRIES):
        BEGIN.reach(cycle.arm, random)
        angle = arm.read().angle
        goal = np.where(angle - low > high - angle, angle - step, angle + step)
        if ((goal >= low) & (goal <= high)).all():
            break
    else:
        return None
    made = move(cycle, AgentController(agent), goal, agent.settings)
    recorded = made.recorded
    turns = len(recorded.angle)
    after: list[Reading] = []
    while not after or after[-1].time < made.time_end + AFTER:
        arm.wait(arm.spec.period)
        after.append(arm.read())
    still = np.zeros((len(after) + 1, *recorded.pressure.shape[1:]))
    return TypicalMovement(
        time=np.concatenate([recorded.time, [reading.time for reading in after]]) - made.time_start,
        angle=np.concatenate([recorded.angle, [reading.angle for reading in after]]),
        pressure=np.concatenate([recorded.pressure, [reading.pressure for reading in after]]),
        valves=np.concatenate([np.asarray(recorded.command, np.float64)[: turns - 1], still]),
        goal=goal,
        end=made.time_end - made.time_start if made.success else None,
    )


def _typical(agent: Agent, arm: Arm, degrees: float, count: int, seed: int) -> dict[str, float]:
    """Return what movements by ``degrees`` have in common, and the first of them."""
    random = np.random.default_rng([seed, _TYPICAL, round(degrees)])
    made = [one for _ in range(count) if (one := typical_movement(agent, arm, degrees, random)) is not None]
    if not made:
        return {}
    per = arm.spec.counts_per_degree
    name = f"{degrees:g}°: "
    reached = [one for one in made if one.end is not None]
    found = {
        name + "success": len(reached) / len(made),
        name + "out of the way": float(np.mean([one.beyond for one in made])) / per,
    }
    if reached:
        found[name + "ringing"] = float(np.mean([one.ringing for one in reached])) / per
        found[name + "seconds"] = float(np.mean([one.end for one in reached]))
    first = made[0]
    columns = [first.time, first.angle[:, 0], *first.pressure[:, 0].T, *first.valves[:, 0].T]
    for label, column in zip(SERIES, columns, strict=True):
        found |= series(name + label, column)
    return {**found, name + "goal": float(first.goal[0]), **({} if first.end is None else {name + "end": first.end})}
