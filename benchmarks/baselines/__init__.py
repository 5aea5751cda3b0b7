"""The table of baselines: what planning can achieve, what every method learns, and what it costs to learn it.

python -m benchmarks baselines

On every arm there is one collection and one fit, unless more are asked for, and every baseline gets the same
simulation, begin states and goals: in the simulation those of ``pneumarm test --seed 0``, on the arm those of the
test on arrival of ``pneumarm transfer --seed 0``. Methods of other libraries train through our Gymnasium environment
on the same simulation, where stable-baselines3 and sb3-contrib are installed (the extra ``stable-baselines``).

PNEUMARM_BASELINES_ARMS       virtual arms by seeds, by default those of the held-out arms, "1001,...,1010", or by
                              names divided by blanks, such as "virtual:joints=2,seed=1001 virtual:joints=2,seed=1002"
PNEUMARM_BASELINES_MINUTES    minutes of an arm's time that it is recorded for; by default 200,000 transitions
PNEUMARM_BASELINES_SEEDS      how many agents each method trains, 3
PNEUMARM_BASELINES_RECORDINGS how many recordings of an arm there are, 1; its agents learn from one after the other
PNEUMARM_BASELINES_METHODS    "open loop,closed loop,planning,policy,batched,sarsa,ppo,dqn,qr-dqn:1"; ":1" trains one;
                              "sarsa own" and "sarsa one" are other teams of the thesis' agents, for several joints
PNEUMARM_BASELINES_MOVEMENTS  greedy movements on the arm for each agent, 500
PNEUMARM_BASELINES_PLANNED    how many of them are planned with the true physics; by default all
PNEUMARM_BASELINES_ADAPTING   movements in which agents that learn on the arm then adapt, before they make the others
                              again; 0: they do not
PNEUMARM_BASELINES_TESTS      movements in the simulation, 10,000; a tenth of them for what plans or looks ahead
PNEUMARM_BASELINES_STEPS      steps that the methods of other libraries train for, 450,000
PNEUMARM_BASELINES_FOLDER     what was measured so far, from where a killed run goes on: "runs/baselines"

The folder holds ``baselines.jsonl`` (a row an agent, every movement on the arm in it), ``baselines.html`` and
``baselines.png``, and what was collected and fitted. Several such commands may fill one folder at once, each with
arms of its own; one with all arms then makes the table of what is there.

Training is timed after everything is compiled: wall time, and processor time of all threads together. Baselines of
other libraries run on one thread. p99 is the processor time of a decision at the 99th percentile; wall time where the
true physics is planned with. What planning is ahead by is told of the movements that are planned.
"""

import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import HELD_OUT, names_of
from benchmarks.agents import Timed, prepared, store_of
from benchmarks.baselines.learning import OURS, PLANNING, STABLE, TEAMS, learn
from benchmarks.baselines.table import HEADER, Row, and_adapted, curves, floor, line, pooled, write_page
from pneumarm.arm import open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.bound.reaching import Baseline, BoundSettings, Planned, measure_bound
from pneumarm.console import jsonable, peak_memory
from pneumarm.control import TransferSettings, drawn, make_movements, transfer
from pneumarm.errors import UnusableInput
from pneumarm.learning import Adapts, AnyAgent, Learns, load_agent, test, test_ahead
from pneumarm.learning.planned.agent import PlanAgent
from pneumarm.simulation import Simulation
from pneumarm.task import BeginStates, Movement
from pneumarm.task.movements import Movements, of_rows
from pneumarm.transitions import Store
from pneumarm.transitions.goals import Goals

BOUNDS: dict[str, Baseline] = {"open loop": "open_loop", "closed loop": "closed_loop"}
METHODS = (*BOUNDS, PLANNING, *OURS, *STABLE)
"""Those by default; :data:`TEAMS` are others."""
SEED = 0
"""Of begin states, goals and the arm's noise, the same for all."""


@dataclass(frozen=True)
class Wanted:
    """How much is measured; rows that were measured otherwise are left aside."""

    movements: int
    tests: int
    steps: int
    planned: int
    adapting: int
    minutes: float
    recordings: int = 1


def measure() -> Iterator[str]:
    began = time.perf_counter()
    movements = environment.whole("PNEUMARM_BASELINES_MOVEMENTS", 500)
    wanted = Wanted(
        movements,
        environment.whole("PNEUMARM_BASELINES_TESTS", 10_000),
        environment.whole("PNEUMARM_BASELINES_STEPS", 450_000),
        min(environment.whole("PNEUMARM_BASELINES_PLANNED", movements), movements),
        environment.whole("PNEUMARM_BASELINES_ADAPTING", 0, 0),
        environment.whole("PNEUMARM_BASELINES_MINUTES", 0, 0),
        environment.whole("PNEUMARM_BASELINES_RECORDINGS", 1),
    )
    arms = names_of(environment.text("PNEUMARM_BASELINES_ARMS", HELD_OUT), "virtual:seed=")
    folder = environment.folder("PNEUMARM_BASELINES_FOLDER", "runs/baselines")
    methods = dict(each(environment.text("PNEUMARM_BASELINES_METHODS", ",".join(METHODS) + ":1")))
    if missing := unavailable(methods):
        yield missing
        methods = {name: seeds for name, seeds in methods.items() if name not in STABLE}
    rows: list[Row] = []
    done = read_rows(folder / "baselines.jsonl", wanted)
    yield HEADER
    for arm in arms:
        for method, seeds in methods.items():
            for seed in range(seeds):
                if (row := done.get((arm, method, seed))) is None:
                    row = measured(folder, arm, method, seed, wanted)
                    append(folder / "baselines.jsonl", row)
                for one in and_adapted(row):
                    rows.append(one)
                    yield line(one)
    yield ""
    yield from pooled(rows)
    yield from floor(rows)
    yield from curves(rows)
    write_page(folder, rows)
    yield (
        f"{folder / 'baselines.html'}, {folder / 'baselines.png'}; {time.perf_counter() - began:.0f} s, "
        f"at most {max(peak_memory(), *(row['memory_mb'] for row in rows)):.0f} MB of memory"
    )


def each(methods: str) -> Iterator[tuple[str, int]]:
    """Give methods with the number of their agents; what needs no training is there once."""
    for entry in methods.split(","):
        name, _, seeds = entry.strip().partition(":")
        if name not in (*METHODS, *TEAMS):
            raise UnusableInput(f"no method is called {name!r}; there are {', '.join((*METHODS, *TEAMS))}")
        learns = name in (*OURS, *TEAMS, *STABLE)
        yield name, int(seeds or environment.whole("PNEUMARM_BASELINES_SEEDS", 3)) if learns else 1


def unavailable(methods: dict[str, int]) -> str:
    """Return why methods of other libraries are left out, or nothing."""
    wanted = [name for name in methods if name in STABLE]
    try:
        import sb3_contrib  # noqa: F401
        import stable_baselines3  # noqa: F401
    except ImportError as error:
        return f"left out, {error}: {', '.join(wanted)}" if wanted else ""
    return ""


def read_rows(file: Path, wanted: Wanted) -> dict[tuple[str, str, int], Row]:
    """Return the rows that were measured before by arm, method and seed."""
    found = {}
    for text in file.read_text(encoding="utf-8").splitlines() if file.exists() else []:
        try:
            row = json.loads(text)
        except ValueError:
            continue  # the run was killed while it wrote this line
        if row["wanted"] == vars(wanted):
            found[row["arm"], row["method"], row["seed"]] = row
    return found


def append(file: Path, row: Row) -> None:
    """Add ``row`` on a line of its own, even after one that was cut short."""
    cut = file.exists() and not file.read_bytes().endswith(b"\n")
    with open(file, "a", encoding="utf-8") as opened:
        opened.write(("\n" if cut else "") + json.dumps(jsonable(row)) + "\n")
        opened.flush()
        os.fsync(opened.fileno())


def measured(folder: Path, arm: str, method: str, seed: int, wanted: Wanted) -> Row:
    """Return the row of an agent: what its training took, and what came of it in the simulation and on the arm."""
    goals, recording = prepared(folder, arm, wanted.minutes)[0].goals, seed % wanted.recordings
    place = place_of(folder, recording)
    simulation, begin = prepared(place, arm, wanted.minutes, recording=recording)
    simulation = simulation.with_goals(goals)  # the same movements for all agents of an arm
    row: Row = {"arm": arm, "method": method, "seed": seed, "wanted": vars(wanted), "adapted": None}
    if method in BOUNDS:
        planned = bound(folder, arm, BOUNDS[method], wanted)
        made, p99 = planned.made, planned.results()["decision_ms"]["p99"]
        row |= {"wall": 0.0, "cpu": 0.0, "curve": [], "simulation": None, "unproven": planned.unproven}
        row["at_most"] = planned.results().get("at_most")
    else:
        learned = learn(method, simulation, begin, seed, wanted.steps)
        if method != PLANNING:
            agent = place / f"{store_of(place, arm).stem}-{method.replace(' ', '-')}-{seed}.agent"
            learned.agent.save(agent)
            learned = replace(learned, agent=load_agent(agent))  # what is measured is what anyone could use
        row |= {"wall": learned.wall, "cpu": learned.cpu, "curve": learned.curve}
        row["simulation"] = tested(learned.agent, simulation, begin, wanted.tests)
        rows, p99 = greedy_movements(learned.agent, arm, goals, wanted.movements)
        made = of_rows((one.row() for one in rows), simulation.spec.joints)
        if wanted.adapting and isinstance(learned.agent, Adapts | Learns):
            row["adapted"] = told(adapted(place, learned.agent, arm, wanted))
    return row | told(made) | {"p99_ms": p99, "memory_mb": peak_memory()}


def place_of(folder: Path, recording: int) -> Path:
    """Return where this recording of arms lies, and what is made from it."""
    place = folder / f"recording-{recording}" if recording else folder
    place.mkdir(exist_ok=True)
    return place


def told(made: Movements) -> Row:
    """Return what a row tells of movements, each of them; switches are those of all joints together."""
    return {
        "reward": made.reward.tolist(),
        "success": made.success.astype(int).tolist(),
        "actions": made.actions.tolist(),
        "switches": made.all_switches.tolist(),
    }


def bound(folder: Path, arm: str, baseline: Baseline, wanted: Wanted) -> Planned:
    """Return what planning with the true physics achieves in the first movements of every baseline."""
    simulation, _ = prepared(folder, arm, wanted.minutes)
    settings = BoundSettings(episodes=wanted.planned)
    with open_virtual(arm) as opened:
        return measure_bound(opened, simulation.goals, settings, seed=SEED, baselines=(baseline,))[baseline]


def open_virtual(arm: str) -> VirtualArm:
    """Return the virtual arm of this name.

    Raises:
        UnusableInput: it is another kind of arm.

    """
    opened = open_arm(arm, SEED)
    if not isinstance(opened, VirtualArm):
        opened.close()
        raise UnusableInput(f"{arm}: is no virtual arm, which a table of baselines needs")
    return opened


def adapted(folder: Path, agent: AnyAgent, arm: str, wanted: Wanted) -> Movements:
    """Return the movements of an agent on the arm again after it has learned there; the recording stays as it was."""
    settings = TransferSettings(episodes=wanted.adapting, test_episodes=wanted.movements)
    with tempfile.TemporaryDirectory() as temporary, open_virtual(arm) as opened:
        copy = Path(shutil.copy(store_of(folder, arm), temporary))
        with Store.append_to(copy) as store:
            return transfer(agent, opened, store, settings, seed=SEED).movements["after"]


def tested(agent: AnyAgent, simulation: Simulation, begin: BeginStates, episodes: int) -> dict[str, Any]:
    """Return the figures of a test in the simulation, of the agent as it moves on an arm."""
    slow = max(1, episodes // 10)
    if isinstance(agent, PlanAgent):
        return test(agent, simulation, begin, slow, SEED).results()
    if (ahead := test_ahead(agent, simulation, begin, slow, SEED)) is not None:
        return ahead.results()
    return test(agent, simulation, begin, episodes, SEED).results()


def greedy_movements(agent: AnyAgent, arm: str, goals: Goals, movements: int) -> tuple[list[Movement], float]:
    """Return movements on a virtual arm as on arrival, and the 99th percentile of a decision's time [ms]."""
    controller = Timed(agent)
    controller.reset(agent.goal_range.mean(axis=1))
    with open_virtual(arm) as opened:
        controller.act(opened.read())  # compiles
    with open_virtual(arm) as opened:
        draws = drawn(goals, SEED, range(movements))
        made = list(make_movements(opened, controller, agent.settings, draws, velocity=agent.window.velocity))
    return made, 1e3 * float(np.quantile(controller.seconds[1:], 0.99))
