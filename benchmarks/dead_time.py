"""Valves that answer late: the default agent on virtual arms with dead time, made as in a default run.

python -m benchmarks dead_time

Each arm is recorded with its monitor, fitted, and settled on by the agent that was trained. What was measured is
kept, so an interrupted benchmark goes on. Settings come from the environment:

PNEUMARM_DEAD_TIMES     dead times besides the arm's own [ms], "0,67,100,200"
PNEUMARM_DEAD_ARMS      seeds of virtual arms, "3,5,31"
PNEUMARM_DEAD_SEEDS     of recording, fit and training, "0"
PNEUMARM_DEAD_GOALS     goals on each arm, 100
PNEUMARM_DEAD_FOLDER    where rows are kept; runs/dead_time by default
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import Rows, on_arrival, seconds_of

HEADER = (
    f"{'late [ms]':>9}{'arm':>5}{'refused':>9}{'history':>9}{'settled':>9}{'median':>8}{'rest':>7}"
    f"{'1/4, 1/2, 1 Hz':>19}"
)


def measure() -> Iterator[str]:
    arms = environment.seeds("PNEUMARM_DEAD_ARMS", "3,5,31")
    seeds = environment.seeds("PNEUMARM_DEAD_SEEDS", "0")
    goals = environment.whole("PNEUMARM_DEAD_GOALS", 100)
    folder = environment.folder("PNEUMARM_DEAD_FOLDER", "runs/dead_time")
    rows = Rows(folder / "rows.jsonl", "late", "arm", "seed", "goals")
    yield HEADER
    for late in environment.seeds("PNEUMARM_DEAD_TIMES", "0,67,100,200"):
        made = []
        for arm in arms:
            each = [rows.get(late, arm, seed, goals) or rows.add(row_of(late, arm, seed, goals)) for seed in seeds]
            yield line(late, str(arm), each)
            made += each
        yield line(late, "all", made)


def row_of(late: int, arm: int, seed: int, goals: int) -> dict[str, Any]:
    """Return what the default agent does on an arm whose valves are ``late`` [ms]."""
    found = on_arrival(f"python:tests.late_arms:seed_{arm}_by_{late}", goals, seed, monitor=True, tasks=["settle"])
    return {"late": late, "arm": arm, "seed": seed, "goals": goals, **found}


def line(late: int, arm: str, rows: list[dict[str, Any]]) -> str:
    """Return the figures of ``rows`` as a line of the table."""

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in rows]))

    seconds = float(np.mean([seconds_of(row) for row in rows]))
    track = ", ".join(f"{error:.2f}" for error in np.mean([row["track"] for row in rows], axis=0))
    return (
        f"{late:9}{arm:>5}{mean('refused'):9.2f}{mean('history'):9.1f}{mean('settled'):9.4f}{seconds:8.2f}"
        f"{mean('rest'):7.2f}{track:>19}"
    )
