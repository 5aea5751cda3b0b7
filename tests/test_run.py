import csv
import json
import random
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from children import LIMIT, child, end, python, wait_until
from pneumarm.errors import UnusableInput
from pneumarm.run import Run, RunSettings
from pneumarm.transitions import WHOLE_PERIODS, CollectSettings, Store
from small import SMALL
from soak import Attack, amount

TIMES = (
    "peak_memory_mb", "rehearsal_memory_mb", "seconds", "wall_seconds", "compile_seconds",
    "steps_per_second", "steps_per_second_per_core",
)  # fmt: skip
STAGES = ("collect", "simulation", "training", "test", "transfer", "bound")


def results_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "results.json").read_text())
    return found


def without_times(value: Any, inside: str = "") -> Any:
    """Drop what the machine's clock decides; seconds on the arm's clock stay."""
    if isinstance(value, dict):
        timed = ("seconds",) if inside in ("before", "after", "collect") else ()
        return {k: without_times(v, k) for k, v in value.items() if k not in TIMES or k in timed}
    return value


def test_results_have_the_keys_that_are_promised(small_run: Path) -> None:
    results = results_of(small_run)
    assert results["collect"]["transitions"] >= SMALL.transitions
    assert results["collect"]["seconds"] > SMALL.transitions / 30
    assert {"kept", "cells_occupied"} <= results["filter"].keys()
    quantities = {"angle", "velocity", "pressure_1", "pressure_2"}
    assert results["simulation"]["std"].keys() == quantities
    assert {"episodes", "steps", "seconds", "steps_per_second"} <= results["training"].keys()
    figures = {"episodes", "reward", "success_rate", "actions", "switches"}
    assert figures <= results["test"].keys()
    assert figures <= results["transfer"]["before"].keys()
    assert figures <= results["transfer"]["after"].keys()
    assert results["transfer"]["episodes"] == SMALL.transfer.episodes
    assert results["transfer"]["learning_rate"] == SMALL.transfer.learning_rate


def test_the_arm_is_to_be_seen_moving_once_it_was_recorded(tmp_path: Path) -> None:
    """Long before the report: a person waits for the later stages."""
    told: list[str] = []
    run = Run(tmp_path / "run", SMALL, tell=told.append)
    run._begin()
    run._collect()
    picture = tmp_path / "run" / "recorded.svg"
    assert "<animate" in picture.read_text()
    assert str(picture) in told[0]


def test_the_bound_is_told_for_the_movements_of_the_tests(small_run: Path) -> None:
    results = results_of(small_run)
    bound = results["bound"]
    with open(small_run / "episodes.csv", newline="") as file:
        rows = [r for r in csv.DictReader(file) if r["phase"] == "after"][: SMALL.bound_episodes]
    paid = sum(float(r["reward"]) for r in rows) / len(rows)
    for planner in ("open_loop", "closed_loop"):
        assert bound[planner]["episodes"] == SMALL.bound_episodes
        lost = bound["distance"]["after"][planner]
        assert lost["reward"] == pytest.approx(bound[planner]["reward"] - paid)
        assert lost["planned"] - lost["reward"] == pytest.approx(paid)
        assert lost["reward"] > 0  # 30 movements of learning make no planner
    assert "planning with the arm's true physics" in (small_run / "report.html").read_text().replace("&#39;", "'")


def test_the_ledger_agrees_with_the_episodes(small_run: Path) -> None:
    with open(small_run / "episodes.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    transfer = results_of(small_run)["transfer"]
    assert [r["phase"] for r in rows] == ["before"] * 20 + ["learning"] * 30 + ["after"] * 20
    before = [r for r in rows if r["phase"] == "before"]
    assert sum(float(r["reward"]) for r in before) / 20 == pytest.approx(transfer["before"]["reward"])
    for row in rows:
        missed = abs(float(row["angle_end"]) - float(row["goal"]))
        reached = missed <= 25 and abs(float(row["velocity_end"])) <= 1
        assert reached == (row["success"] == "1")
        paid = (50 if reached else -1) - (int(row["actions"]) - 1) - 8 * int(row["switches"])
        assert float(row["reward"]) == paid
        assert reached or int(row["actions"]) == 100


def test_both_tests_on_the_arm_have_the_same_goals(small_run: Path) -> None:
    with open(small_run / "episodes.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    goals = {phase: [r["goal"] for r in rows if r["phase"] == phase] for phase in ("before", "after")}
    assert goals["before"] == goals["after"]


def test_the_movements_are_in_the_store(small_run: Path) -> None:
    with Store.open(small_run / "transitions.db") as store:
        episodes = [entry for entry in store.catalogue() if entry.kind == "episode"]
        assert len(episodes) == 70
        assert all(entry.transitions == entry.info["actions"] for entry in episodes)
        store.check()


def test_a_finished_run_is_not_done_again(small_run: Path) -> None:
    before = (small_run / "results.json").stat().st_mtime_ns
    assert Run(small_run, SMALL).do() == results_of(small_run)
    assert (small_run / "results.json").stat().st_mtime_ns == before


def test_a_folder_is_resumed_with_the_same_settings_only(small_run: Path) -> None:
    with pytest.raises(UnusableInput, match=r"other settings \(transitions was 6000, is 7000\)"):
        Run(small_run, replace(SMALL, transitions=7_000))


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(UnusableInput, match="is not empty"):
        Run(tmp_path, SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_nothing_is_left_behind_by_settings_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match="expected virtual"):
        Run(tmp_path / "run", replace(SMALL, arm="wirtual")).do()
    with pytest.raises(UnusableInput, match="expected a whole number, 1000 or more"):
        replace(SMALL, transitions=100)
    with pytest.raises(UnusableInput, match="1 joint"):
        Run(tmp_path / "run", replace(SMALL, joints=2)).do()
    with pytest.raises(UnusableInput, match="expected virtual"):
        Run(tmp_path / "new" / "run", replace(SMALL, arm="wirtual")).do()
    assert not list(tmp_path.iterdir())


RUN = (
    "-c",
    "import sys; sys.path.insert(0, sys.argv[1]); from small import SMALL; from pathlib import Path;"
    "from pneumarm.run import Run; Run(Path(sys.argv[2]), SMALL).do()",
    Path(__file__).parent,
)


def killed_in(stage: str, folder: Path, after: float) -> None:
    """Start the run and kill it ``after`` seconds into ``stage``."""
    before = STAGES[: STAGES.index(stage)]

    def is_reached() -> bool:
        if not before:
            return (folder / "transitions.db").exists()
        return (folder / "results.json").exists() and before[-1] in results_of(folder)

    with child(sys.executable, *RUN, folder) as process:
        wait_until(stage, is_reached, process)
        time.sleep(after)
        end(process, signal.SIGKILL)


@pytest.mark.long
def test_a_run_killed_in_every_stage_ends_as_if_nothing_had_happened(small_run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "killed"
    for stage, after in zip(STAGES, (0.1, 0.3, 0.3, 0.05, 0.2, 0.1), strict=True):
        killed_in(stage, folder, after)
    python(*RUN, folder, check=True)
    assert without_times(results_of(folder)) == without_times(results_of(small_run))
    assert (folder / "episodes.csv").read_text() == (small_run / "episodes.csv").read_text()
    for name in ("agent.safetensors", "adapted.safetensors", "simulation.safetensors"):
        assert (folder / name).read_bytes() == (small_run / name).read_bytes()


WHOLE = (
    "run", "--arm", "virtual:seed=7", "--seed", "5", "--transitions", "6000", "--bound-episodes", "0",
    "--test-episodes", "300", "--fit.epochs", "10", "--servo.updates", "150",
    "--transfer.episodes", "12", "--transfer.test-episodes", "6",
)  # fmt: skip
"""A run of all stages that takes some seconds."""


def left_behind(folder: Path) -> dict[str, Any]:
    """Return all that a run left, by file, but for what tells how long something took."""
    timed = ("report.html", "results.json", "training.checkpoint", "transitions.db")
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    found: dict[str, Any] = {str(one.relative_to(folder)): one.read_bytes() for one in files if one.name not in timed}
    assert {path.name for path in files} >= set(timed)
    found["results.json"] = without_times(results_of(folder))
    with closing(sqlite3.connect(folder / "transitions.db")) as store:
        for table in ("store", "sequences", "rows", "state", "marks"):
            found[f"transitions.db {table}"] = store.execute(f"SELECT * FROM {table}").fetchall()
    return found


def is_killed(folder: Path, after: float) -> bool:
    """Take up the run in ``folder``, kill it ``after`` seconds; return False where it had done everything before."""
    with child(sys.executable, "-c", "from pneumarm.cli import main; main()", *WHOLE, "--out", folder) as process:
        try:
            _, errors = process.communicate(timeout=after)
        except subprocess.TimeoutExpired:
            end(process, signal.SIGKILL)
            return True
    assert process.returncode == 0, errors
    return False


@pytest.mark.soak
def test_runs_killed_at_any_moment_leave_the_same_bits(tmp_path: Path) -> None:
    rng = random.Random(6)
    attack = Attack("kills of a run at random moments", amount("KILLS", 30))
    assert not is_killed(tmp_path / "compiled", LIMIT)
    begun = time.monotonic()
    assert not is_killed(tmp_path / "whole", LIMIT)
    took = time.monotonic() - begun
    expected, runs = left_behind(tmp_path / "whole"), 0
    while attack.done < attack.total:
        folder = tmp_path / str(runs)
        while attack.done < attack.total and is_killed(folder, rng.uniform(0, took)):
            attack.advance()
        assert attack.done < attack.total or not is_killed(folder, LIMIT)
        found = left_behind(folder)
        assert [name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name)] == []
        runs += 1
    attack.summarise(f"{runs} runs went on after them and left the bits of one that was not killed")


def test_movements_are_planned_for_agents_that_reach_or_where_it_is_asked_for() -> None:
    assert RunSettings().planned == 0
    assert RunSettings(task="reach").planned == 40
    assert RunSettings(bound_episodes=3).planned == 3
    assert RunSettings(task="reach", bound_episodes=0).planned == 0


def test_the_preset_of_the_thesis_collects_its_way_and_its_sizes_where_nothing_else_is_said():
    made = RunSettings().of_the_thesis()
    assert (made.collect, made.transitions, made.transfer.test_episodes) == (WHOLE_PERIODS, 200_000, 500)
    own = RunSettings(collect=CollectSettings(lean=0.5), transitions=5000).of_the_thesis()
    assert (own.collect.lean, own.collect.pulses, own.transitions) == (0.5, CollectSettings().pulses, 5000)
