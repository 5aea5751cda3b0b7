"""`pneumarm view`: stretches of movement out of stores and runs, as pictures and films."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pneumarm.arm import ArmSpec
from pneumarm.drawing.drawn_arm import DrawnArm, Pose
from pneumarm.drawing.moving_arm import Shown, moving_arm
from pneumarm.errors import UnusableInput
from pneumarm.report.figures.film import movement
from pneumarm.report.shown import read_shown
from pneumarm.report.viewing import write_view
from pneumarm.transitions import Store
from pneumarm.transitions.rows import Recorded

SPEC = ArmSpec(name="built")
PERIOD = SPEC.period


def recorded(begin: float, rows: int = 31, goal: float | None = None, reference: str | None = None) -> Recorded:
    time = begin + PERIOD * np.arange(rows)
    command = np.zeros((rows, 1, 2))
    command[0], command[-1] = (1.0, -0.5), np.nan
    info = {"goal": [goal]} if goal is not None else {"reference": reference} if reference else {}
    angle = 500 + 50 * np.sin(time)[:, None]
    return Recorded(time, angle, np.full((rows, 1, 2), 80.0), command, np.arange(rows), info=info)


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """Return a store with an old sequence, and three that follow on each other."""
    with Store.create(tmp_path / "moves.db", SPEC) as store:
        last = 100 + 30 * PERIOD
        store.append_all(
            [
                recorded(0.0, goal=1.0),
                recorded(100.0, goal=450.0),
                recorded(last, reference="sine:0.5Hz,10deg"),
                recorded(last + 30 * PERIOD + 1),
            ]
        )
    return tmp_path / "moves.db"


def test_the_last_sequences_are_shown_as_far_as_they_follow_on_each_other(store: Path) -> None:
    shown = read_shown(store)
    assert shown.time[0] == 0
    assert shown.time[-1] == pytest.approx(4.0)
    assert shown.wanted is not None
    assert (shown.wanted[:31] == 450).all()
    assert shown.wanted[31:62].max() == pytest.approx(511.5 + 10 * SPEC.counts_per_degree, abs=1)
    assert np.isnan(shown.wanted[62:]).all()
    assert shown.command is not None
    assert np.isfinite(shown.command).all()


def test_a_part_of_one_sequence_is_shown(store: Path) -> None:
    shown = read_shown(store, sequence=1, begin=0.5, seconds=0.3)
    assert shown.time[-1] == pytest.approx(0.3, abs=PERIOD)
    assert (np.asarray(shown.wanted) == 1.0).all()
    with pytest.raises(UnusableInput, match="there are 1 to 4"):
        read_shown(store, sequence=5)
    with pytest.raises(UnusableInput, match="nothing to show from 9 s on"):
        read_shown(store, sequence=1, begin=9.0)


def test_a_run_is_shown_by_its_movements(small_run: Path) -> None:
    of_run, of_one = read_shown(small_run), read_shown(small_run / "demonstration-00.safetensors")
    assert of_run.spec == of_one.spec
    assert of_one.pressure is not None
    assert of_one.wanted is not None


def test_a_film_a_picture_and_one_for_the_browser_are_written(store: Path, tmp_path: Path) -> None:
    shown = read_shown(store, sequence=2)
    for name in ("moves.gif", "moves.png", "moves.svg"):
        write_view(shown, tmp_path / name)
    with Image.open(tmp_path / "moves.gif") as film:
        assert film.n_frames == 13  # type: ignore[attr-defined]
        first = np.asarray(film.convert("RGB"))
        film.seek(6)
        assert (first != np.asarray(film.convert("RGB"))).any()
    with Image.open(tmp_path / "moves.png") as picture:
        assert picture.size[0] > 800
    assert "<animateTransform" in (tmp_path / "moves.svg").read_text()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
def test_an_mp4_is_written(store: Path, tmp_path: Path) -> None:
    write_view(read_shown(store, sequence=2), tmp_path / "moves.mp4")
    assert (tmp_path / "moves.mp4").read_bytes()[4:8] == b"ftyp"


def test_what_cannot_be_written_is_said(store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    shown = read_shown(store)
    for name, words in (("a.mp4", "ffmpeg"), ("a.avi", "ends in .gif"), ("missing/a.gif", "does not exist")):
        with pytest.raises(UnusableInput, match=words):
            write_view(shown, tmp_path / name)


def test_two_joints_are_a_chain() -> None:
    spec = replace(SPEC, joints=2, links=(0.1, 0.1))
    shapes = DrawnArm.of(spec).placed(Pose(np.array([90.0, -90.0]), np.zeros((2, 2)), np.zeros((2, 2))))
    *_, weight = (shape for shape, _ in shapes if shape.kind == "weight")
    np.testing.assert_allclose((weight.points.min(axis=0) + weight.points.max(axis=0)) / 2, [100, 100], atol=1e-9)
    time = np.linspace(0, 1, 11)
    two = Shown(
        replace(SPEC, joints=2), time, np.full((11, 2), 500.0), None, np.ones((11, 2, 2)), np.ones((11, 2, 2))
    )
    assert len(movement(two).axes) == 4


def test_without_a_goal_none_is_drawn() -> None:
    time = np.linspace(0, 1, 11)
    drawn = moving_arm(Shown(SPEC, time, np.full((11, 1), 500.0)))
    assert "asked for" not in drawn
