"""What can be achieved on a virtual arm at all: movements of planners, on the begin states and goals of a transfer.

Thesis section 5.5.1: "We do not know what an optimal controller can achieve." With the true physics it can be
computed, see :mod:`pneumarm.planning.planner`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm
from pneumarm.arm.virtual import VirtualArm, without_noise
from pneumarm.control.movement import drawn, make_movements
from pneumarm.errors import UnusableInput
from pneumarm.planning.planner import Planner, physics_planner, simulated_planner
from pneumarm.planning.search import PlanSettings
from pneumarm.settings import PositiveInt, Settings
from pneumarm.simulation.simulation import Simulation
from pneumarm.statistics import FEWEST, mean_estimate
from pneumarm.task import Reward, TaskSettings
from pneumarm.task.movements import Movements, of_rows
from pneumarm.transitions import FEWEST_TRANSITIONS, WHOLE_PERIODS, Store, collect
from pneumarm.transitions.goals import Goals

Baseline = Literal["open_loop", "closed_loop", "simulated"]
"""True physics planned once without noise, true physics planned every turn, learned simulation planned every turn."""
_RANGE = 2000 / 3
"""For how long an arm is recorded to measure the range of goals where no simulation tells it [s]."""


@dataclass(frozen=True)
class BoundSettings(Settings):
    """How the bound of an arm is measured."""

    episodes: PositiveInt = 500
    """Movements of each planner; at least 500 for figures to be compared."""
    plan: PlanSettings = field(default_factory=PlanSettings)
    """Which plans are considered."""


@dataclass(frozen=True)
class Planned:
    """Movements of a planner on an arm."""

    made: Movements
    seconds: NDArray[np.float64]
    """How long each decision took, shape (decisions,) [s]."""
    unproven: int
    """Plans of which it is not proven that none is better."""
    at_most: NDArray[np.float64] | None = None
    """Reward that no plan exceeds, of movements that are planned once, shape (n,)."""

    def results(self) -> dict[str, Any]:
        """Return the figures as of a transfer, with the times of a decision [ms]."""
        milliseconds = 1e3 * self.seconds
        times = {"median": float(np.median(milliseconds)), "p99": float(np.quantile(milliseconds, 0.99))}
        found = {**self.made.results(), "decision_ms": times, "unproven_plans": self.unproven}
        return found if self.at_most is None else found | {"at_most": float(self.at_most.mean())}

    def distance(self, reward: NDArray[np.float64]) -> dict[str, Any]:
        """Return how far another controller stays below, by its ``reward`` (n,) in the first of the same movements.

        ``reward`` is that distance, ``planned`` what the planner earns in those movements.

        The movements are paired, so that easy goals and hard ones do not blur the difference. Their goals are the
        same, and so are the begin states but for the arm's noise: 2.5 counts on arm 1 of the distribution.

        Raises:
            UnusableInput: there is no movement to compare.

        """
        n = min(len(reward), self.made.n)
        if n == 0:
            raise UnusableInput("a distance to the bound needs at least 1 movement, got none")
        lost = self.made.reward[:n] - reward[:n]
        estimate = mean_estimate(lost)
        return {
            "episodes": n,
            "planned": float(self.made.reward[:n].mean()),
            "reward": estimate.mean,
            "interval": [estimate.low, estimate.high] if n >= FEWEST else None,
        }


def measured_goal_range(arm: Arm, seed: int = 0) -> NDArray[np.float64]:
    """Return the range of goals (joints, 2) [counts] that a short collecting on ``arm`` finds."""
    with TemporaryDirectory() as folder, Store.for_arm(Path(folder) / "range.db", arm.spec) as store:
        transitions = max(round(_RANGE / arm.spec.period), FEWEST_TRANSITIONS)
        collect(arm, store, transitions, seed, settings=WHOLE_PERIODS)
        found: NDArray[np.float64] = store.percentiles()
    return found


def measure_bound(
    parameters_of: VirtualArm,
    goals: Goals | NDArray[np.float64],
    settings: BoundSettings = BoundSettings(),
    *,
    seed: int = 0,
    reward: Reward = Reward(),
    simulation: Simulation | None = None,
    baselines: Sequence[Baseline] = ("open_loop", "closed_loop"),
    progress: Callable[[float, float], None] | None = None,
) -> dict[Baseline, Planned]:
    """Return what the planners achieve on fresh arms like ``parameters_of``.

    Args:
        parameters_of: the arm whose parameters and control period are taken; it is not moved.
        goals: what is drawn from, or their range (joints, 2) [counts].
        settings: how many movements, and which plans.
        seed: of begin states, goals and noise; begin states and goals are those of a transfer with the same seed.
        reward: what is paid.
        simulation: of this arm, to plan with as well.
        baselines: of the true physics that are measured.
        progress: called with what is done and the total.

    """
    if simulation is not None:
        baselines = [*baselines, "simulated"]
    spec, total, results = parameters_of.spec, len(baselines) * settings.episodes, {}
    for number, baseline in enumerate(baselines):
        parameters = parameters_of.parameters
        if baseline == "open_loop":
            parameters = without_noise(parameters)
        spec = parameters_of.spec
        with VirtualArm(parameters, seed=seed, name=spec.name, period=spec.period, muscles=spec.muscles) as arm:
            if simulation is not None and baseline == "simulated":
                planner = simulated_planner(simulation, reward)
            else:
                planner = physics_planner(arm, reward, settings.plan, open_loop=baseline == "open_loop")

            def report(done: int, before: int = number * settings.episodes) -> None:
                if progress is not None:
                    progress(before + done, total)

            results[baseline] = _movements(arm, planner, goals, settings, seed, report)
    return results


def _movements(
    arm: Arm,
    planner: Planner,
    goals: Goals | NDArray[np.float64],
    settings: BoundSettings,
    seed: int,
    report: Callable[[int], None],
) -> Planned:
    task = TaskSettings(reward=planner.reward, cutoff=settings.plan.cutoff)
    planner.warm_up()
    rows, at_most = [], []
    for made in make_movements(arm, planner, task, drawn(goals, seed, range(settings.episodes))):
        rows.append(made.row())
        at_most.append(_at_most(planner, made.reward))
        report(len(rows))
    once = None if planner.replan else np.array(at_most)
    return Planned(of_rows(rows), np.array(planner.seconds), planner.unproven, once)


def _at_most(planner: Planner, earned: float) -> float:
    """Return the reward that no other plan than the last, which ``earned`` so much, could exceed."""
    found, reward = planner.found, planner.reward
    if found is None or found.proven:
        return earned
    return max(earned, reward.goal - reward.action - found.least)


def known_bound(
    arm: Arm,
    goals: Goals | NDArray[np.float64],
    rewards: Mapping[str, NDArray[np.float64]],
    settings: BoundSettings,
    *,
    seed: int = 0,
    reward: Reward = Reward(),
    progress: Callable[[float, float], None] | None = None,
) -> dict[str, Any]:
    """Return the bound of ``arm`` where its true physics is known, and how far a controller stays below it.

    Args:
        arm: any; the true physics is known of a virtual one only. It is not moved.
        goals: what is drawn from, or their range (joints, 2) [counts].
        rewards: of the controller's tests on the arm by their names, each shape (n,), in the order of the movements.
        settings: how many movements, and which plans.
        seed: of the transfer in which the tests were made.
        reward: what is paid.
        progress: called with what is done and the total.

    Returns:
        ``open_loop`` and ``closed_loop`` with their figures, and ``distance`` from a test's name to the distances
        to both; ``missing`` says instead why there is none.

    """
    if not isinstance(arm, VirtualArm):
        return {"missing": f"{arm.spec.name} is no virtual arm: its true physics is not known"}
    planned = measure_bound(arm, goals, settings, seed=seed, reward=reward, progress=progress)
    figures: dict[str, Any] = {baseline: movements.results() for baseline, movements in planned.items()}
    for found in figures.values():
        del found["decision_ms"]  # of the machine, not of the arm
    figures["distance"] = {
        test: {baseline: movements.distance(paid) for baseline, movements in planned.items()}
        for test, paid in rewards.items()
    }
    return figures


def bound_results(
    arm: VirtualArm, goal_range: NDArray[np.float64], settings: BoundSettings, planned: dict[Baseline, Planned]
) -> dict[str, Any]:
    """Return all figures for the command line and for programs."""
    return {
        "arm": arm.spec.name,
        "goal_range": goal_range.tolist(),
        "settings": asdict(settings),
        **{baseline: movements.results() for baseline, movements in planned.items()},
    }
