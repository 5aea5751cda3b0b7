"""``pneumarm tune``, ``move`` and ``track`` on a virtual arm."""

import io
import json
import os
import shutil
import signal
import sys
from contextlib import AbstractContextManager
from pathlib import Path
from subprocess import Popen

import numpy as np
import pytest

from children import LIMIT, child, end, wait_until
from pneumarm.api import load_controller, move, track
from pneumarm.arm import ArmSpec, open_arm
from pneumarm.arm.hand import hand
from pneumarm.cli import main
from pneumarm.commands.common import move_command
from pneumarm.control.versions import agent_file
from pneumarm.transitions import Store
from pneumarm.transitions.rows import Mark, Rows, join_rows

ARM = ("--arm", "virtual:seed=3")


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return int(str(ended.value.code)), out, err


@pytest.fixture(scope="module")
def controller(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("tuned") / "arm.pid"
    with pytest.raises(SystemExit) as ended:
        main(["tune", "pid", *ARM, "--out", str(file), "--seconds", "180", "--json"])
    assert ended.value.code == 0
    return file


def test_what_tuning_used_is_what_it_was_given(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, err = called(capsys, "tune", "pid", *ARM, "--out", tmp_path / "pid", "--seconds", 180, "--json")
    tuned = json.loads(out)
    assert code == 0
    assert 150 < tuned["seconds"] <= 180
    assert tuned["cost"] > 0  # it was measured
    assert "not to find better gains" in err


def test_move_tells_of_every_goal(
    controller: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("# there\n12.5deg\n\n500  # and back\n"))
    code, out, _ = called(capsys, "move", controller, *ARM, "--tries", 3, "0deg", "-5deg", "-", "650", "--json")
    assert code == 0
    assert out.count("\n") == 1
    made = json.loads(out)["movements"]
    assert [one["goal_deg"] for one in made] == [[0], [-5], [12.5], [-1.0107], [12.1726]]
    for one in made:
        assert one["success"] is True
        assert one["time_start"] <= one["time_settled"]
        assert 0 <= one["rest_error_deg"][0] < 1.5
        assert one["switches"] > 0
        assert 1 <= one["tries"] <= 3


def test_the_folder_of_a_run_moves_the_arm_by_the_agent_in_use(
    small_run: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    goals = ("--tries", 1, "--hold", 0.5, "5deg", "--json")
    by_folder = called(capsys, "move", small_run, *ARM, *goals)[1]
    by_file = called(capsys, "move", small_run / "adapted.safetensors", *ARM, *goals)[1]
    assert json.loads(by_folder)["movements"] == json.loads(by_file)["movements"]
    shutil.copy(small_run / "agent.safetensors", tmp_path)  # a run that has not come to adapt
    assert called(capsys, "move", tmp_path, *ARM, *goals)[0] in (0, 1)
    assert agent_file(tmp_path) == tmp_path / "agent.safetensors"
    assert load_controller(small_run).reset(goal_deg=5) is None
    code, _, err = called(capsys, "move", tmp_path.parent, *ARM, "5deg")
    assert code == 2
    assert "neither adapted.safetensors nor agent.safetensors" in err


def test_the_command_to_move_by_is_ready_to_be_called() -> None:
    spec = ArmSpec(joints=2)
    told = move_command(Path("my runs/arm"), "virtual:joints=2", spec, spec.angle_unit * np.array([[300, 700]] * 2))
    assert told == "`pneumarm move 'my runs/arm' --arm virtual:joints=2 10deg,10deg`"
    told = move_command(Path("arm"), "virtual", ArmSpec(), np.array([[300, 400]]))
    assert told == "`pneumarm move arm --arm virtual -14.2deg`"


@pytest.mark.parametrize(
    ("lines", "moved", "words"),
    [
        ("", 0, "standard input: held no goal"),
        ("\n# nothing but words\n", 0, "standard input: held no goal"),
        ("# first\n\nten\n5deg\n", 0, "line 3 of standard input: goal 'ten'"),
        ("5deg\nten\n0deg\n", 1, "line 2 of standard input: goal 'ten'"),
        ("5deg\n90deg\n", 1, "line 2 of standard input: goal '90deg': goals of joint 1 lie from"),
        ("5deg\n\udca9\udc9a\n", 1, "line 2 of standard input: goal '"),
    ],
)
def test_a_line_that_is_no_goal_is_named_and_what_was_done_is_told(
    controller: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, lines: str, moved: int,
    words: str,
) -> None:  # fmt: skip
    given = io.BytesIO(lines.encode("utf-8", "surrogateescape"))  # not all of it is text
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(given, "utf-8"))
    code, out, err = called(capsys, "move", controller, *ARM, "--hold", 1, "--tries", 1, "-", "--json")
    assert code == 2
    assert words in err.splitlines()[-1]
    assert [one["goal_deg"] for one in json.loads(out)["movements"]] == [[5]] * moved


def test_a_simulation_is_planned_in_to_settle_and_to_track(
    small_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = f"plan:{small_run / 'simulation.safetensors'}"
    code, out, _ = called(capsys, "move", plan, *ARM, "--tolerance", 3, "5deg", "--json")
    (moved,) = json.loads(out)["movements"]
    assert code == 0
    assert moved["rest_error_deg"][0] < 3
    sine = "sine:0.5Hz,8deg"
    code, out, _ = called(capsys, "track", plan, *ARM, "--reference", sine, "--seconds", 4, "--json")
    assert code == 0
    assert json.loads(out)["rms_error_deg"][0] < 3  # a joint that stays is off by 5.7


def test_a_goal_can_be_where_the_hand_is_to_be(controller: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with open_arm("virtual:seed=3") as arm:
        x, y = hand([8.0], arm.spec.links)
    code, out, _ = called(capsys, "move", controller, *ARM, "--tries", 3, f"{x:.4f}m,{y:.4f}m", "8deg", "--json")
    placed, angle = json.loads(out)["movements"]
    assert code == 0
    assert placed["goal_deg"] == [pytest.approx(8, abs=0.05)]
    assert placed["goal_xy_m"] == [pytest.approx(x, abs=1e-4), pytest.approx(y, abs=1e-4)]
    assert 0 < placed["rest_error_m"] < 0.01
    assert placed.keys() - angle.keys() == {"goal_xy_m", "rest_error_m"}
    (moved,) = move(controller, "virtual:seed=3", goals_xy=[(x, y)])
    assert moved.hand_error is not None
    assert 0 < moved.hand_error < 0.01
    _, _, err = called(capsys, "move", controller, *ARM, "--tries", 3, f"{x:.4f}m,{y:.4f}m")
    assert f"x {x:.3f} m, y {y:.3f} m (8.0deg): settled" in err


def test_a_movement_that_fails_is_told_of_and_ends_with_1(
    controller: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tolerance = ("--tolerance", "0.01")
    code, out, err = called(capsys, "move", controller, *ARM, "--tries", 1, *tolerance, "10deg", "--json")
    assert code == 1
    assert json.loads(out)["movements"][0]["time_settled"] is None
    assert "did not settle" in err


def test_track_tells_of_the_error(controller: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = called(
        capsys, "track", controller, *ARM, "--reference", "sine:0.5Hz,15deg", "--seconds", 4, "--json"
    )
    followed = json.loads(out)
    assert code == 0
    assert set(followed) == {"time_start", "seconds", "rms_error_deg", "switches", "air_litres"}
    assert followed["seconds"] == pytest.approx(4, abs=0.05)
    assert 0 < followed["rms_error_deg"][0] < 5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("move", "FILE", *ARM), "no goal"),
        (("move", "FILE", *ARM, "90deg"), "often enough to be known"),
        (("move", "FILE", *ARM, "1000"), "often enough to be known"),
        (("move", "FILE", *ARM, "20"), "goal '20' in counts (degrees are 20deg): goals of joint 1 lie from"),
        (("move", "FILE", *ARM, "10deg,5deg"), "expected 1 angle"),
        (("move", "FILE", *ARM, "0.5m,0.5m"), "goals of the hand lie at x"),
        (("move", "FILE", *ARM, "ten"), "expected an angle"),
        (("move", "FILE", *ARM, "--holt", "2", "10deg"), "holt"),
        (("move", "FILE", *ARM, "--hold", "0", "10deg"), "hold"),
        (("move", "none", *ARM, "10deg"), "no file none"),
        (("move", "SIM", *ARM, "10deg"), "simulation.safetensors plans in it"),
        (("track", "SIM", *ARM, "--reference", "sine:1Hz,8deg"), "is a simulation; plan:"),
        (("track", "FILE", *ARM, "--reference", "sine:1Hz,80deg"), "choose a smaller one"),
        (("track", "FILE", *ARM, "--reference", "cosine"), "expected sine"),
        (("track", "FILE", *ARM, "--reference", "sine:1Hz,8deg", "--seconds", "0"), "86400"),
        (("tune", "fuzzy", *ARM, "--out", "x"), "pid, pwm"),
        (("tune", "pid", *ARM, "--out", "missing/x"), "does not exist"),
        (("tune", "pid", *ARM, "--out", "x", "--seconds", "0"), "seconds"),
        (("tune", "pid", *ARM, "--out", "x", "--seconds", "5"), "give 180 or more"),
        (("tune", "pid", "--arm", "virtual:joints=2", "--out", "x", "--seconds", "180"), "give 330 or more"),
    ],
)
def test_unusable_input_is_one_line_and_2(
    controller: Path, small_run: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    files = {"FILE": controller, "SIM": small_run / "simulation.safetensors"}
    code, out, err = called(capsys, *[files.get(one, one) for one in arguments])
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err


def test_what_was_done_is_recorded_and_can_be_shown(
    controller: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    store, film = tmp_path / "moves.db", tmp_path / "moves.gif"
    for command in (
        ("move", controller, *ARM, "10deg", "-5deg", "--hold", 1, "--tries", 1),
        ("track", controller, *ARM, "--reference", "sine:1Hz,5deg", "--seconds", 1),
    ):
        called(capsys, *command, "--record", store, "--json")
    code, out, _ = called(capsys, "view", store, "--sequence", 2, "--out", film, "--json")
    assert (code, json.loads(out)["joints"]) == (0, 1)
    assert film.read_bytes()[:3] == b"GIF"
    code, _, err = called(
        capsys, "move", controller, "--arm", "virtual:seed=3,sensors=velocity", "5deg", "--record", store
    )
    assert code == 2
    assert "another arm" in err


def rows_of(path: Path) -> Rows:
    with Store.open(path) as store:
        store.check()
        return join_rows(store.blocks(marked=True))


def rows_in(path: Path) -> int:
    """Return how many rows are in a store, none before there is one."""
    if not path.exists():
        return 0
    with Store.open(path) as store:
        return sum(one.rows for one in store.catalogue())


RECORDED = {"track": ("--reference", "sine:0.5Hz,8deg", "--seconds"), "move": ("8deg", "--tries", "1", "--hold")}


def recording(command: str, controller: Path, seconds: int, store: Path) -> AbstractContextManager[Popen[str]]:
    """Start a movement of so many ``seconds`` on an arm that does the same each time."""
    asked = (command, controller, "--arm", "python:logged_arm:logged", *RECORDED[command], seconds, "--record", store)
    here = {"cwd": Path(__file__).parent, "env": os.environ | {"PNEUMARM_TEST_LOG": f"{store}.log"}}
    return child(sys.executable, "-m", "pneumarm.cli", *asked, **here)


@pytest.fixture(scope="module", params=RECORDED)
def whole(request: pytest.FixtureRequest, controller: Path) -> tuple[str, Rows]:
    """Return a command, and the rows of 3 s of its movement that it recorded to the end."""
    store = controller.with_name(f"{request.param}.db")
    with recording(request.param, controller, 3, store) as process:
        process.communicate(timeout=LIMIT)
    return request.param, rows_of(store)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_what_was_recorded_is_kept_whatever_ends_the_command(
    number: signal.Signals, whole: tuple[str, Rows], controller: Path, tmp_path: Path
) -> None:
    (command, rows), path, killed = whole, tmp_path / "kept.db", number == signal.SIGKILL
    with recording(command, controller, 3600, path) as process:
        wait_until("rows on disk", lambda: rows_in(path) > 0, process)
        before = rows_in(path)
        _, told = end(process, number)
    assert process.returncode == (-number if killed else 128 + number)
    assert told == ("" if killed else f"pneumarm: interrupted ({number.name}); the arm is closed\n")
    kept = rows_of(path)
    assert len(kept) >= before
    n = min(len(kept), len(rows))
    for name in ("step", "time", "angle", "pressure"):
        np.testing.assert_array_equal(getattr(kept, name)[:n], getattr(rows, name)[:n], err_msg=name)
    np.testing.assert_array_equal(kept.command[: n - 1], rows.command[: n - 1])
    with Store.open(path) as store:
        marks = [mark for of_sequence in store.marks().values() for mark in of_sequence]
    last = int(kept.step[-1])
    assert marks == ([] if killed else [Mark(last, last, f"broke off here: {number.name}")])


def test_the_functions_record_as_the_commands_do(
    controller: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    by_function, by_command = tmp_path / "function.db", tmp_path / "command.db"
    sine, name = "sine:1Hz,5deg", "virtual:seed=3"
    followed = track(controller, name, sine, 1.0, record=by_function)
    (moved,) = move(controller, name, goals_deg=[5], record=str(by_function))
    called(capsys, "track", controller, *ARM, "--reference", sine, "--seconds", 1, "--record", by_command)
    called(capsys, "move", controller, *ARM, "5deg", "--record", by_command)
    mine, other = rows_of(by_function), rows_of(by_command)
    np.testing.assert_array_equal(mine.time[: len(followed.recorded)], followed.recorded.time)
    np.testing.assert_array_equal(mine.angle[-len(moved.recorded) :], moved.recorded.angle)
    for values in ("sequence", "step", "time", "angle", "pressure", "command"):
        np.testing.assert_array_equal(getattr(mine, values), getattr(other, values), err_msg=values)
    with Store.open(by_function) as store, Store.open(by_command) as again:
        assert list(store.catalogue()) == list(again.catalogue())
