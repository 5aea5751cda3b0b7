"""The example scripts run, and the front door of the package is quick, typed, and refuses what cannot be done."""

import importlib.util
import inspect
import json
import math
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

import pneumarm
from children import python
from pneumarm.errors import UnusableInput

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder in which first.py has run; it holds arm.db, arm.sim and arm.agent."""
    folder = tmp_path_factory.mktemp("workshop")
    done = python(EXAMPLES / "first.py", "--quick", cwd=folder, check=True)
    (folder / "said.txt").write_text(done.stdout)
    return folder


def test_the_first_script_goes_all_the_way(workshop: Path) -> None:
    said = (workshop / "said.txt").read_text()
    assert "transitions in" in said
    assert said.count("settled after") == 3
    assert (workshop / "movements.png").read_bytes().startswith(b"\x89PNG")
    code = [line for line in (EXAMPLES / "first.py").read_text().split('"""')[2].splitlines() if line]
    assert len(code) <= 25


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("track_a_reference.py", r"RMS error \d"),
        ("tune_a_pid.py", r"<Tuned pid .*, (cost \d|too little time).*\nmove_time [\d.]{1,5}, "),
        ("own_arm.py", "settled after"),
        ("own_learner.py", r"500 Movements: reward"),
    ],
)
def test_an_example_runs(workshop: Path, script: str, words: str) -> None:
    done = python(EXAMPLES / script, cwd=workshop, check=True)
    assert re.search(words, done.stdout), done.stdout


def test_the_example_with_stable_baselines3_runs(workshop: Path) -> None:
    pytest.importorskip(
        "stable_baselines3", reason="stable-baselines3 is not installed: pip install --editable '.[stable-baselines]'"
    )
    done = python(EXAMPLES / "gymnasium_and_sb3.py", 2048, cwd=workshop, check=True)
    assert "500 Movements" in done.stdout


def test_settings_are_looked_for_by_optuna(workshop: Path) -> None:
    pytest.importorskip("optuna")
    done = python(EXAMPLES / "optuna_settings.py", "--quick", cwd=workshop, check=True)
    assert "settled in" in done.stdout
    found = tomllib.loads((workshop / "best.toml").read_text())["train"]["servo"]
    assert found.keys() == {"learning-rate", "precision", "change"}
    options = ("--config", "best.toml", "--servo.updates", 20, "--servo.agents", 1, "--out", "best.agent")
    python("-m", "pneumarm", "train", "arm.sim", "arm.db", *options, cwd=workshop, check=True)


@pytest.mark.parametrize(
    ("script", "module", "words"),
    [
        ("gymnasium_and_sb3.py", "stable_baselines3", "pip install 'pneumarm[stable-baselines]'"),
        ("optuna_settings.py", "optuna", "pip install 'pneumarm[tuning]'"),
        ("ros2_node.py", "rclpy", "install ROS 2"),
    ],
)
def test_an_example_says_what_to_install(tmp_path: Path, script: str, module: str, words: str) -> None:
    program = "import runpy, sys; sys.modules[sys.argv[1]] = None; runpy.run_path(sys.argv[2], run_name='__main__')"
    done = python("-c", program, module, EXAMPLES / script, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n"), words in done.stderr) == (1, 1, True), done.stderr


def test_the_bridge_to_ros_moves_an_arm_and_vents_it(workshop: Path) -> None:
    """All of the example with ROS 2 that is not ROS."""
    spec = importlib.util.spec_from_file_location("ros2_node", EXAMPLES / "ros2_node.py")
    assert spec is not None
    assert spec.loader is not None
    node = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(node)
    with node.Bridge(pneumarm.open_arm("virtual:seed=7"), pneumarm.load_controller(workshop / "arm.agent")) as bridge:
        assert max(bridge.turn().pressure) < 0.1  # nothing moves before there is a goal
        for goal in (0.3, -0.1):
            bridge.go([goal])
            states = [bridge.turn() for _ in range(60)]
            assert states[-1].position == pytest.approx([goal], abs=0.05)
            assert math.copysign(1, max((s.velocity[0] for s in states), key=abs)) == math.copysign(1, goal)
        for wrong in ([9.0], [0.1, 0.1], [math.nan]):
            with pytest.raises(UnusableInput):
                bridge.go(wrong)
        assert bridge.turn().position == pytest.approx([-0.1], abs=0.05)  # and the goal before stays
        bridge.stop()
        assert max([bridge.turn() for _ in range(60)][-1].pressure) < 0.1


def test_importing_is_quick_and_imports_nothing_heavy() -> None:
    heavy = "{'numba', 'numpy', 'matplotlib', 'scipy', 'rich'}"
    done = python("-c", f"import pneumarm, sys; print({heavy} & sys.modules.keys())", check=True)
    assert done.stdout.strip() == "set()"


def test_all_that_is_offered_is_documented_and_typed() -> None:
    assert (Path(pneumarm.__file__).parent / "py.typed").exists()
    for name in pneumarm.__all__:
        offered = getattr(pneumarm, name)
        assert inspect.getdoc(offered)
        hints = inspect.signature(offered)
        assert all(one.annotation is not one.empty for one in hints.parameters.values()), name
        assert hints.return_annotation is not hints.empty, name


def test_goals_are_in_degrees_or_counts_and_within_what_the_arm_does(workshop: Path) -> None:
    controller = pneumarm.load_controller(workshop / "arm.agent")
    low, high = controller.goal_range_deg[0]
    assert f"{low:.0f} to {high:.0f} degrees" in repr(controller)
    with pneumarm.open_arm("virtual:seed=7") as arm:
        reading = arm.read()
        controller.reset(goal_deg=20)
        by_degrees = controller.act(reading)
        controller.reset(goal=sum(arm.spec.angle_range) / 2 + 20 * arm.spec.counts_per_degree)
        np.testing.assert_array_equal(controller.act(reading), by_degrees)
        controller.track("sine:0.5Hz,10deg")  # type: ignore[attr-defined]
        assert controller.act(reading).shape == (1, 2)
    for wrong in ({"goal_deg": high + 1}, {"goal": -3.0}, {}, {"goal": 500, "goal_deg": 1}, {"goal": [500, 500]}):
        with pytest.raises(UnusableInput, match=r"goals of joint|expected one goal|1 finite angle"):
            controller.reset(**wrong)  # type: ignore[arg-type]
    with pytest.raises(UnusableInput, match="goals of joint"):
        pneumarm.move(workshop / "arm.agent", "virtual:seed=7", goals_deg=[90])
    with pytest.raises(UnusableInput, match="expected goals"):
        pneumarm.move(workshop / "arm.agent", "virtual:seed=7")


def test_a_movement_is_shown_in_a_notebook(workshop: Path) -> None:
    (moved,) = pneumarm.move(workshop / "arm.agent", "virtual:seed=7", ["10deg"])
    assert re.fullmatch(r"<Moved to 10.0 deg: settled after \d\.\d\d s, rest error \d\.\d\d deg>", repr(moved))
    assert moved._repr_html_().startswith("<svg")
    assert moved.degrees.shape == (len(moved.time), 1)


def test_its_agent_and_its_recording_are_exported(workshop: Path, tmp_path: Path) -> None:
    for file, out in (("arm.agent", "agent.c"), ("arm.agent", "agent.onnx"), ("arm.db", "arm.csv")):
        done = python("-m", "pneumarm", "export", workshop / file, "--out", tmp_path / out, "--json")
        assert done.returncode == 0, done.stderr
    assert "void servo_act(" in (tmp_path / "agent.c").read_text()
    assert json.loads(done.stdout)["mapping"] == str(tmp_path / "arm.csv.toml")
    for file, out, words in (
        ("arm.sim", "sim.c", "servo and policy"),
        ("arm.db", "arm.xls", ".csv, .parquet"),
        ("arm.db", "arm.onnx", "this is a store"),
    ):
        done = python("-m", "pneumarm", "export", workshop / file, "--out", tmp_path / out)
        assert (done.returncode, words in done.stderr) == (2, True), done.stderr


def test_examples_need_nothing_but_the_package(workshop: Path, tmp_path: Path) -> None:
    """An arm of one's own is opened by name on every command line."""
    shutil.copy(EXAMPLES / "own_arm.py", tmp_path)
    done = python("-m", "pneumarm", "arm", "sensors", "python:own_arm:MyArm", "--seconds", 0.2, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
