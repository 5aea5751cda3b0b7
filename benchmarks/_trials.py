"""What long benchmarks share: rows that outlast an interruption, and movements on an arm by their numbers."""

import json
import math
import os
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from benchmarks import _environment as environment
from pneumarm.arm import Arm, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.bound.reaching import BoundSettings, measure_bound
from pneumarm.control import AgentController, Monitor
from pneumarm.control.agent import warm_up
from pneumarm.control.monitor import Mode
from pneumarm.control.transfer import monitor_of, transfer
from pneumarm.errors import ArmFailure
from pneumarm.experiments import there_and_back
from pneumarm.experiments.there_and_back import Recipe
from pneumarm.learning import AnyAgent, PolicySettings, goals_of, train
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.planning import PlanSettings
from pneumarm.run import RunTransferSettings
from pneumarm.simulation import SINGLE_STEPS, FitSettings, StoreFit
from pneumarm.simulation.enough import collect_enough
from pneumarm.task import BeginStates, Movement
from pneumarm.transitions import CollectResult, CollectSettings, Store, collect
from pneumarm.transitions.watch import Watch

HELD_OUT = ",".join(str(seed) for seed in range(1001, 1011))
"""The arms to judge on; nothing is developed on them."""
SEED_OF_MOVEMENTS = 0
TASKS = "settle", "reach"
"""What agents are trained for: to settle at goals, hold them and follow, and to reach them."""


class Rows:
    """Results in a file, one JSON object a line: what is there need not be measured again."""

    def __init__(self, path: Path, *keys: str) -> None:
        """Read the rows in ``path``; a row is known by its ``keys``. A line that was cut off is left out."""
        self.path, self.keys = path, keys
        self._found: dict[tuple[Any, ...], dict[str, Any]] = {}
        whole = b""
        if path.exists():
            whole = path.read_bytes()
            whole = whole[: whole.rfind(b"\n") + 1]
            path.write_bytes(whole)
        for line in whole.splitlines():
            row = json.loads(line)
            self._found[self._key(row)] = row

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(list(self._found.values()))

    def get(self, *key: Any) -> dict[str, Any] | None:
        """Return the row of this ``key``, in the order of the keys; None where it is not yet measured."""
        return self._found.get(key)

    def add(self, row: dict[str, Any]) -> dict[str, Any]:
        """Write a row to the end of the file and return it."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self._found[self._key(row)] = row
        return row

    def _key(self, row: dict[str, Any]) -> tuple[Any, ...]:
        return tuple(row.get(key) for key in self.keys)


def names_of(arms: str, seeded: str) -> list[str]:
    """Return the names of ``arms``: names divided by blanks, or seeds, each with ``seeded`` before it.

    Raises:
        UnusableInput: there is no arm of such a name.

    """
    try:
        return [f"{seeded}{seed}" for seed in environment.seeds_in(arms)]
    except ValueError:
        for name in arms.split():
            open_arm(name).close()
        return arms.split()


def in_processes(
    function: Callable[..., dict[str, Any]], tasks: Sequence[tuple[Any, ...]], processes: int
) -> Iterator[dict[str, Any]]:
    """Give what ``function`` returns of each task, as they come; processes end with whoever asks for them."""
    return Parallel(processes, return_as="generator_unordered")(delayed(function)(*task) for task in tasks)  # type: ignore[no-any-return]


def seconds_of(row: dict[str, Any]) -> float:
    """Return the median time of a row of :func:`on_arrival`; a time that no movement has is infinite."""
    return math.inf if row["seconds"] is None else float(row["seconds"])


def collected(
    path: Path, arm: int, seed: int, transitions: int = 0, minutes: float = 0.0, pulses: float = 0.0
) -> tuple[int, float]:
    """Collect on a virtual arm until there are so many ``transitions`` and so many ``minutes`` have passed for it.

    Whole sequences are stored, so there may be one more than needed. Returns the transitions and the minutes.
    """
    return there_and_back.collect_until(
        path, f"virtual:seed={arm}", seed, Recipe(transitions, minutes, collect=CollectSettings(pulses=pulses))
    )


def fitted(path: Path, seed: int) -> tuple[StoreFit, BeginStates]:
    """Return the simulation fitted to a store for agents that reach goals, and its begin states."""
    return there_and_back.fitted(path, replace(SINGLE_STEPS, seed=seed))


def greedy_movements(
    agent: AnyAgent,
    arm: int,
    goals: NDArray[np.float64],
    numbers: Iterable[int],
    seed: int,
    controller: AgentController | None = None,
) -> list[Movement]:
    """Return greedy movements of ``agent``, which learns nothing, on a virtual arm.

    Args:
        agent: what moves it.
        arm: seed of the arm.
        goals: range of the goals, shape (joints, 2) [counts].
        numbers: of the movements; begin state and goal depend on these alone.
        seed: of the noise of the arm's sensors and of its timing.
        controller: what acts in its place.

    """
    with open_arm(f"virtual:seed={arm}", seed) as opened:
        return there_and_back.greedy_movements(agent, opened, goals, numbers, SEED_OF_MOVEMENTS, controller)


def on_arrival(
    name: str,
    goals: int,
    seed: int = 0,
    *,
    monitor: bool = False,
    adapts: bool = False,
    tasks: Collection[str] = TASKS,
    planned: int = 0,
) -> dict[str, Any]:
    """Return what the agents of the arm ``name`` do when they arrive on it; with ``adapts`` what one does later, too.

    Made as ``pneumarm run`` makes them by default: collecting until more would not help, the fit, and a training of
    the default agent and of the one for reaching. The first settles at ``goals`` and follows sinusoids, the second
    reaches as many; ``tasks`` says which of them are asked for. With ``monitor`` the arm is watched while it is
    recorded, as in a run: ``marked`` rows are then told, and whether the arm was ``refused``, in which case it is
    recorded again with a monitor that only warns. ``adapts``: the first adapts to as many movements as in a run, and
    settles and follows again. ``planned`` of the movements to reach goals are also planned with the true physics.
    """
    with tempfile.TemporaryDirectory() as folder:
        db = Path(folder) / "arm.db"
        row = recorded(name, db, seed) if monitor else _recorded(name, db, seed, "off")
        if "settle" in tasks:
            row |= _settling(name, db, goals, seed, adapts)
        if "reach" in tasks:
            single, begin = fitted(db, seed)
            agent = train(single.simulation, begin, PolicySettings(), seed).agent
            row |= _reaching(name, agent, goals, seed, planned)
    return row


def _settling(name: str, db: Path, goals: int, seed: int, adapts: bool) -> dict[str, Any]:
    """Return how the default agent settles and follows, on arrival and, if it ``adapts``, later."""
    made, begin = there_and_back.fitted(db, FitSettings(seed=seed))
    agent = train(made.simulation, begin, seed=seed).agent
    settings = MoveTrialSettings(goals=goals)
    found = {"history": made.simulation.window.history, **_moving_figures(moved_by(agent, name, settings, seed))}
    later = moved_by(adapted(agent, name, db, seed), name, settings, seed) if adapts else None
    return found | {"adapted": None if later is None else _moving_figures(later)}


def _reaching(name: str, agent: AnyAgent, goals: int, seed: int, planned: int) -> dict[str, Any]:
    """Return how ``agent`` reaches goals, and what planning with the true physics earns in the first movements."""
    warm_up(agent)  # no arm waits for a compiler
    with open_arm(name, seed) as opened:
        reached = there_and_back.greedy_movements(agent, opened, agent.goal_range, range(goals), seed)
        found: dict[str, Any] = {
            "success": [int(one.success) for one in reached],
            "reward": [float(one.reward) for one in reached],
        }
        if planned and isinstance(opened, VirtualArm):
            settings = BoundSettings(planned, PlanSettings(cutoff=agent.settings.cutoff))
            best = measure_bound(opened, agent.goal_range, settings, seed=seed, baselines=["closed_loop"])
            found["planned_rewards"] = best["closed_loop"].made.reward.tolist()
    return found


def recorded(name: str, db: Path, seed: int) -> dict[str, Any]:
    """Record an arm as in a default run, and with a monitor that only warns where it is ``refused``; return how."""
    try:
        return _recorded(name, db, seed, "stop")
    except ArmFailure:
        db.unlink()
        return {**_recorded(name, db, seed, "warn"), "refused": 1}


def _recorded(name: str, db: Path, seed: int, mode: Mode) -> dict[str, Any]:
    """Collect from an arm until more would not help; return how that went."""
    with open_arm(name, seed) as opened, Store.for_arm(db, opened.spec) as store:
        watch = Monitor(opened.spec, mode=mode)
        collect_enough(partial(_collected, opened, store, seed, watch), store)
        return {
            "minutes": opened.read().time / 60,
            "transitions": store.transitions,
            "marked": sum(store.marked_rows(1).values()),
            "refused": 0,
            "findings": [str(one) for one in watch.findings],
        }


def _moving_figures(tried: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a trial of moving in short."""
    return {
        "settled": tried["settle"]["settled"],
        "seconds": tried["settle"]["median_seconds"],
        "rest": tried["settle"]["rest_error_deg"],
        "overshoot": tried["settle"]["overshoot_deg"],
        "late_changes": tried["settle"]["valve_changes_last_second"],
        "changes": tried["settle"]["valve_changes_per_second"],
        "track": [float(np.mean(one["rms_error_deg"])) for one in tried["track"]],
    }


def adapted(agent: AnyAgent, name: str, db: Path, seed: int) -> AnyAgent:
    """Return ``agent`` after the movements of a default run on the arm ``name``; ``db`` holds its recording."""
    with open_arm(name, seed) as opened, Store.for_arm(db, opened.spec) as store:
        watch = monitor_of(agent, opened, "warn")
        return transfer(agent, opened, store, RunTransferSettings(), seed=seed, watch=watch).agent


def moved_by(agent: AnyAgent, name: str, settings: MoveTrialSettings, seed: int) -> dict[str, Any]:
    """Return what a default ``agent`` does on the arm ``name``, opened anew."""
    controller = agent.controller()
    assert controller is not None
    with open_arm(name, seed) as opened:
        return try_moving(opened, controller, goals_of(agent), settings, seed=seed).results()


def _collected(arm: Arm, store: Store, seed: int, watch: Watch, transitions: int) -> CollectResult:
    return collect(arm, store, transitions, seed, watch=watch)
