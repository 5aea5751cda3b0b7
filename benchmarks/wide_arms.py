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
PNEUMARM_WIDE_FOLDER     where rows are kept; runs/wide_arms by default
PNEUMARM_WIDE_PROCESSES  2
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import Rows, in_processes, names_of, on_arrival, seconds_of

QUANTILES = 0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0
COLUMNS = {
    "minutes": "min",
    "refused": "refused",
    "marked": "marked",
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
    "success": "reached",
    "reward": "reward",
}


def measure() -> Iterator[str]:
    arms = names_of(environment.text("PNEUMARM_WIDE_ARMS", "6000-6009"), "virtual:wide,seed=")
    goals = environment.whole("PNEUMARM_WIDE_GOALS", 40)
    processes = environment.whole("PNEUMARM_WIDE_PROCESSES", 2)
    rows = Rows(environment.folder("PNEUMARM_WIDE_FOLDER", "runs/wide_arms") / "rows.jsonl", "arm", "goals")
    wanted = [arm for arm in arms if rows.get(arm, goals) is None]
    for row in in_processes(arrived, [(arm, goals) for arm in wanted], processes):
        rows.add(row)
    table = [figures_of(row) for arm in arms if (row := rows.get(arm, goals)) is not None]
    yield f"{'':34}" + "".join(f"{title:>13}" for title in COLUMNS.values())
    for arm, figures in zip(arms, table, strict=True):
        yield line(arm, figures)
    for quantile in QUANTILES:
        among = {name: float(np.quantile([one[name] for one in table], quantile)) for name in COLUMNS}
        yield line(f"quantile {quantile:g}", among)


def arrived(arm: str, goals: int) -> dict[str, Any]:
    """Return what the agents of ``arm`` do on it, as a row."""
    return {"arm": arm, "goals": goals, **on_arrival(arm, goals, monitor=True, adapts=True)}


def figures_of(row: dict[str, Any]) -> dict[str, float]:
    """Return the figures of the table."""
    slow, *_, fast = row["track"]
    derived = {"slow": slow, "fast": fast, "success": np.mean(row["success"]), "reward": np.mean(row["reward"])}
    later = {f"{name}_adapted": row["adapted"][name] for name in ("settled", "rest")}
    seconds = {"seconds": seconds_of(row), "seconds_adapted": seconds_of(row["adapted"])}
    return {name: float((row | derived | later | seconds)[name]) for name in COLUMNS}


def line(name: str, figures: dict[str, float]) -> str:
    """Return a line of the table."""
    return f"{name:34}" + "".join(f"{figures[column]:13.3f}" for column in COLUMNS)
