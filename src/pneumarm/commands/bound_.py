"""``pneumarm bound``."""

from pathlib import Path
from typing import Annotated, Any

from pneumarm.arm import open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.bound.moving import WAYS, MovingBoundSettings, Way, measure_moving_bound
from pneumarm.bound.reaching import BoundSettings, bound_results, measure_bound, measured_goal_range
from pneumarm.commands.common import Json, Settings
from pneumarm.console import show, table
from pneumarm.control.transfer import check_fit
from pneumarm.errors import UnusableInput
from pneumarm.learning import load_agent
from pneumarm.learning.servo import ServoAgent
from pneumarm.progress import progress
from pneumarm.simulation import Simulation

_MEANINGS: dict[Way, str] = {
    "arm": "agent on the arm",
    "quiet": "on the arm without noise",
    "physics": "the best there",
    "simulation": "network in its simulation",
    "simulated": "the best there",
}


def bound_(
    *,
    arm: str,
    sim: Path | None = None,
    agent: Path | None = None,
    seed: int = 0,
    settings: Annotated[BoundSettings, Settings] = BoundSettings(),
    moving: MovingBoundSettings = MovingBoundSettings(),
    json: Json = False,
) -> None:
    """Say what is possible on a virtual arm, by planning with its true physics.

    Parameters
    ----------
    arm
        virtual, virtual:seed=N or virtual:preset=A; the true physics of other arms are unknown.
    sim
        A simulation of this arm: goals are drawn from its range, and a third planner uses it. Without one, a short
        collection measures the range of goals.
    agent
        The file of an agent that settles, holds and tracks. The command then reports what it could do at best, and
        whether noise, the learner or the simulation's error keeps it from that.
    seed
        Random seed of begin states, goals and noise: as those of ``pneumarm transfer`` with the same seed.
    """
    opened = open_arm(arm, seed)
    if not isinstance(opened, VirtualArm):
        opened.close()
        raise UnusableInput(f"arm {arm!r}: the bound needs a virtual arm, whose true physics are known")
    if agent is not None:
        _moving(opened, _servo(agent), moving, seed, json)
        return
    simulation = None if sim is None else Simulation.load(sim)
    goal_range = measured_goal_range(opened, seed) if simulation is None else simulation.goal_range
    with progress("planning") as report:
        planned = measure_bound(opened, goal_range, settings, seed=seed, simulation=simulation, progress=report)
    result = bound_results(opened, goal_range, settings, planned)
    columns = ("reward", "success_rate", "actions", "switches")

    def rows() -> list[tuple[object, ...]]:
        shown = []
        for baseline in planned:
            figures = result[baseline]
            means = [_with_interval(figures[name], figures["intervals"][name]) for name in columns]
            times = figures["decision_ms"]
            shown.append((baseline.replace("_", " "), *means, times["median"], times["p99"]))
        return shown

    header = ("planner", *columns, "decision, median [ms]", "p99 [ms]")
    once = result["open_loop"]
    proven = f"{settings.episodes - once['unproven_plans']} of {settings.episodes} plans in open loop"
    most = (
        f"No plans with at most {settings.plan.switches} switches earn more than {once['at_most']:.2f} in the "
        f"mean in open loop; {proven} are proven to be the best."
    )
    title = f"{arm}, {settings.episodes} movements, 95 % intervals"
    show(result, json, lambda: [table(header, rows(), title), most])


def _with_interval(mean: Any, ends: Any) -> str:
    """Return a mean for people, of each joint where it is a list; too few movements have no interval."""
    if isinstance(mean, list):
        return ", ".join(map(_with_interval, mean, ends or [None] * len(mean)))
    return f"{mean:.3f}" + (f" ({ends[0]:.3f} to {ends[1]:.3f})" if ends else "")


def _servo(file: Path) -> ServoAgent:
    agent = load_agent(file)
    if not isinstance(agent, ServoAgent):
        raise UnusableInput(f"{file}: reaches goals only; give an agent that settles, holds and tracks")
    return agent


def _moving(arm: VirtualArm, agent: ServoAgent, settings: MovingBoundSettings, seed: int, json: bool) -> None:
    check_fit(agent, arm)
    with progress("making movements better") as report:
        found = measure_moving_bound(arm, agent, settings, seed=seed, progress=report)
    frequencies = [f"{frequency:g}" for frequency in settings.frequencies]

    def rows() -> list[tuple[object, ...]]:
        return [
            (
                _MEANINGS[way],
                *(found["settle"][way][name] for name in ("settled", "median_seconds", "rest_error_deg")),
                *(found["track"][way][frequency] for frequency in frequencies),
            )
            for way in WAYS
        ]

    header = ("", "settled", "median [s]", "at rest [deg]", *(f"{one} Hz, rms [deg]" for one in frequencies))
    title = f"{arm.spec.name}: {settings.goals} goals, sinusoids of {settings.amplitude:g} degrees"
    show({"arm": arm.spec.name, "moving": found}, json, lambda: [table(header, rows(), title)])
