"""Which constants decide what an arm does, and which do not: each at half and at one and a half times its value.

make constants, or python -m benchmarks constants

The default agents of some arms settle at goals and follow sinusoids, first with all constants as they are. Then each
constant in turn is changed, and the same agents do the same on the same arms with the same noise. A constant that
compiled code uses is changed in a copy of the package; agents are not trained anew. Arms change, so some arms are
moved by the agent of another one. A constant *matters* if figures get worse with half or with one and a half times
its value: fewer goals settled at, or longer times, larger errors or more valve changes, on average over arms and
trainings, with 95 % confidence. What was measured is kept, so an interrupted benchmark goes on. Settings come from
the environment:

PNEUMARM_CONSTANTS_ARMS       names of arms divided by blanks; by default those that are developed on. Of two names
                              with ">" between them, the agent of the first moves the second
PNEUMARM_CONSTANTS_SEEDS      of recordings, fits and trainings, "0,1,2"
PNEUMARM_CONSTANTS_GOALS      goals on each arm, 200
PNEUMARM_CONSTANTS_ONLY       beginnings of names, such as rest or rest._LOOK, divided by commas; by default all
PNEUMARM_CONSTANTS_TIMES      "0.5,1.5"; as good as nothing (1e-9) leaves many a rule out
PNEUMARM_CONSTANTS_PROCESSES  arms that are moved at once, 2
PNEUMARM_CONSTANTS_FOLDER     where recordings, agents and rows are kept; runs/constants by default
"""

import ast
import importlib
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import pneumarm
from benchmarks import _environment as environment
from benchmarks._trials import Rows, in_processes, names_of, recorded
from pneumarm.arm import open_arm
from pneumarm.errors import UnusableInput
from pneumarm.experiments import there_and_back
from pneumarm.learning import goals_of, load_agent, train
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.simulation import FitSettings
from pneumarm.statistics import mean_estimate

ARMS = (
    "virtual:seed=3 virtual:seed=5 virtual:seed=31 virtual:wide,seed=12 virtual:wide,seed=61 virtual:wide,seed=76 "
    "virtual:wide,seed=6001 python:benchmarks.strangers:one_10 python:benchmarks.strangers:one_13 "
    "python:benchmarks.strangers:one_22 python:benchmarks.strangers:two_1 python:tests.friction_arms:joint_4 "
    "virtual:seed=11,muscles=1 virtual:seed=12,pulses=off "
    "virtual:seed=1>virtual:seed=2 virtual:seed=2>virtual:seed=3 virtual:seed=4>virtual:seed=1"
)
"""The arms that are developed on."""
PACKAGE = Path(pneumarm.__file__).parent
ACTING = "rest", "two_ways", "following", "correction", "foresight", "predictive", "commands"
"""Modules of the servo that decide how it acts."""
COMPILERS = {"kernel", "inner", "part"}
FIGURES = "seconds", "rest", "overshoot", "changes", "late", "track"
"""What is compared by ratios, the smaller the better; ``settled`` by differences."""
_NOTHING = 1e-2  # added to what may be 0 before ratios are taken


@dataclass(frozen=True)
class Constant:
    """A number with a name in the source."""

    path: Path
    """Of its module, below the package."""
    name: str
    number: int
    """Which of the numbers of that name it is."""
    value: float
    line: int
    column: int
    end: int
    """Where it stands in the source."""
    compiled: bool
    """Whether compiled code uses it."""

    def __str__(self) -> str:
        return f"{self.path.stem}.{self.name}" + (f"[{self.number}]" if self.number else "")

    def changed(self, factor: float) -> float | int:
        """Return its value times ``factor``; of a whole number another one."""
        if isinstance(self.value, float):
            return self.value * factor
        return math.floor(self.value * factor) if factor < 1 else math.ceil(self.value * factor)


def constants() -> list[Constant]:
    """Return the constants of how an arm is moved, in the order of the modules."""
    paths = [Path("learning", "servo", f"{name}.py") for name in ACTING] + [Path("task", "forecast.py")]
    return [one for path in paths if (PACKAGE / path).exists() for one in constants_in(path)]


def constants_in(path: Path) -> Iterator[Constant]:
    """Give the numbers that names of a module below the package stand for, but 0."""
    tree = ast.parse((PACKAGE / path).read_text(encoding="utf-8"))
    compiled = {
        node.id
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef) and COMPILERS & {_called(one) for one in function.decorator_list}
        for node in ast.walk(function)
        if isinstance(node, ast.Name)
    }
    for name, value in (pair for statement in tree.body for pair in _named(statement)):
        for number, (node, figure) in enumerate(_numbers(value)):
            place = node.lineno, node.col_offset, node.end_col_offset or 0
            yield Constant(path, name, number, figure, *place, name in compiled)


def _named(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Give the names that ``statement`` binds and what to."""
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            yield name, value
        case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
            yield from (
                (name.id, value) for name, value in zip(names, values, strict=True) if isinstance(name, ast.Name)
            )


def _numbers(value: ast.expr) -> Iterator[tuple[ast.Constant, float]]:
    """Give the numbers in ``value`` but 0."""
    for node in ast.walk(value):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value != 0:
            yield node, node.value  # type: ignore[misc]


def _called(decorator: ast.expr) -> str:
    function = decorator.func if isinstance(decorator, ast.Call) else decorator
    return function.id if isinstance(function, ast.Name) else ""


def measure() -> Iterator[str]:
    """Yield a line for each constant."""
    arms = environment.text("PNEUMARM_CONSTANTS_ARMS", ARMS).split()
    names_of(" ".join(arms).replace(">", " "), "virtual:seed=")
    seeds = environment.seeds("PNEUMARM_CONSTANTS_SEEDS", "0,1,2")
    goals = environment.whole("PNEUMARM_CONSTANTS_GOALS", 200)
    only = environment.words("PNEUMARM_CONSTANTS_ONLY", "all")
    factors = environment.numbers("PNEUMARM_CONSTANTS_TIMES", "0.5,1.5")
    processes = environment.whole("PNEUMARM_CONSTANTS_PROCESSES", 2)
    folder = environment.folder("PNEUMARM_CONSTANTS_FOLDER", "runs/constants")
    chosen = [one for one in constants() if only == ["all"] or str(one).startswith(tuple(only))]
    if not chosen:
        raise UnusableInput(f"PNEUMARM_CONSTANTS_ONLY: no constant begins with {' or '.join(only)}")
    cases = [(arm, seed) for arm in arms for seed in seeds]
    for _ in in_processes(partial(prepare, folder), [(arm.split(">")[0], seed) for arm, seed in cases], processes):
        pass
    rows = Rows(folder / "rows.jsonl", "constant", "factor", "arm", "seed", "goals")

    def found(constant: Constant | None, factor: float) -> list[dict[str, Any]]:
        left = [case for case in cases if rows.get(_key(constant), factor, *case, goals) is None]
        for row in in_processes(partial(moved, folder, constant, factor, goals), left, processes):
            rows.add(row)
        known = (rows.get(_key(constant), factor, *case, goals) for case in cases)
        return [row for row in known if row is not None]

    usual = found(None, 1.0)
    yield f"{'':28}{'value':>9}{'times':>7}{'settled':>17}" + "".join(f"{name:>17}" for name in FIGURES)
    for constant in chosen:
        for factor in factors:
            worse, line = compared(found(constant, factor), usual)
            yield f"{constant!s:28}{constant.value:9g}{factor:7g}{line}" + ("  worse" if worse else "")


def _key(constant: Constant | None) -> str:
    return "" if constant is None else str(constant)


def compared(rows: list[dict[str, Any]], usual: list[dict[str, Any]]) -> tuple[bool, str]:
    """Return whether any figure of ``rows`` is surely worse than in the ``usual`` ones, and all in a line."""
    differences = [row["settled"] - before["settled"] for row, before in zip(rows, usual, strict=True)]
    estimates = [mean_estimate(differences)]
    for name in FIGURES:
        ratios = [math.log((row[name] + _NOTHING) / (b[name] + _NOTHING)) for row, b in zip(rows, usual, strict=True)]
        estimates.append(mean_estimate(ratios))
    settled, *others = estimates
    worse = settled.high < 0 or any(one.low > 0 for one in others)
    line = f"{settled.mean:+9.4f} ±{settled.high - settled.mean:6.4f}"
    return worse, line + "".join(f"{math.exp(one.mean):9.3f} ±{one.high - one.mean:6.3f}" for one in others)


def place_of(folder: Path, arm: str, seed: int) -> Path:
    """Return the folder of what was recorded and trained on an ``arm``."""
    name = "".join(character if character.isalnum() else "_" for character in arm)
    return folder / f"{name}_{seed}"


def prepare(folder: Path, arm: str, seed: int) -> dict[str, Any]:
    """Record ``arm``, fit its simulation and train its agent, where that is not done."""
    place = place_of(folder, arm, seed)
    if not (place / "agent").exists():
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        recorded(arm, place / "arm.db", seed)
        made, begin = there_and_back.fitted(place / "arm.db", FitSettings(seed=seed))
        train(made.simulation, begin, seed=seed).agent.save(place / "agent")
    return {}


def moved(folder: Path, constant: Constant | None, factor: float, goals: int, arm: str, seed: int) -> dict[str, Any]:
    """Return how the agent of ``arm`` moves it with a ``constant`` times ``factor``."""
    learned, _, other = arm.partition(">")
    case = place_of(folder, learned, seed) / "agent", other or learned, goals, seed
    if constant is None:
        figures = figures_of(*case)
    elif constant.compiled:
        figures = in_a_copy(constant, factor, *case)
    else:
        with replaced(constant, factor):
            figures = figures_of(*case)
    return {"constant": _key(constant), "factor": factor, "arm": arm, "seed": seed, "goals": goals, **figures}


def figures_of(agent: Path, arm: str, goals: int, seed: int) -> dict[str, Any]:
    """Return the figures of the agent in the file ``agent`` on ``arm``, opened anew."""
    found = load_agent(agent)
    controller = found.controller()
    assert controller is not None
    with open_arm(arm, seed) as opened:
        made = try_moving(opened, controller, goals_of(found), MoveTrialSettings(goals=goals), seed=seed)
    results = made.results()
    settle = results["settle"]
    return {
        "settled": settle["settled"],
        "seconds": settle["median_seconds"] or made.settings.hold,
        "rest": settle["rest_error_deg"],
        "overshoot": settle["overshoot_deg"],
        "changes": settle["valve_changes_per_second"],
        "late": float(np.mean([one.changes_at_rest.mean() for one in made.moved])),
        "track": float(np.mean([one["rms_error_deg"] for one in results["track"]])),
    }


@contextmanager
def replaced(constant: Constant, factor: float) -> Iterator[None]:
    """Let a constant that no compiled code uses be ``factor`` times its value."""
    module = importlib.import_module("pneumarm." + ".".join(constant.path.with_suffix("").parts))
    before = getattr(module, constant.name)
    source = (PACKAGE / constant.path).read_text(encoding="utf-8")
    namespace = dict(vars(module))
    exec(compile(_statement(edited(source, constant, factor), constant.name), str(constant.path), "exec"), namespace)
    setattr(module, constant.name, namespace[constant.name])
    try:
        yield
    finally:
        setattr(module, constant.name, before)


def _statement(source: str, name: str) -> ast.Module:
    """Return the statement of ``source`` that binds ``name``."""
    return ast.Module([one for one in ast.parse(source).body if name in dict(_named(one))], [])


def edited(source: str, constant: Constant, factor: float) -> str:
    """Return ``source`` with ``constant`` times ``factor``."""
    lines = source.splitlines(keepends=True)
    line = lines[constant.line - 1]
    lines[constant.line - 1] = line[: constant.column] + repr(constant.changed(factor)) + line[constant.end :]
    return "".join(lines)


def in_a_copy(constant: Constant, factor: float, agent: Path, arm: str, goals: int, seed: int) -> dict[str, Any]:
    """Return :func:`figures_of` by a copy of the package in which ``constant`` is ``factor`` times its value."""
    with tempfile.TemporaryDirectory() as temporary:
        copy = Path(temporary) / "pneumarm"
        shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
        source = (copy / constant.path).read_text(encoding="utf-8")
        (copy / constant.path).write_text(edited(source, constant, factor), encoding="utf-8")
        paths = [temporary, str(Path(__file__).parent.parent)]
        asked = f"figures_of(Path({str(agent.resolve())!r}), {arm!r}, {goals}, {seed})"
        code = f"import sys; sys.path[:0] = {paths}; from benchmarks.constants import *; print(json.dumps({asked}))"
        here = {"PATH": os.defpath, "PNEUMARM_CACHE": str(copy.with_name("cache"))}
        command = [sys.executable, "-c", code]
        told = subprocess.run(command, env=here, check=True, capture_output=True, text=True).stdout
    figures: dict[str, Any] = json.loads(told.splitlines()[-1])
    return figures
