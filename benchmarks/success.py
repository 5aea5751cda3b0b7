"""How surely the agent for reaching reaches its goals after transfer: many movements on each arm, every failure kept.

python -m benchmarks success

The agent is made as ``pneumarm run`` makes it, by its defaults; it moves greedily and learns nothing. Movements are
made in blocks, each on the arm as it is when newly opened, so that they can be made at once and in any order; the
begin state and the goal of a movement depend on its number alone. Settings come from the environment:

PNEUMARM_SUCCESS_ARMS       seeds of virtual arms; the ten held-out arms by default
PNEUMARM_SUCCESS_MOVEMENTS  on each arm, 5000
PNEUMARM_SUCCESS_PROCESSES  1
PNEUMARM_SUCCESS_FOLDER     where agents and rows are kept; a call with the same folder goes on where another ended.
                            runs/success by default

A failed movement is kept as a row of ``failures.jsonl`` there, with its number, goal and all that was read and set.
"""

import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import HELD_OUT, Rows, collected, fitted, greedy_movements
from benchmarks.agents import kind
from pneumarm.learning import PolicySettings, load_agent, train
from pneumarm.statistics import mean_estimate, rate_estimate
from pneumarm.task import Movement

SEED = 0
"""Of everything but the arm, as ``pneumarm run`` has it."""
TRANSITIONS = 200_000
BLOCK = 500
KINDS_OF_FAILURE = tuple(
    f"{how} {where} the goal" for how in ("stands still", "moves about") for where in ("near", "far from")
)
HEADER = f"{'arm':8}{'movements':>10}{'failed':>8}{'success':>28}{'reward':>17}{'actions':>9}{'switches':>10}"


def measure() -> Iterator[str]:
    folder = environment.folder("PNEUMARM_SUCCESS_FOLDER", "runs/success")
    arms = environment.seeds("PNEUMARM_SUCCESS_ARMS", HELD_OUT)
    blocks = -(-environment.whole("PNEUMARM_SUCCESS_MOVEMENTS", 5000) // BLOCK)
    processes = environment.whole("PNEUMARM_SUCCESS_PROCESSES", 1)
    rows = Rows(folder / "blocks.jsonl", "arm", "block")
    failures = Rows(folder / "failures.jsonl", "arm", "number")
    yield HEADER
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for arm in arms:
            prepare(folder, arm)
            wanted = [block for block in range(blocks) if rows.get(arm, block) is None]
            for row, failed in pool.map(make_block, [folder] * len(wanted), [arm] * len(wanted), wanted):
                for failure in failed:  # before the row that counts them
                    failures.add(failure)
                rows.add(row)
            yield line(str(arm), [row for row in rows if row["arm"] == arm and row["block"] < blocks])
    chosen = [row for row in rows if row["arm"] in arms and row["block"] < blocks]
    yield line("all", chosen)
    yield from table(arms, [one for one in failures if one["arm"] in arms and one["number"] < blocks * BLOCK])


def prepare(folder: Path, arm: int) -> Path:
    """Return the file of the agent for an arm; collect, fit and train where that is not done yet."""
    file = folder / f"{arm}.agent"
    if not file.exists():
        with tempfile.TemporaryDirectory() as place:
            db = Path(place) / "arm.db"
            collected(db, arm, SEED, TRANSITIONS)
            made, begin = fitted(db, SEED)
        train(made.simulation, begin, PolicySettings(), SEED).agent.save(file)
    return file


def make_block(folder: Path, arm: int, block: int) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the row of a block of movements, and one of each that failed."""
    agent = load_agent(folder / f"{arm}.agent")
    numbers = range(block * BLOCK, (block + 1) * BLOCK)
    made = greedy_movements(agent, arm, agent.goal_range, numbers, seed=block)
    row = {
        "arm": arm,
        "block": block,
        "reward": [float(one.reward) for one in made],
        "success": [int(one.success) for one in made],
        "actions": [one.actions for one in made],
        "switches": [int(one.switches.sum()) for one in made],
    }
    failed = [failure(arm, number, one) for number, one in zip(numbers, made, strict=True) if not one.success]
    return row, failed


def failure(arm: int, number: int, movement: Movement) -> dict[str, Any]:
    """Return all there is to know of a movement that failed."""
    recorded = movement.recorded
    return {
        "arm": arm,
        "number": number,
        "block": number // BLOCK,
        "kind": kind(movement),
        "goal": movement.goal.tolist(),
        "actions": movement.actions,
        "switches": movement.switches.tolist(),
        "time": np.round(recorded.time, 4).tolist(),
        "angle": recorded.angle.tolist(),
        "pressure": recorded.pressure.tolist(),
        "command": recorded.command.tolist(),
    }


def line(name: str, rows: list[dict[str, Any]]) -> str:
    """Return the figures of ``rows`` as a line of the table."""
    reward, success, actions, switches = (
        np.concatenate([row[key] for row in rows]) for key in ("reward", "success", "actions", "switches")
    )
    rate, mean = rate_estimate(success.astype(bool)), mean_estimate(reward)
    return (
        f"{name:8}{len(success):10,}{int((success == 0).sum()):8}"
        f"{f'{rate.mean:.5f} ({rate.low:.5f}..{rate.high:.5f})':>28}"
        f"{f'{mean.mean:.2f} ± {mean.high - mean.mean:.2f}':>17}{actions.mean():9.2f}{switches.mean():10.3f}"
    )


def table(arms: list[int], failures: list[dict[str, Any]]) -> Iterator[str]:
    """Yield how many failures there are of each kind, and on which arms."""
    if not failures:
        yield "no movement failed"
        return
    for name in KINDS_OF_FAILURE:
        found = Counter(one["arm"] for one in failures if one["kind"] == name)
        where = ", ".join(f"{found[arm]} on {arm}" for arm in arms if found[arm])
        yield f"{name:28}{sum(found.values()):6}  {where}"
    for one in failures:
        angle, goal = np.array(one["angle"]), np.array(one["goal"])
        nearest = np.abs(angle[1:] - goal).max(axis=1).min()
        yield (
            f"  arm {one['arm']}, movement {one['number']}: {one['kind']}; goal {goal.round()}, from {angle[0]} to "
            f"{angle[-1]}, at the nearest {nearest:.0f} counts off, {sum(one['switches'])} switches"
        )
