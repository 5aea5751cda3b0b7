"""Sweeps: every row once, whatever is interrupted, and the same rows however they are computed."""

import json
import os
import re
import signal
import sys
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import pytest
from toy import Toy

from children import child, end, wait_until
from pneumarm.arm import open_arm
from pneumarm.errors import UnusableInput
from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.experiment import LaboratorySettings, Row, run_seed, sorted_rows
from pneumarm.experiments.preparation import SETTINGS, STORE
from pneumarm.experiments.results import write_page
from pneumarm.experiments.row_file import RowWriter, read_trial_rows
from pneumarm.experiments.sweep import ROWS, arm_folder, sweep
from pneumarm.transitions import Store, collect

ROW = Row("virtual", 1, 1, {"sum": 1.5}, 0.25)


def figures(laboratory: Path, name: str = "sum") -> dict[tuple[str, int, int], float]:
    return {row.key: row.figures[name] for row in read_trial_rows(laboratory / "toy" / ROWS)}


def test_every_row_is_computed_once(tmp_path: Path) -> None:
    first = sweep(Toy(), tmp_path, runs=1)
    assert first.computed == len(first.rows.rows) == 6
    second = sweep(Toy(), tmp_path, runs=3, arms=("virtual", "virtual:seed=1"))
    assert second.computed == 30
    assert len(read_trial_rows(tmp_path / "toy" / ROWS)) == len(second.rows.rows) == 36
    assert sweep(Toy(), tmp_path, runs=2).computed == 0
    found = figures(tmp_path)
    assert all(found[arm, t, r] == 10 * t + r + 1000 * len(arm) for arm, t, r in found)
    table = second.rows.table("sum", [1, 2])
    assert table.tolist() == [[10 * t + r + 1000 * arm for arm in (7, 14) for r in (1, 2, 3)] for t in (1, 2)]
    assert second.rows.table("sum", [1], "virtual").shape == (1, 3)


def test_arms_are_prepared_once_and_only_where_rows_are_missing(tmp_path: Path) -> None:
    for _ in range(2):
        sweep(Toy(), tmp_path)
    assert (arm_folder(tmp_path, "virtual") / "prepared").read_text() == "virtual\n"
    assert arm_folder(tmp_path, "simulation:a/b") != arm_folder(tmp_path, "simulation:a-b")


def test_all_trials_of_a_run_share_a_seed(tmp_path: Path) -> None:
    sweep(Toy(), tmp_path, runs=3)
    seeds = figures(tmp_path, "seed")
    by_run = [{seeds["virtual", trial, run] for trial in range(1, 7)} for run in (1, 2, 3)]
    assert [len(found) for found in by_run] == [1, 1, 1]
    assert len(set.union(*by_run)) == 3
    assert run_seed(LaboratorySettings(seed=1), 1) != run_seed(LaboratorySettings(), 1)


def test_other_settings_are_refused(tmp_path: Path) -> None:
    sweep(Toy(), tmp_path)
    with pytest.raises(UnusableInput, match=r"factor: was 10\.0, is 11\.0"):
        sweep(Toy(factor=11.0), tmp_path)
    with pytest.raises(UnusableInput, match="test_episodes: was 10000, is 5"):
        sweep(Toy(), tmp_path, settings=LaboratorySettings(test_episodes=5))
    with pytest.raises(UnusableInput, match="at least 1 run"):
        sweep(Toy(), tmp_path, runs=0)
    (tmp_path / "file").touch()
    with pytest.raises(UnusableInput, match="cannot be written"):
        sweep(Toy(), tmp_path / "file" / "laboratory")
    assert sweep(Toy(), tmp_path / "new" / "laboratory").rows


def test_settings_that_decided_no_row_are_none(tmp_path: Path) -> None:
    """Who misspells an arm begins again with any settings; who names an arm twice means one."""
    with pytest.raises(UnusableInput, match="nosuch"):
        sweep(ALL_GOALS, tmp_path, ["nosuch"])
    with pytest.raises(UnusableInput, match="nosuch"):
        sweep(ALL_GOALS, tmp_path, ["nosuch"], settings=LaboratorySettings(transitions=2400))
    twice = sweep(Toy(), tmp_path, ["virtual", "virtual"])
    assert twice.computed == len(twice.rows.rows) == Toy().runs * len(Toy().trials)


def test_a_line_cut_short_is_computed_again(tmp_path: Path) -> None:
    sweep(Toy(), tmp_path)
    file = tmp_path / "toy" / ROWS
    whole = file.read_bytes()
    for kept in range(len(whole) - 1, len(whole) - 40, -7):
        file.write_bytes(whole[:kept])
        assert len(read_trial_rows(file)) == 11
        assert sweep(Toy(), tmp_path).computed == 1
        assert len(figures(tmp_path)) == len(read_trial_rows(file)) == 12
    file.write_bytes(whole + b"nonsense\n")
    with pytest.raises(UnusableInput, match=r"rows.jsonl, line 13: expected a row"):
        sweep(Toy(), tmp_path)


def test_rows_are_on_disk_as_soon_as_they_are_appended(tmp_path: Path) -> None:
    file = tmp_path / "rows.jsonl"
    with RowWriter(file) as writer:
        writer.append(ROW)
        assert read_trial_rows(file) == [ROW]
        with pytest.raises(UnusableInput, match="is writing to it"):
            RowWriter(file)
    with RowWriter(file) as writer:
        assert writer.rows == [ROW]
    assert read_trial_rows(tmp_path / "none") == []


def test_rows_that_are_missing_are_named() -> None:
    rows = sorted_rows([ROW])
    assert rows.table("sum", [1]).tolist() == [[1.5]]
    with pytest.raises(UnusableInput, match=r"1 rows are missing, the first is \('virtual', 2, 1\)"):
        rows.table("sum", [1, 2])


def test_what_fails_keeps_the_other_rows(tmp_path: Path) -> None:
    with pytest.raises(ArithmeticError, match="trial 6 fails"):
        sweep(Toy(fails=6), tmp_path, runs=1, workers=1)
    assert len(figures(tmp_path)) == 5
    assert sweep(Toy(), tmp_path, runs=1).computed == 1


def test_a_killed_sweep_goes_on(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path; from toy import Toy; from pneumarm.experiments.sweep import sweep;"
        f"sweep(Toy(pause=0.2), Path({str(tmp_path)!r}), workers=1)"
    )
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    file = tmp_path / "toy" / ROWS
    with child(sys.executable, "-c", code, env={**os.environ, "PYTHONPATH": path}) as process:
        wait_until("three rows", lambda: len(read_trial_rows(file)) >= 3, process)
        end(process, signal.SIGKILL)
    there = read_trial_rows(file)
    assert 3 <= len(there) < 12
    done = sweep(Toy(), tmp_path)
    assert done.computed == 12 - len(there)
    assert read_trial_rows(file)[: len(there)] == there
    assert len(figures(tmp_path)) == 12


def test_a_page_is_drawn_from_rows_alone(tmp_path: Path) -> None:
    done = sweep(Toy(), tmp_path)
    page = write_page(Toy(), tmp_path / "toy", Toy().analyse(done.rows), done.rows)
    assert "It does." in page.read_text()
    assert "How the arm moved" not in page.read_text()  # no recording of it is left
    assert '"shape"' in (tmp_path / "toy" / "results.json").read_text()


def test_a_page_plays_the_arm_itself(tmp_path: Path) -> None:
    """Not an arm that was made from it, such as one of its joints, whose recording lies beside its own."""
    arm = "virtual:joints=2,seed=1"
    done = sweep(Toy(), tmp_path, [arm])
    for place, name in (("0", arm), ("1", "virtual:seed=1"), ("2", arm)):
        folder = arm_folder(tmp_path, arm) / place
        folder.mkdir(parents=True)
        (folder / SETTINGS).write_text(json.dumps({"arm": name}))
        if place in ("1", "2"):
            with open_arm(name) as opened, Store.for_arm(folder / STORE, opened.spec) as store:
                collect(opened, store, 2000, 0)
        else:  # what is damaged is left out
            (folder / STORE).write_bytes(b"")
            (folder / SETTINGS).write_text("{")
    page = write_page(Toy(), tmp_path / "toy", Toy().analyse(done.rows), done.rows).read_text()
    assert "How the arm moved" in page
    pictures = [b64decode(data).decode() for data in re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)]
    assert "joint 2" in pictures[0]


def test_a_cluster_gives_the_same_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    here, there = tmp_path / "here", tmp_path / "there"
    sweep(Toy(), here)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    with distributed.LocalCluster(2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        done = sweep(Toy(pause=0.05), there, dask=cluster.scheduler_address)
    assert done.computed == 12
    assert figures(here) == figures(there)
    workers = set(figures(there, "process").values())
    assert os.getpid() not in workers
    assert len(workers) == 2


def test_no_cluster_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("pneumarm.experiments.sweep._PATIENCE", 0.5)
    with pytest.raises(UnusableInput, match=r"tcp://127\.0\.0\.1:1: no scheduler"):
        sweep(replace(Toy(), runs=1), tmp_path, dask="tcp://127.0.0.1:1")
