"""How surely goals are reached and settled at, on arms of any kind: many movements, every failure kept.

python -m benchmarks success

Each arm is recorded, its simulations are fitted and its agents trained as in a default run. Then it is moved, and
nothing is learned: by the default agent, which is to settle at a goal within a degree in two seconds and stay, and by
the agent for reaching, from begin states that are drawn as in the thesis. Goals are those that the agent knows to be
within reach. What fails is tried again after two seconds with closed valves (thesis section 5.6.1). Movements are
made in blocks, each on the arm as it is when newly opened, so that they can be made at once and in any order; what a
block is depends on its number alone. Settings come from the environment:

PNEUMARM_SUCCESS_ARMS       names of arms divided by blanks, or seeds of wide arms, such as the default, 5000-5099
PNEUMARM_SUCCESS_SETTLE     movements of the default agent on each arm, 500; 0 for none
PNEUMARM_SUCCESS_REACH      movements of the agent for reaching on each arm, 10000; 0 for none
PNEUMARM_SUCCESS_PROCESSES  2
PNEUMARM_SUCCESS_FOLDER     where agents and rows are kept; a call with the same folder goes on where another ended.
                            runs/success by default

A failed movement is kept as a row of ``failed.jsonl`` there: its first try with all that was read and set.
"""

import math
import re
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import _environment as environment
from benchmarks._trials import TASKS, Rows, fitted, in_processes, names_of, recorded
from benchmarks.agents import KINDS_OF_FAILURE, kind
from pneumarm.arm import ArmSpec, ControlCycle, guarded, open_arm
from pneumarm.control import AgentController, drawn
from pneumarm.control.agent import warm_up
from pneumarm.control.movement import BEGIN, move
from pneumarm.experiments import there_and_back
from pneumarm.learning import AnyAgent, PolicySettings, goals_of, load_agent, train
from pneumarm.moving.movement import MoveSettings
from pneumarm.moving.movement import move as move_and_hold
from pneumarm.simulation import FitSettings
from pneumarm.statistics import wilson
from pneumarm.transitions.rows import Recorded

SEED = 0
"""Of everything but the arm, as ``pneumarm run`` has it."""
BLOCK = 500
WORTH = {"settle": "median of the seconds to settle", "reach": "reward"}
"""What a row tells of a block besides its failures, by task."""
PAUSE = MoveSettings().pause
"""Before a second try [s]."""
QUANTILES = 0.0, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0
SHOWN = 20
"""Failures that are told of one by one."""
HEADER = f"{'':34}{'movements':>10}" + "".join(f"{name:>14}{'of 100,000':>26}" for name in ("failed", "failed twice"))


def measure() -> Iterator[str]:
    folder = environment.folder("PNEUMARM_SUCCESS_FOLDER", "runs/success")
    arms = names_of(environment.text("PNEUMARM_SUCCESS_ARMS", "5000-5099"), "virtual:wide,seed=")
    wanted = {
        "settle": environment.whole("PNEUMARM_SUCCESS_SETTLE", 500, least=0),
        "reach": environment.whole("PNEUMARM_SUCCESS_REACH", 10_000, least=0),
    }
    processes = environment.whole("PNEUMARM_SUCCESS_PROCESSES", 2)
    tasks = [task for task in TASKS if wanted[task]]
    for _ in in_processes(prepare, [(folder, arm, task) for arm in arms for task in tasks], processes):
        pass
    rows = Rows(folder / "movements.jsonl", "arm", "task", "block")
    failures = Rows(folder / "failed.jsonl", "arm", "task", "number")
    blocks = [
        (arm, task, block, min(BLOCK, wanted[task] - block * BLOCK))
        for task in tasks
        for block in range(-(-wanted[task] // BLOCK))
        for arm in arms
    ]
    made = {block: rows.get(*block[:3]) for block in blocks}
    missing = [(folder, *block) for block, row in made.items() if row is None or row["movements"] != block[3]]
    for row in in_processes(make_block, missing, processes):
        for failure in row.pop("failures"):  # before the row that counts them
            failures.add(failure)
        rows.add(row)
    yield HEADER
    for task in tasks:
        chosen = [row for block in blocks if block[1] == task and (row := rows.get(*block[:3])) is not None]
        for arm in arms:
            if any(row["failed"] for row in chosen if row["arm"] == arm):
                yield line(f"{task} {arm}", [row for row in chosen if row["arm"] == arm])
        yield line(f"{task}, {len(arms)} arms", chosen)
        yield from quantiles(task, chosen)
        yield from table(
            [one for one in failures if one["task"] == task and one["arm"] in arms and one["number"] < wanted[task]]
        )


def place(folder: Path, arm: str, task: str) -> Path:
    """Return the file of the agent of an arm for a task."""
    return folder / f"{re.sub('[^0-9a-zA-Z]+', '-', arm)}.{task}.agent"


def prepare(folder: Path, arm: str, task: str) -> dict[str, Any]:
    """Record an arm, fit and train, where that is not done yet."""
    file = place(folder, arm, task)
    if not file.exists():
        with tempfile.TemporaryDirectory() as temporary:
            db = Path(temporary) / "arm.db"
            recorded(arm, db, SEED)
            if task == "settle":
                made, begin = there_and_back.fitted(db, FitSettings(seed=SEED))
                agent: AnyAgent = train(made.simulation, begin, seed=SEED).agent
            else:
                made, begin = fitted(db, SEED)
                agent = train(made.simulation, begin, PolicySettings(), SEED).agent
        agent.save(file)
    return {}


def make_block(folder: Path, arm: str, task: str, block: int, movements: int) -> dict[str, Any]:
    """Return the row of a block of movements, with a row of each that failed in ``failures``."""
    agent = load_agent(place(folder, arm, task))
    first = block * BLOCK
    make = settle if task == "settle" else reach
    made = list(make(agent, arm, range(first, first + movements), block))
    failures = [{"arm": arm, "task": task, "number": one.number, **one.failed} for one in made if one.failed]
    return {
        "arm": arm,
        "task": task,
        "block": block,
        "movements": movements,
        "failed": len(failures),
        "failed_twice": sum(one["twice"] for one in failures),
        "worth": float(
            np.median([one.worth for one in made]) if task == "settle" else np.mean([one.worth for one in made])
        ),
        "failures": failures,
    }


class Made(NamedTuple):
    """A movement that was made."""

    number: int
    worth: float
    """Reward of one that was to reach its goal, seconds until one settled, infinite where it did not."""
    failed: dict[str, Any] | None
    """What there is to know of its first try if that failed."""


def settle(agent: AnyAgent, arm: str, numbers: range, seed: int) -> Iterator[Made]:
    """Yield movements that are to settle at their goals."""
    goals = goals_of(agent).draw(np.random.default_rng([SEED, seed]), BLOCK)[: len(numbers)]
    once, controller = MoveSettings(tries=1), agent.controller()
    assert controller is not None
    with open_arm(arm, seed) as opened:
        guard = guarded(opened)
        for number, goal in zip(numbers, goals, strict=True):
            (moved,) = move_and_hold(guard, controller, [goal], once)
            failed = None
            if not moved.success:
                guard.wait(PAUSE)
                (again,) = move_and_hold(guard, controller, [goal], once)
                failed = failure(moved.recorded, moved.spec, goal, not again.success)
            seconds = math.inf if moved.time_settled is None else moved.time_settled - moved.time_start
            yield Made(number, seconds, failed)


def reach(agent: AnyAgent, arm: str, numbers: range, seed: int) -> Iterator[Made]:
    """Yield movements that are to reach their goals."""
    controller, settings = AgentController(agent), agent.settings
    warm_up(agent)
    with open_arm(arm, seed) as opened:
        cycle = ControlCycle(guarded(opened))
        for number, draw in zip(numbers, drawn(goals_of(agent), SEED, numbers), strict=True):
            BEGIN.reach(cycle.arm, draw.random)
            made = move(cycle, controller, draw.goal, settings, velocity=agent.window.velocity)
            failed = None
            if not made.success:
                cycle.arm.wait(PAUSE)
                again = move(cycle, controller, draw.goal, settings, velocity=agent.window.velocity)
                failed = failure(made.recorded, opened.spec, made.goal, not again.success)
            yield Made(number, made.reward, failed)


def failure(recorded: Recorded, spec: ArmSpec, goal: NDArray[np.float64], twice: bool) -> dict[str, Any]:
    """Return all there is to know of a movement that failed, angles in degrees, pressures in bar."""
    angle, target = spec.degrees(recorded.angle), spec.degrees(goal)
    return {
        "kind": kind(angle, target),
        "twice": twice,
        "goal": target.round(2).tolist(),
        "time": (recorded.time - recorded.time[0]).round(3).tolist(),
        "angle": angle.round(2).tolist(),
        "pressure": spec.bar(recorded.pressure).round(4).tolist(),
        "command": recorded.command.round(3).tolist(),
    }


def line(name: str, rows: list[dict[str, Any]]) -> str:
    """Return the figures of ``rows`` as a line of the table."""
    movements, failed, twice = (sum(row[key] for row in rows) for key in ("movements", "failed", "failed_twice"))
    return f"{name:34}{movements:>10,}" + "".join(f"{n:>14,}{rate(n, movements):>26}" for n in (failed, twice))


def quantiles(task: str, rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield how well the arms of ``rows`` do, from the worst to the best."""
    arms = [[row for row in rows if row["arm"] == arm] for arm in sorted({row["arm"] for row in rows})]
    if not arms:
        return
    once, twice = (
        [1 - sum(row[kind] for row in own) / sum(row["movements"] for row in own) for own in arms]
        for kind in ("failed", "failed_twice")
    )
    worth = [np.average([row["worth"] for row in own], weights=[row["movements"] for row in own]) for own in arms]
    levels = 1 - np.array(QUANTILES) if task == "settle" else np.array(QUANTILES)  # the fewer seconds the better
    for name, values, at in (
        ("success at once", once, np.array(QUANTILES)),
        ("success in two tries", twice, np.array(QUANTILES)),
        (WORTH[task], worth, levels),
    ):
        found = np.quantile(values, at, method="nearest")  # between a time and none there is nothing
        yield f"  {name + ', by arm':40}" + " ".join(f"{value:10.4f}" for value in found)


def rate(failed: int, movements: int) -> str:
    """Return a rate of failures with the upper end of its interval."""
    low, _ = wilson(movements - failed, movements)
    return f"{1e5 * failed / movements:.1f} (at most {1e5 * (1 - float(low)):.1f})"


def table(failures: list[dict[str, Any]]) -> Iterator[str]:
    """Yield how many failures there are of each kind and on which arms, and each of the first."""
    for name in KINDS_OF_FAILURE:
        found = Counter(one["arm"] for one in failures if one["kind"] == name)
        where = ", ".join(f"{count} on {arm}" for arm, count in found.most_common(5))
        if found:
            yield f"  {name:28}{found.total():6}, most: {where}"
    for one in failures[:SHOWN]:
        angle, goal = np.array(one["angle"]), np.array(one["goal"])
        off = np.abs(angle - goal).max(axis=1)
        yield (
            f"  {one['arm']}, movement {one['number']}: {one['kind']}; goal {goal}, from {angle[0]} to {angle[-1]} "
            f"degrees, at the nearest {off.min():.1f} off; second try {'failed' if one['twice'] else 'succeeded'}"
        )
