"""Stay there, whatever comes: a leak, pushes and more payload while goals are held, before and after adaptation.

python -m benchmarks holding

Each controller of :mod:`benchmarks.moving` moves to a goal and holds it, while

    calm      nothing happens, for ten minutes
    leak      one muscle leaks 30 times as much as it did, for ten minutes
    pushes    something pushes with 0.3 N m for 0.2 s, this way and that way in turn, every 4 s
    payload   30 % more payload is put on after 5 s

Errors and changes of valves are those from two seconds on; *back* is the time from a push, or from when the payload
is put on, until the joint stays within a degree. ``agent+`` is the agent after 200 movements of adaptation on the arm
with the leak or the payload. Settings come from the environment, and what is there is not made again, as for
``moving``:

PNEUMARM_MOVING_CONTROLLERS  "agent,agent+,pid"
PNEUMARM_MOVING_ARMS         seeds of virtual arms; the ten held-out arms by default
PNEUMARM_MOVING_SEEDS        "0"
PNEUMARM_MOVING_MINUTES      20, of arm time to collect or to tune
PNEUMARM_MOVING_PROCESSES    2
PNEUMARM_MOVING_FOLDER       runs/moving by default
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks._trials import Rows, in_processes
from benchmarks.moving import TOLERANCE, Plan, arm_for, asked_for, prepared
from pneumarm.arm import ControlCycle, guarded, open_arm
from pneumarm.arm.virtual import Fault, Leak, Payload, Push, VirtualArm
from pneumarm.control import TransferSettings, transfer
from pneumarm.control.named import open_tracking
from pneumarm.learning import load_agent
from pneumarm.moving.movement import played
from pneumarm.task.changes import valve_changes
from pneumarm.task.reference import counts_of
from pneumarm.transitions import Store

CONTROLLERS = "agent,agent+,pid"
GOALS = (-20.0, 0.0, 20.0)
"""[degrees]"""
CALM = 2.0
"""Errors count after so many seconds, in which the goal is reached."""
LONG = 600.0
LEAK = 30.0
PUSH, PUSHED, EVERY, PUSHES = 0.3, 0.2, 4.0, 10
MORE, PUT_ON, LOADED = 0.3, 5.0, 20.0
SECONDS = {"calm": LONG, "leak": LONG, "pushes": EVERY * (PUSHES + 1), "payload": PUT_ON + LOADED}
"""How long a goal is held."""
ADAPTED = TransferSettings(episodes=200, test_episodes=1)


def measure() -> Iterator[str]:
    wished = asked_for(CONTROLLERS, "0")
    plan, controllers, arms, seeds = wished.plan, wished.controllers, wished.arms, wished.seeds
    rows = Rows(plan.folder / "holding.jsonl", "controller", "arm", "seed", "minutes")
    asked = [(name, arm, seed) for name in controllers for arm in arms for seed in seeds]
    wanted = [one for one in asked if rows.get(*one, plan.minutes) is None]
    for row in in_processes(measured, [(plan, *one) for one in wanted], wished.processes):
        rows.add(row)
    yield (
        f"{'':10}{'controller':12}{'rows':>5}{'mean':>10}{'largest':>10}{'back, median':>14}{'longest':>9}"
        f"{'changes/s':>11}"
    )
    for what in SECONDS:
        for name in controllers:
            found = [row for row in (rows.get(*one, plan.minutes) for one in asked if one[0] == name) if row]
            parts = [part for row in found for part in row[what]]
            back = [time for part in parts for time in part["back"]]
            never = sum(time is None for time in back)
            times = [np.inf if time is None else time for time in back]
            shown = f"{np.median(times):12.2f} s{max(times):7.2f} s" if times else f"{'':14}{'':9}"
            yield (
                f"{what:10}{name:12}{len(found):5}{np.mean([part['mean'] for part in parts]):6.2f} deg"
                f"{max(part['largest'] for part in parts):6.2f} deg{shown}"
                f"{np.mean([part['changes'] for part in parts]):11.2f}"
                + (f"   {never} of {len(back)} never" if never else "")
            )


def faults_for(arm: VirtualArm, what: str, begin: float) -> tuple[Fault, ...]:
    """Return what happens to ``arm`` from the time ``begin`` on, when a goal is given."""
    if what == "calm":
        return ()
    if what == "leak":
        return (Leak(factor=LEAK),)
    if what == "payload":
        return (Payload(begin=begin + PUT_ON, mass=MORE * arm.parameters.joints[0].mass),)
    times = begin + EVERY * np.arange(1, PUSHES + 1)
    return tuple(
        Push(begin=float(time), end=float(time) + PUSHED, torque=PUSH * (-1) ** number)
        for number, time in enumerate(times)
    )


def measured(plan: Plan, name: str, arm: str, seed: int) -> dict[str, Any]:
    row: dict[str, Any] = {"controller": name, "arm": arm, "seed": seed, "minutes": plan.minutes}
    for what, seconds in SECONDS.items():
        controller = adapted(plan, arm, seed, what) if name == "agent+" else prepared(plan, name, arm, seed)
        row[what] = []
        with open_arm(arm_for(name, arm), 2000 + seed) as opened:
            assert isinstance(opened, VirtualArm)
            mover, spec, _ = open_tracking(controller, opened, TOLERANCE)
            cycle = ControlCycle(guarded(opened))
            for degrees in GOALS:
                goal = counts_of([degrees], spec)
                opened.faults = ()
                cycle.arm.make_ready()
                begin = opened.read().time
                opened.faults = faults_for(opened, what, begin)
                mover.reset(goal)
                recorded = played(cycle, mover, seconds, lambda time, goal=goal: goal)  # type: ignore[misc]
                passed = recorded.time - begin
                error = np.abs(recorded.angle[:, 0] - goal[0]) / spec.counts_per_degree
                late = passed > CALM
                row[what].append(
                    {
                        "mean": float(error[late].mean()),
                        "largest": float(error[late].max()),
                        "changes": int(valve_changes(recorded.command[late][:-1]).sum()) / (seconds - CALM),
                        "back": times_back(passed, error, what),
                    }
                )
    return row


def times_back(passed: NDArray[np.float64], error: NDArray[np.float64], what: str) -> list[float | None]:
    """Return how long after each disturbance the ``error`` (n,) [deg] is small for good; None where it never is."""
    if what in ("calm", "leak"):
        return []
    begins = [PUT_ON] if what == "payload" else [EVERY * number for number in range(1, PUSHES + 1)]
    ends = [*begins[1:], np.inf]
    found: list[float | None] = []
    for begin, end in zip(begins, ends, strict=True):
        within = (passed >= begin) & (passed < end)
        outside = np.flatnonzero(error[within] > TOLERANCE)
        times = passed[within] - begin
        last = int(outside[-1]) if len(outside) else -1
        found.append(float(times[last + 1]) if last + 1 < len(times) else None)
    return found


def adapted(plan: Plan, arm: str, seed: int, what: str) -> str:
    """Return the file of the agent after adaptation on the arm with a leak or more payload; nothing else teaches."""
    file = Path(prepared(plan, "agent", arm, seed))
    if what in ("calm", "pushes"):
        return str(file)
    changed = file.with_name(f"{file.name}-{what}")
    if not changed.exists():
        with open_arm(arm_for("agent", arm), 3000 + seed) as opened, tempfile.TemporaryDirectory() as place:
            assert isinstance(opened, VirtualArm)
            opened.faults = faults_for(opened, what, -PUT_ON)
            with Store.for_arm(Path(place) / "arm.db", opened.spec) as store:
                transfer(load_agent(file), opened, store, ADAPTED, seed=seed).agent.save(changed)
    return str(changed)
