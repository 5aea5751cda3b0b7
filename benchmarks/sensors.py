"""Whether further sensors in the state help: velocity, acceleration, temperature (thesis section 7.3, appendix A).

python -m benchmarks sensors

Each arm has all of them and collects once; simulations are fitted to that recording and agents trained, by the
defaults, with no further sensors in the state, with one kind, and with all. Each agent makes the same movements on
the arm as its collection left it, warm, and again after a night of 14 h. Nothing is learned on the arm. An agent with
a measured velocity is judged by that, the others by the derived one; ``derived`` is the share of its successes that
the derived velocity would have agreed with. Settings come from the environment:

PNEUMARM_SENSORS_ARMS         seeds of virtual arms, "1,2,3,4,5"
PNEUMARM_SENSORS_SEEDS        of collecting, fitting and training, "0,1"
PNEUMARM_SENSORS_SETS         "none,velocity,acceleration,temperature,velocity+acceleration+temperature"
PNEUMARM_SENSORS_TRANSITIONS  collected of each arm and seed, 20000
PNEUMARM_SENSORS_MOVEMENTS    of each agent on the warm arm, and again after the night, 150
PNEUMARM_SENSORS_FOLDER       where rows are kept; a call with the same folder goes on where another ended.
                              runs/sensors by default

Differences to no further sensors are taken arm by arm, means over the seeds; their intervals are Student's over arms.
"""

import math
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from benchmarks import _environment as environment
from benchmarks._trials import SEED_OF_MOVEMENTS, Rows
from pneumarm.arm import open_arm
from pneumarm.arm.seam import SensorKind
from pneumarm.arm.virtual import VirtualArm
from pneumarm.experiments import there_and_back
from pneumarm.experiments.there_and_back import Recipe
from pneumarm.learning import AnyAgent, PolicySettings, test, train
from pneumarm.simulation import SINGLE_STEPS
from pneumarm.task import Movement
from pneumarm.transitions import CollectSettings, Store

NIGHT = 14 * 3600.0
"""A night's rest [s] (thesis section 5.5.2)."""
NONE = "none"
HEADER = (
    f"{'sensors':>36}{'angle':>7}{'velocity':>10}{'in simulation':>15}{'warm':>8}{'difference':>15}{'night':>8}"
    f"{'difference':>15}{'lowest':>8}{'success':>9}{'derived':>9}{'fit':>7}{'train':>7}"
)


def measure() -> Iterator[str]:
    folder = environment.folder("PNEUMARM_SENSORS_FOLDER", "runs/sensors")
    arms = environment.seeds("PNEUMARM_SENSORS_ARMS", "1,2,3,4,5")
    seeds = environment.seeds("PNEUMARM_SENSORS_SEEDS", "0,1")
    transitions = environment.whole("PNEUMARM_SENSORS_TRANSITIONS", 20_000)
    movements = environment.whole("PNEUMARM_SENSORS_MOVEMENTS", 150)
    each_alone = ["velocity", "acceleration", "temperature"]
    sets = environment.words("PNEUMARM_SENSORS_SETS", ",".join([NONE, *each_alone, "+".join(each_alone)]))
    rows = Rows(folder / "rows.jsonl", "arm", "seed", "sensors", "transitions", "movements")
    for seed in seeds:
        for arm in arms:
            missing = [one for one in sets if rows.get(arm, seed, one, transitions, movements) is None]
            if missing:
                with tempfile.TemporaryDirectory() as place:
                    db = Path(place) / "transitions.db"
                    there_and_back.collect_until(
                        db, name_of(arm), seed, Recipe(transitions, collect=CollectSettings(pulses=0.0))
                    )
                    for one in missing:
                        rows.add(trial(db, arm, seed, one, transitions, movements))
                        yield f"arm {arm}, seed {seed}, {one}: measured"
    yield HEADER
    keys = [(arm, seed) for arm in arms for seed in seeds]
    found = {one: [_row(rows, *key, one, transitions, movements) for key in keys] for one in sets}
    for one in sets:
        yield line(one, found[one], found.get(NONE, found[sets[0]]))


def name_of(arm: int) -> str:
    """Return the name of virtual arm ``arm`` with all further sensors."""
    return f"virtual:seed={arm},sensors={'+'.join(get_args(SensorKind))}"


def trial(db: Path, arm: int, seed: int, sensors: str, transitions: int, movements: int) -> dict[str, Any]:
    """Return what an agent reaches with these ``sensors`` in its state."""
    kinds = () if sensors == NONE else cast(tuple[SensorKind, ...], tuple(sensors.split("+")))
    made, begin = there_and_back.fitted(db, replace(SINGLE_STEPS, seed=seed, sensors=kinds))
    trained = train(made.simulation, begin, PolicySettings(), seed)
    simulated = test(trained.agent, made.simulation, begin, 2_000, seed)
    with Store.open(db) as store:
        goals, state = store.percentiles(), store.state("arm")
    assert state is not None
    with open_arm(name_of(arm), seed) as opened:
        assert isinstance(opened, VirtualArm)
        opened.set_state(state)
        warm = opened.temperature.mean()
        by_day = greedy_movements(trained.agent, opened, goals, movements)
        opened.rest(NIGHT)
        cold = opened.temperature.mean()
        next_day = greedy_movements(trained.agent, opened, goals, movements)
    successes = [one for one in (*by_day, *next_day) if one.success]
    return {
        "arm": arm,
        "seed": seed,
        "sensors": sensors,
        "transitions": transitions,
        "movements": movements,
        "std": made.result.std,
        "simulated": float(simulated.reward.mean()),
        "temperatures": [float(warm), float(cold)],
        "warm": float(np.mean([one.reward for one in by_day])),
        "night": float(np.mean([one.reward for one in next_day])),
        "success": len(successes) / (2 * movements),
        "derived": float(np.mean([_slow_by_angles(one) for one in successes])),
        "fit_seconds": made.result.seconds,
        "train_seconds": trained.seconds,
    }


def greedy_movements(agent: AnyAgent, arm: VirtualArm, goals: NDArray[np.float64], count: int) -> list[Movement]:
    """Return ``count`` greedy movements, the same for all agents."""
    return there_and_back.greedy_movements(agent, arm, goals, range(count), SEED_OF_MOVEMENTS)


def _slow_by_angles(movement: Movement) -> bool:
    """Whether the velocity derived from the last two angles would count as reaching the goal."""
    recorded = movement.recorded
    velocity = np.diff(recorded.angle[-2:], axis=0) / (1e3 * np.diff(recorded.time[-2:]))
    return bool((np.abs(velocity) <= 1).all())


def line(sensors: str, each: list[dict[str, Any]], without: list[dict[str, Any]]) -> str:
    """Return the figures of ``each`` row of a set of sensors, beside those ``without`` any."""

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in each]))

    def difference(name: str) -> str:
        if each is without:
            return ""
        gained: dict[int, list[float]] = {}
        for row, other in zip(each, without, strict=True):
            gained.setdefault(row["arm"], []).append(row[name] - other[name])
        values = np.array([np.mean(of_arm) for of_arm in gained.values()])
        n = len(values)
        half = float(student.ppf(0.975, n - 1) * values.std(ddof=1) / math.sqrt(n)) if n > 1 else math.nan
        return f"{values.mean():+.2f} ± {half:.2f}"

    std = {name: float(np.mean([row["std"][name] for row in each])) for name in ("angle", "velocity")}
    lowest = min(min(row["warm"], row["night"]) for row in each)
    return (
        f"{sensors:>36}{std['angle']:7.2f}{std['velocity']:10.3f}{mean('simulated'):15.2f}{mean('warm'):8.2f}"
        f"{difference('warm'):>15}{mean('night'):8.2f}{difference('night'):>15}{lowest:8.2f}{mean('success'):9.4f}"
        f"{mean('derived'):9.4f}{mean('fit_seconds'):6.1f}s{mean('train_seconds'):6.1f}s"
    )


def _row(rows: Rows, *key: Any) -> dict[str, Any]:
    row = rows.get(*key)
    assert row is not None
    return row
