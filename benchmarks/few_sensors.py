"""What it costs to do without pressure sensors, or without a second muscle: the same arms with them and without.

python -m benchmarks few_sensors

On each arm the job is done as ``pneumarm run`` does it by default, up to the agent's arrival: collecting until more
would not help, the fit, and a training of the default agent and of the one for reaching. Then the first settles at
goals and follows sinusoids, and the second reaches goals. What was measured is kept, so an interrupted benchmark goes
on. Settings come from the environment:

PNEUMARM_FEW_ARMS       seeds of virtual arms, "11,12,13,14,15"
PNEUMARM_FEW_KINDS      which arms, "all sensors,angle alone,one muscle"
PNEUMARM_FEW_GOALS      200 to settle at, and as many to reach
PNEUMARM_FEW_FOLDER     where rows are kept; runs/few_sensors by default
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import Rows, on_arrival, seconds_of
from pneumarm.errors import UnusableInput
from pneumarm.statistics import mean_estimate, rate_estimate

KINDS = {"all sensors": "", "angle alone": ",pressure_sensors=off", "one muscle": ",muscles=1"}
"""What is added to the name of an arm."""
HEADER = (
    f"{'':13}{'arm':>5}{'min':>6}{'settled':>9}{'median':>8}{'rest':>7}"
    f"{'1/4, 1/2, 1 Hz':>19}{'success':>9}{'reward':>8}"
)


def measure() -> Iterator[str]:
    arms = environment.seeds("PNEUMARM_FEW_ARMS", "11,12,13,14,15")
    kinds = environment.words("PNEUMARM_FEW_KINDS", ",".join(KINDS))
    if unknown := [kind for kind in kinds if kind not in KINDS]:
        raise UnusableInput(f"PNEUMARM_FEW_KINDS: expected some of {', '.join(KINDS)}, got {unknown[0]!r}")
    goals = environment.whole("PNEUMARM_FEW_GOALS", 200)
    rows = Rows(environment.folder("PNEUMARM_FEW_FOLDER", "runs/few_sensors") / "rows.jsonl", "kind", "arm", "goals")
    wanted = [(arm, goals) for arm in arms]
    yield HEADER
    for arm in arms:
        for kind in kinds:
            yield line(kind, str(arm), [rows.get(kind, arm, goals) or rows.add(row_of(kind, arm, goals))])
    for kind in kinds:
        yield line(kind, "all", [row for row in rows if row["kind"] == kind and (row["arm"], row["goals"]) in wanted])


def row_of(kind: str, arm: int, goals: int) -> dict[str, Any]:
    """Return what the two agents of an arm do on it."""
    return {"kind": kind, "arm": arm, "goals": goals, **on_arrival(f"virtual:seed={arm}{KINDS[kind]}", goals)}


def line(kind: str, arm: str, rows: list[dict[str, Any]]) -> str:
    """Return the figures of ``rows`` as a line of the table."""

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in rows]))

    seconds = float(np.mean([seconds_of(row) for row in rows]))
    success = rate_estimate(np.concatenate([row["success"] for row in rows]).astype(bool))
    reward = mean_estimate(np.concatenate([row["reward"] for row in rows]))
    track = ", ".join(f"{error:.2f}" for error in np.mean([row["track"] for row in rows], axis=0))
    return (
        f"{kind:13}{arm:>5}{mean('minutes'):6.1f}{mean('settled'):9.4f}{seconds:8.2f}{mean('rest'):7.2f}"
        f"{track:>19}{success.mean:9.4f}{reward.mean:8.2f}"
    )
