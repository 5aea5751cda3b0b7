"""What is rehearsed beside a run: every stage, on made-up data, of arms of any kind; once for each cache."""

import signal
import sys
from pathlib import Path
from time import monotonic

import pytest

from pneumarm import rehearsal
from pneumarm.arm import open_arm
from pneumarm.learning import ServoSettings
from pneumarm.rehearsal import PARTS, Piece, Rehearsal, rehearse
from pneumarm.run import Run, RunSettings
from pneumarm.simulation import FitSettings

SMALL = ServoSettings(arms=4, hidden=(8, 8))


@pytest.fixture
def marker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(rehearsal, "_REHEARSED", tmp_path / "rehearsed")
    return tmp_path / "rehearsed"


def rehearsed(marker: Path) -> set[str]:
    """Return the parts that are noted as rehearsed."""
    return {found.name.removeprefix(f"{marker.name}-") for found in marker.parent.glob(f"{marker.name}-*")}


@pytest.mark.parametrize("name", ["virtual:seed=2", "virtual:wide,seed=3", "virtual:joints=2,seed=1"])
def test_every_stage_is_rehearsed(name: str, marker: Path, tmp_path: Path) -> None:
    with open_arm(name) as arm:
        piece = Piece(arm.spec, FitSettings(), SMALL, None)
    for part, stages in PARTS.items():
        (tmp_path / part).mkdir()
        assert tuple(rehearse(piece, part, tmp_path / part)) == stages
        assert rehearsed(marker) == {part} | ({"learning"} if part == "moving" else set())


def test_a_rehearsal_is_waited_for_and_ended(marker: Path) -> None:
    with open_arm("virtual:seed=2") as arm:
        piece = Piece(arm.spec, FitSettings(), SMALL, "virtual:seed=2")
    with Rehearsal() as beside:
        beside.begin(piece)
        beside.wait_for("simulation")
        beside.wait_for("bound")
        assert not beside._coming - {"test"}
    assert beside.memory > 100


@pytest.mark.parametrize("says", ["echo simulation", "true"])
def test_a_rehearsal_that_hangs_is_ended_and_not_begun_again(
    says: str, marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does after it has named a stage, or before."""
    hanging = tmp_path / "python"
    hanging.write_text(f"#!/bin/sh\n{says}\ntrap '' TERM\nsleep 20 & wait\n")  # sleep keeps the pipe open
    hanging.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(hanging))
    with open_arm("virtual:seed=2") as arm:
        piece = Piece(arm.spec, FitSettings(), SMALL, None)
    began = monotonic()
    with Rehearsal(patience=1.0) as beside:
        beside.begin(piece)
        process = beside._processes["learning"]
        beside.wait_for("simulation")
        assert (process.returncode is None) == (says != "true")
        beside.wait_for("training")
        assert process.returncode == -signal.SIGKILL
        beside.wait_for("test")  # nothing is waited for any more
    assert 1.0 <= monotonic() - began < 10.0
    assert "learning" in rehearsed(marker)


def test_what_learns_is_waited_for_also_where_what_moves_has_ended_before(
    marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = tmp_path / "python"
    quick.write_text(
        '#!/bin/sh\n[ "$3" = moving ] && exit 0\necho simulation; sleep 1; echo training; sleep 1; echo test\n'
    )
    quick.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(quick))
    with open_arm("virtual:seed=2") as arm, Rehearsal() as beside:
        beside.begin(Piece(arm.spec, FitSettings(), SMALL, None))
        began = monotonic()
        beside.wait_for("test")
        assert monotonic() - began >= 1.5


def test_a_rehearsal_that_fails_is_not_waited_for(
    marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing = tmp_path / "python"
    failing.write_text("#!/bin/sh\nexit 1\n")
    failing.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(failing))
    with open_arm("virtual:seed=2") as arm, Rehearsal() as beside:
        beside.begin(Piece(arm.spec, FitSettings(), SMALL, None))
        beside.wait_for("simulation")
        beside.wait_for("bound")
    assert not rehearsed(marker)


def test_a_rehearsal_that_cannot_begin_is_not_waited_for(
    marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "missing"))
    with open_arm("virtual:seed=2") as arm, Rehearsal() as beside:
        beside.begin(Piece(arm.spec, FitSettings(), SMALL, None))
        beside.wait_for("simulation")
        beside.wait_for("bound")
    assert not rehearsed(marker)


def test_a_second_run_needs_none(marker: Path) -> None:
    for part in PARTS:
        marker.with_name(f"{marker.name}-{part}").touch()
    with open_arm("virtual:seed=2") as arm, Rehearsal() as beside:
        beside.begin(Piece(arm.spec, FitSettings(), SMALL, None))
        beside.wait_for("simulation")
        assert not beside._processes


def test_a_part_that_has_been_is_not_rehearsed_again(marker: Path) -> None:
    marker.with_name(f"{marker.name}-learning").touch()
    with open_arm("virtual:seed=2") as arm, Rehearsal() as beside:
        beside.begin(Piece(arm.spec, FitSettings(), SMALL, None))
        beside.wait_for("training")
        beside.wait_for("settle")
        assert list(beside._processes) == ["moving"]


def test_a_run_of_another_method_begins_none(marker: Path, tmp_path: Path) -> None:
    run = Run(tmp_path / "run", RunSettings(arm="virtual:seed=2", method="sarsa"))
    with open_arm("virtual:seed=2") as arm:
        run._rehearse(arm.spec)
    assert not run._rehearsal._processes
