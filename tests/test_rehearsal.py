"""What is rehearsed beside a run: every stage, on made-up data, of arms of any kind; once for each cache."""

import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import monotonic

import pytest

from pneumarm import rehearsal
from pneumarm.arm import open_arm
from pneumarm.learning import ServoSettings
from pneumarm.rehearsal import PARTS, Rehearsal, WarmUpJob, warm_up_stages
from pneumarm.run import Run, RunSettings
from pneumarm.simulation import FitSettings

SMALL = ServoSettings(arms=4, hidden=(8, 8))


@pytest.fixture
def marker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(rehearsal, "_MARKER", tmp_path / "rehearsed")
    return tmp_path / "rehearsed"


@pytest.fixture
def job() -> WarmUpJob:
    with open_arm("virtual:seed=2") as arm:
        return WarmUpJob(arm.spec, FitSettings(), SMALL, None)


@pytest.fixture
def run_by(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Return what has a script of the shell warm_up_stages in place of Python."""

    def run_by(script: str) -> None:
        python = tmp_path / "python"
        python.write_text(f"#!/bin/sh\n{script}\n")
        python.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(python))

    return run_by


@pytest.mark.parametrize("name", ["virtual:seed=2", "virtual:wide,seed=3", "virtual:joints=2,seed=1"])
def test_every_stage_is_rehearsed(name: str, marker: Path, tmp_path: Path) -> None:
    with open_arm(name) as arm:
        job = WarmUpJob(arm.spec, FitSettings(), SMALL, None)
    for part, stages in PARTS.items():
        (tmp_path / part).mkdir()
        assert tuple(warm_up_stages(job, part, tmp_path / part)) == stages
        marker.write_text("simulation")  # which what moves waits for


def test_a_rehearsal_is_waited_for_and_ended(job: WarmUpJob) -> None:
    rehearsal._MARKER.unlink(missing_ok=True)
    with Rehearsal() as beside:
        beside.begin(replace(job, physics="virtual:seed=2"))
        beside.wait_for("simulation")
        beside.wait_for("bound")
        beside.wait_for("settle")
        assert rehearsal._rehearsed() >= {*PARTS["moving"], "simulation"}
    assert beside.memory > 100


def test_a_stage_is_waited_for_until_it_is_noted(job: WarmUpJob, marker: Path, run_by: Callable[[str], None]) -> None:
    run_by(f"sleep 1; echo simulation >> {marker}; sleep 1; echo training >> {marker}; sleep 20 & wait")
    with Rehearsal() as beside:
        beside.begin(job)
        began = monotonic()
        beside.wait_for("training")
        assert 1.5 <= monotonic() - began < 15.0


@pytest.mark.parametrize("notes", ["echo simulation >> {}", "true"])
def test_a_rehearsal_that_hangs_is_ended_and_not_begun_again(
    notes: str, job: WarmUpJob, marker: Path, run_by: Callable[[str], None]
) -> None:
    """It does after it has noted a stage, or before."""
    run_by(f"{notes.format(marker)}\ntrap '' TERM\nsleep 20 & wait")
    began = monotonic()
    with Rehearsal(patience=1.0) as beside:
        beside.begin(job)
        process = beside._processes["learning"]
        beside.wait_for("simulation")
        assert (process.returncode is None) == (notes != "true")
        beside.wait_for("training")
        assert process.returncode == -signal.SIGKILL
        beside.wait_for("test")  # nothing is waited for any more
        assert 1.0 <= monotonic() - began < 10.0
    with Rehearsal() as another:
        another.begin(job)
        assert not another._processes


@pytest.mark.parametrize("fails", ["exit 1", "kill -9 $$"])
def test_a_rehearsal_that_fails_is_not_waited_for(
    fails: str, job: WarmUpJob, marker: Path, run_by: Callable[[str], None]
) -> None:
    run_by(fails)
    with Rehearsal() as beside:
        beside.begin(job)
        beside.wait_for("simulation")
        beside.wait_for("bound")
    assert not marker.exists()


def test_a_rehearsal_that_cannot_begin_is_not_waited_for(
    job: WarmUpJob, marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "missing"))
    with Rehearsal() as beside:
        beside.begin(job)
        beside.wait_for("simulation")
        beside.wait_for("bound")
    assert not marker.exists()


def test_a_stage_that_has_been_is_not_waited_for_again(
    job: WarmUpJob, marker: Path, run_by: Callable[[str], None]
) -> None:
    run_by("sleep 20 & wait")
    marker.write_text("simulation\ntraining\n")
    with Rehearsal() as beside:
        beside.begin(job)
        began = monotonic()
        beside.wait_for("training")
        assert monotonic() - began < 10.0


def test_a_second_run_needs_none(job: WarmUpJob, marker: Path) -> None:
    marker.write_text("\n".join([*PARTS["learning"], *PARTS["moving"]]))
    with Rehearsal() as beside:
        beside.begin(job)
        beside.wait_for("simulation")
        assert not beside._processes


def test_a_run_of_another_method_begins_none(marker: Path, tmp_path: Path) -> None:
    run = Run(tmp_path / "run", RunSettings(arm="virtual:seed=2", method="sarsa"))
    with open_arm("virtual:seed=2") as arm:
        run._rehearse(arm.spec)
    assert not run._rehearsal._processes
