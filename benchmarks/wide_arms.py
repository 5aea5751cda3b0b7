"""From a bare arm to movements, on arms drawn wide: what a person with an arm of any kind gets from a default run.

python -m benchmarks wide_arms

Each arm is recorded until more would not help, watched by a monitor that marks rows and may refuse it; then the
default agent, trained, settles at goals that the arm was seen to hold and follows sinusoids, on arrival and after it
has adapted to as many movements as in a run, and the agent for reaching reaches goals. What was measured is kept, so
an interrupted benchmark goes on. Settings come from the environment:

PNEUMARM_WIDE_ARMS       names of arms divided by blanks, or seeds of wide arms, such as the default, 6000-6009;
                         5000-5299 are held out. python:benchmarks.strangers:one_1, python:tests.friction_arms:joint_1
                         and so on have other physics; numbers of strangers from 1000 on are held out
PNEUMARM_WIDE_GOALS      40 to settle at, and as many to reach
PNEUMARM_WIDE_TASKS      "settle,reach", or one of them
PNEUMARM_WIDE_PLANNED    0 of the movements to reach goals that are planned with the true physics, too
PNEUMARM_WIDE_FOLDER     where rows are kept; runs/wide_arms by default
PNEUMARM_WIDE_PROCESSES  2
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import TASKS, Rows, in_processes, names_of, on_arrival, seconds_of
from pneumarm.errors import UnusableInput

QUANTILES = 0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0
RECORDED = {"minutes": "min", "refused": "refused", "marked": "marked"}
SETTLED = {
    "history": "history",
    "settled": "settled",
    "settled_adapted": "adapted",
    "seconds": "median [s]",
    "seconds_adapted": "adapted",
    "rest": "rest [deg]",
    "rest_adapted": "adapted",
    "changes": "changes/s",
    "slow": "1/4 Hz [deg]",
    "fast": "1 Hz [deg]",
}
REACHED = {"success": "reached", "reward": "reward"}
PLANNED = {"planned": "planned", "below": "below that"}


def measure() -> Iterator[str]:
    arms = names_of(environment.text("PNEUMARM_WIDE_ARMS", "6000-6009"), "virtual:wide,seed=")
    goals = environment.whole("PNEUMARM_WIDE_GOALS", 40)
    processes = environment.whole("PNEUMARM_WIDE_PROCESSES", 2)
    tasks = environment.words("PNEUMARM_WIDE_TASKS", ",".join(TASKS))
    planned = environment.whole("PNEUMARM_WIDE_PLANNED", 0, least=0)
    if unknown := [task for task in tasks if task not in TASKS]:
        raise UnusableInput(f"PNEUMARM_WIDE_TASKS: expected some of {', '.join(TASKS)}, got {unknown[0]!r}")
    if planned and not all(name.startswith("virtual") for name in arms):
        raise UnusableInput("PNEUMARM_WIDE_PLANNED: the true physics is known of virtual arms only")
    if planned > goals or (planned and "reach" not in tasks):
        raise UnusableInput(f"PNEUMARM_WIDE_PLANNED: {planned} movements cannot be planned, of {goals} to {tasks[0]}")
    asked = {"goals": goals, "tasks": ",".join(tasks), "planned": planned}
    rows = Rows(environment.folder("PNEUMARM_WIDE_FOLDER", "runs/wide_arms") / "rows.jsonl", "arm", *asked)
    wanted = [arm for arm in arms if rows.get(arm, *asked.values()) is None]
    for row in in_processes(arrived, [(arm, goals, tasks, planned) for arm in wanted], processes):
        rows.add(row | asked)
    columns = RECORDED | (SETTLED if "settle" in tasks else {}) | (REACHED if "reach" in tasks else {})
    columns |= PLANNED if planned else {}
    table = [figures_of(row) for arm in arms if (row := rows.get(arm, *asked.values())) is not None]
    yield line("", columns.values())
    for arm, figures in zip(arms, table, strict=True):
        yield line(arm, [figures[name] for name in columns])
    for quantile in QUANTILES:
        among = [float(np.quantile([one[name] for one in table], quantile)) for name in columns]
        yield line(f"quantile {quantile:g}", among)


def arrived(arm: str, goals: int, tasks: list[str], planned: int) -> dict[str, Any]:
    """Return what the agents of ``arm`` do on it, as a row."""
    return {"arm": arm, **on_arrival(arm, goals, monitor=True, adapts=True, tasks=tasks, planned=planned)}


def figures_of(row: dict[str, Any]) -> dict[str, float]:
    """Return the figures of the table."""
    found = {name: float(row[name]) for name in RECORDED}
    if "settled" in row:
        found |= {name: float(row[name]) for name in ("history", "settled", "rest", "changes")}
        found |= {f"{name}_adapted": float(row["adapted"][name]) for name in ("settled", "rest")}
        found |= {"seconds": seconds_of(row), "seconds_adapted": seconds_of(row["adapted"])}
        found |= {"slow": row["track"][0], "fast": row["track"][-1]}
    if "reward" in row:
        found |= {"success": float(np.mean(row["success"])), "reward": float(np.mean(row["reward"]))}
    if "planned_rewards" in row:
        best, made = np.array(row["planned_rewards"]), np.array(row["reward"])
        found |= {"planned": float(best.mean()), "below": float((best - made[: len(best)]).mean())}
    return found


def line(name: str, cells: Iterable[str | float]) -> str:
    """Return a line of the table."""
    return f"{name:34}" + "".join(f"{one:>13}" if isinstance(one, str) else f"{one:13.3f}" for one in cells)
