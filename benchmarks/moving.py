"""Be there, stay there, follow: controllers of all kinds side by side, each with the same arm time to get ready.

python -m benchmarks moving

Every controller moves every arm to the same goals, one after the other, and holds each; then it
follows sinusoids, with their future known and not. Settings come from the environment:

PNEUMARM_MOVING_CONTROLLERS  "agent,pid,pid@200,scheduled,pwm,sliding,sliding@200". ``agent`` is the default agent,
                             ``plan`` plans in its simulation; the others are tuned, at 30 Hz or at that behind @,
                             with pulses, or by whole periods where ``-whole`` is added, such as pid-whole@200
PNEUMARM_MOVING_ARMS         seeds of virtual arms, the ten held-out arms by default; or names divided by blanks
PNEUMARM_MOVING_RANGE        30: goals are within so many degrees of the middle
PNEUMARM_MOVING_TOLERANCE    1: who is within so many degrees of a goal, and stays, has settled
PNEUMARM_MOVING_SEEDS        "0,1,2": of collecting, training and tuning, and of goals and noise
PNEUMARM_MOVING_GOALS        500 for each of them
PNEUMARM_MOVING_MINUTES      20, of arm time to collect or to tune
PNEUMARM_MOVING_SECONDS      30 for each sinusoid
PNEUMARM_MOVING_PROCESSES    2
PNEUMARM_MOVING_FOLDER       where controllers and rows are kept; a call with the same folder goes on where another
                             ended. runs/moving by default
"""

import re
import tempfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import HELD_OUT, Rows, in_processes, names_of
from pneumarm.arm import open_arm
from pneumarm.classical import TuneSettings, tune
from pneumarm.control.named import open_tracking
from pneumarm.experiments import there_and_back
from pneumarm.experiments.there_and_back import Recipe
from pneumarm.learning import train
from pneumarm.moving import Moved, MoveSettings, move, track
from pneumarm.simulation import FitSettings
from pneumarm.task.changes import valve_changes
from pneumarm.task.reference import counts_of, parse_reference
from pneumarm.transitions import CollectSettings

CONTROLLERS = "agent,pid,pid@200,scheduled,pwm,sliding,sliding@200"
HOLD = 2.0
TOLERANCE = 1.0
FREQUENCIES = (0.1, 0.25, 0.5, 1.0, 2.0)
AMPLITUDES = (20.0, 5.0)


@dataclass(frozen=True)
class Plan:
    """What is measured."""

    folder: Path
    goals: int
    minutes: float
    seconds: float
    range: float
    """Goals are drawn uniformly within so many degrees of the middle."""
    tolerance: float
    """[degrees]"""

    def rows(self) -> Rows:
        """Return the rows that were measured already, by this plan and others."""
        return Rows(self.folder / "rows.jsonl", "controller", "arm", "seed", *self.numbers)

    @property
    def numbers(self) -> dict[str, float]:
        """What rows of this plan have in common."""
        names = "goals", "minutes", "seconds", "range", "tolerance"
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class Asked:
    """What the environment asks for; the same for all benchmarks of moving."""

    plan: Plan
    controllers: list[str]
    arms: list[str]
    seeds: list[int]
    processes: int


def asked_for(controllers: str = CONTROLLERS, seeds: str = "0,1,2") -> Asked:
    """Return what is asked for, by default ``controllers`` and ``seeds``."""
    return Asked(
        Plan(
            environment.folder("PNEUMARM_MOVING_FOLDER", "runs/moving"),
            environment.whole("PNEUMARM_MOVING_GOALS", 500),
            environment.number("PNEUMARM_MOVING_MINUTES", 20.0),
            environment.number("PNEUMARM_MOVING_SECONDS", 30.0),
            environment.number("PNEUMARM_MOVING_RANGE", 30.0),
            environment.number("PNEUMARM_MOVING_TOLERANCE", TOLERANCE),
        ),
        environment.words("PNEUMARM_MOVING_CONTROLLERS", controllers),
        names_of(environment.text("PNEUMARM_MOVING_ARMS", HELD_OUT), "virtual:seed="),
        environment.seeds("PNEUMARM_MOVING_SEEDS", seeds),
        environment.whole("PNEUMARM_MOVING_PROCESSES", 2),
    )


def measure() -> Iterator[str]:
    wished = asked_for()
    plan, controllers, arms, seeds = wished.plan, wished.controllers, wished.arms, wished.seeds
    rows, numbers = plan.rows(), plan.numbers.values()
    asked = [(name, arm, seed) for name in controllers for arm in arms for seed in seeds]
    wanted = [one for one in asked if rows.get(*one, *numbers) is None]
    for row in in_processes(measured, [(plan, *one) for one in wanted], wished.processes):
        rows.add(row)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in controllers}
    for one in asked:
        row = rows.get(*one, *numbers)
        assert row is not None
        found[one[0]].append(row)
    yield from settling_table(found)
    yield from tracking_table(found)


def prepared(plan: Plan, name: str, arm: str, seed: int) -> str:
    """Return the name, as on the command line, of a controller for an arm; make it where that is not done yet."""
    ending = f"{re.sub(r'[^0-9a-z]+', '-', arm)}-{seed}-{plan.minutes:g}"
    file = plan.folder / f"{name}-{ending}"
    if name in ("agent", "plan"):
        simulation = plan.folder / f"simulation-{ending}"
        agent = plan.folder / f"agent-{ending}"
        if not agent.exists():
            with tempfile.TemporaryDirectory() as place:
                db = Path(place) / "arm.db"
                recipe = Recipe(minutes=plan.minutes, collect=CollectSettings())
                there_and_back.collect_until(db, arm, seed, recipe)
                made, begin = there_and_back.fitted(db, FitSettings(seed=seed))
            made.simulation.save(simulation)
            train(made.simulation, begin, None, seed).agent.save(agent)
        return f"plan:{simulation}" if name == "plan" else str(agent)
    if not file.exists():
        kind, _, _ = name.partition("@")
        settings = TuneSettings(seconds=60 * plan.minutes, whole_periods=kind.endswith("-whole"))
        with open_arm(arm_for(name, arm), seed) as opened:
            tune(kind.removesuffix("-whole"), opened, settings, seed).save(file)
    return str(file)


def arm_for(name: str, arm: str) -> str:
    """Return the name of an arm, controlled at the rate of the controller ``name``."""
    _, _, rate = name.partition("@")
    return f"{arm},rate={rate}" if rate else arm


def measured(plan: Plan, name: str, arm: str, seed: int) -> dict[str, Any]:
    """Return the row of one controller on one arm."""
    controller = prepared(plan, name, arm, seed)
    random = np.random.default_rng((zlib.crc32(arm.encode()), seed))
    row: dict[str, Any] = {"controller": name, "arm": arm, "seed": seed, **plan.numbers}
    with open_arm(arm_for(name, arm), 1000 + seed) as opened:
        mover, spec, _ = open_tracking(controller, opened, plan.tolerance)
        goals = counts_of(random.uniform(-plan.range, plan.range, (1 + plan.goals, spec.joints)), spec)
        made = move(opened, mover, goals, MoveSettings(hold=HOLD, tries=1, tolerance=plan.tolerance))
        next(made)  # from a vented arm
        row |= settling([*made])
        tracking: dict[str, float] = {}
        for amplitude in AMPLITUDES:
            for frequency in FREQUENCIES:
                for known in (True, False):
                    sine = parse_reference(f"sine:{frequency}Hz,{amplitude}deg", spec, known_ahead=known)
                    followed = track(opened, mover, sine, plan.seconds)
                    tracking[key(amplitude, frequency, known)] = float(followed.rms_error.mean())
    return {**row, "tracking": tracking}


def key(amplitude: float, frequency: float, known: bool) -> str:
    return f"{amplitude:g}deg {frequency:g}Hz {'known' if known else 'unknown'}"


def settling(made: list[Moved]) -> dict[str, Any]:
    """Return the figures of movements to goals."""
    times, moving, holding = [], np.zeros(2), np.zeros(2)  # changes and seconds
    for one in made:
        recorded = one.recorded
        passed = recorded.time - recorded.time[0]
        end = passed[-1] if one.time_settled is None else one.time_settled - recorded.time[0]
        there = int(np.searchsorted(passed, end))
        command = recorded.command[:-1]
        all_changes, first = (int(valve_changes(part).sum()) for part in (command, command[:there]))
        moving += (first, end)
        holding += (all_changes - first, passed[-1] - end)
        times.append(None if one.time_settled is None else end)
    return {
        "settled": times,
        "rest_error": [round(float(one.rest_error.max()), 4) for one in made],
        "overshoot": [round(float(one.overshoot.max()), 3) for one in made],
        "changes_moving": moving[0] / max(moving[1], 1e-9),
        "changes_holding": holding[0] / max(holding[1], 1e-9),
        "air_litres": None if any(one.air is None for one in made) else sum(one.air or 0.0 for one in made),
    }


def settling_table(found: dict[str, list[dict[str, Any]]]) -> Iterator[str]:
    yield (
        f"{'controller':16}{'rows':>5}{'settled':>9}{'lowest':>8}{'median':>8}{'95 %':>7}{'at rest':>9}{'95 %':>7}"
        f"{'beyond':>8}{'changes/s moving':>18}{'holding':>9}{'air [l]':>9}"
    )
    for name, rows in found.items():
        times = [np.array([np.nan if t is None else t for t in row["settled"]]) for row in rows]
        every = np.concatenate(times)
        rest = np.concatenate([row["rest_error"] for row in rows])
        over = np.concatenate([row["overshoot"] for row in rows])
        air = [row["air_litres"] for row in rows]
        yield (
            f"{name:16}{len(rows):5}{np.isfinite(every).mean():9.4f}"
            f"{min(np.isfinite(one).mean() for one in times):8.3f}"
            f"{np.nanmedian(every):6.2f} s{np.quantile(np.nan_to_num(every, nan=HOLD), 0.95):5.2f} s"
            f"{rest.mean():5.2f} deg{np.quantile(rest, 0.95):7.2f}{np.mean(over):4.1f} deg"
            f"{np.mean([row['changes_moving'] for row in rows]):18.1f}"
            f"{np.mean([row['changes_holding'] for row in rows]):9.2f}"
            + ("        -" if None in air else f"{sum(air) / every.size:9.3f}")
        )


def tracking_table(found: dict[str, list[dict[str, Any]]]) -> Iterator[str]:
    yield f"{'rms error [deg]':24}" + "".join(f"{frequency:>7g} Hz" for frequency in FREQUENCIES)
    for amplitude in AMPLITUDES:
        for known in (True, False):
            yield f"{amplitude:g} deg, {'known ahead' if known else 'not known ahead'}"
            for name, rows in found.items():
                errors = [
                    np.mean([row["tracking"][key(amplitude, frequency, known)] for row in rows])
                    for frequency in FREQUENCIES
                ]
                yield f"  {name:22}" + "".join(f"{error:10.2f}" for error in errors)
