"""Stop operators in the state: simulations and default agents with and without them, the same recordings and seeds.

python -m benchmarks hysteresis

What was measured is kept, so an interrupted benchmark goes on. Settings come from the environment:

PNEUMARM_HYSTERESIS_ARMS     names of arms, divided by blanks
PNEUMARM_HYSTERESIS_RADII    sets of radii [degrees], "none 1+5" by default
PNEUMARM_HYSTERESIS_ROWS     transitions recorded of each arm, 9000
PNEUMARM_HYSTERESIS_SEEDS    of fit and training, "0,1"
PNEUMARM_HYSTERESIS_GOALS    goals on each arm, held for 3 s, 60
PNEUMARM_HYSTERESIS_FOLDER   where rows and recordings are kept; runs/hysteresis by default
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import Rows, moved_by
from pneumarm.arm import open_arm
from pneumarm.experiments import there_and_back
from pneumarm.learning import train
from pneumarm.moving.trial import MoveTrialSettings
from pneumarm.simulation import FitSettings
from pneumarm.transitions import Store, collect

ARMS = (
    "virtual:seed=3 virtual:seed=5 virtual:wide,seed=61 virtual:wide,seed=76 virtual:wide,seed=6001 "
    "python:benchmarks.strangers:one_13 python:benchmarks.strangers:one_22"
)
HEADER = (
    f"{'arm':36}{'radii':>8}{'settled':>9}{'median':>8}{'rest':>7}{'changes':>9}{'in the last second':>20}"
    f"{'1/4, 1/2, 1 Hz':>19}"
)


def measure() -> Iterator[str]:
    arms = environment.text("PNEUMARM_HYSTERESIS_ARMS", ARMS).split()
    sets = environment.text("PNEUMARM_HYSTERESIS_RADII", "none 1+5").split()
    transitions = environment.whole("PNEUMARM_HYSTERESIS_ROWS", 9000)
    seeds = environment.seeds("PNEUMARM_HYSTERESIS_SEEDS", "0,1")
    goals = environment.whole("PNEUMARM_HYSTERESIS_GOALS", 60)
    folder = environment.folder("PNEUMARM_HYSTERESIS_FOLDER", "runs/hysteresis")
    rows = Rows(folder / "rows.jsonl", "arm", "radii", "transitions", "seed", "goals")
    yield HEADER
    for arm in arms:
        db = recorded(arm, transitions, folder)
        for radii in sets:
            key = {"arm": arm, "radii": radii, "transitions": transitions, "goals": goals}
            each = [
                rows.get(arm, radii, transitions, seed, goals) or rows.add(key | row_of(arm, db, radii, seed, goals))
                for seed in seeds
            ]
            yield line(arm, radii, each)


def recorded(arm: str, transitions: int, folder: Path) -> Path:
    """Return a recording of ``arm``; one that was interrupted goes on."""
    db = folder / f"{arm.replace(':', '_').replace(',', '_')}_{transitions}.db"
    with open_arm(arm) as opened, Store.for_arm(db, opened.spec) as store:
        collect(opened, store, transitions)
    return db


def row_of(arm: str, db: Path, radii: str, seed: int, goals: int) -> dict[str, Any]:
    """Return how the default agent of a simulation with stop operators of these ``radii`` settles and follows."""
    chosen = () if radii == "none" else tuple(map(float, radii.split("+")))
    made, begin = there_and_back.fitted(db, FitSettings(seed=seed, hysteresis=chosen))
    agent = train(made.simulation, begin, seed=seed).agent
    found = moved_by(agent, arm, MoveTrialSettings(goals=goals, hold=3.0, frequencies=(0.25, 0.5, 1.0)), seed)
    settle = found["settle"]
    return {
        "seed": seed,
        "settled": settle["settled"],
        "seconds": settle["median_seconds"],
        "rest": settle["rest_error_deg"],
        "changes": settle["valve_changes_per_second"],
        "last": settle["valve_changes_last_second"],
        "track": [float(np.max(one["rms_error_deg"])) for one in found["track"]],
    }


def line(arm: str, radii: str, rows: list[dict[str, Any]]) -> str:
    """Return the means of ``rows`` as a line of the table."""

    def mean(name: str) -> float:
        return float(np.mean([np.inf if row[name] is None else row[name] for row in rows]))

    track = ", ".join(f"{error:.2f}" for error in np.mean([row["track"] for row in rows], axis=0))
    return (
        f"{arm:36}{radii:>8}{mean('settled'):9.3f}{mean('seconds'):8.2f}{mean('rest'):7.2f}{mean('changes'):9.1f}"
        f"{mean('last'):20.1f}{track:>19}"
    )
