"""No path in the package gets to an arm's valves past the guard."""

import ast
from pathlib import Path

import numpy as np
import pytest

import pneumarm
from logged_arm import Logged
from pneumarm.arm import GuardedArm
from pneumarm.arm.cycle import BeginState, ControlCycle
from pneumarm.bound.reaching import BoundSettings, measure_bound
from pneumarm.checkup.measure import _Bench
from pneumarm.cli import main
from pneumarm.control.open_agent import open_agent
from pneumarm.records import demonstrate

SOURCE = Path(pneumarm.__file__).parent

GUARDED = {
    "arm/guard.py": "the guard itself",
    "arm/fill.py": "an arm, behind the guard like any other",
    "arm/corrected.py": "an arm, behind the guard like any other",
    "arm/own.py": "an arm, behind the guard like any other, that closes its valves where its code fails",
    "arm/wrapper.py": "an arm, behind the guard like any other",
    "arm/slower.py": "an arm, behind the guard like any other",
    "arm/serial/board.py": "a controller, which does what it is asked behind the guard",
    "arm/virtual/arm.py": "an arm that sets its own valves on closing and resting",
    "arm/cycle.py": "takes a GuardedArm",
    "transitions/collect.py": "takes a GuardedArm",
    "transitions/fill_times.py": "takes a GuardedArm",
    "arm/serial/emulate.py": "warms up the arm of an emulated board, before anybody can reach it",
    "experiments/valves_closed/inflation.py": "guards its arm",
    "gym/turns.py": "guards its arm",
    "live/learning.py": "an arm, behind the guard like any other",
    "live/session.py": "guards its arm",
    "checkup/leaks.py": "takes a GuardedArm",
    "checkup/measure.py": "takes a GuardedArm",
    "classical/calibration.py": "takes a GuardedArm",
    "commands/arm_.py": "guards its arm",
    "commands/asking.py": "takes a GuardedArm",
}
"""Files that may set valves, and why."""


def test_only_these_files_set_valves():
    calling = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            # Also a mere mention, such as ``partial(arm.set_valves, ...)``.
            if isinstance(node, ast.Attribute) and node.attr in ("set_valves", "set_pulses"):
                calling.add(path.relative_to(SOURCE).as_posix())
    assert calling == set(GUARDED)


def test_who_takes_a_guarded_arm_says_so():
    assert ControlCycle.__annotations__["arm"] is GuardedArm
    assert BeginState.reach.__annotations__["arm"] is GuardedArm
    assert _Bench.__init__.__annotations__["guard"] is GuardedArm


@pytest.fixture
def log(tmp_path, monkeypatch):
    path = tmp_path / "log"
    monkeypatch.setenv("PNEUMARM_TEST_LOG", str(path))
    return path


def test_every_command_that_moves_an_arm_moves_it_through_the_guard(small_run, tmp_path, log):
    (tmp_path / "there.csv").write_text("1,-1\n" * 20 + "-1,1\n" * 20)
    arm, agent, sim = (
        "python:logged_arm:logged",
        small_run / "agent.safetensors",
        small_run / "simulation.safetensors",
    )
    transfer = ("--arm", arm, "--episodes", 2, "--test-episodes", 2)
    for number, arguments in enumerate(
        (
            ("collect", arm, tmp_path / "player.db", "--transitions", 2000, "--controller", tmp_path / "there.csv"),
            ("collect", arm, tmp_path / "agent.db", "--transitions", 2000, "--controller", agent),
            ("transfer", agent, *transfer, "--out", tmp_path / "agent"),
            ("transfer", sim, *transfer, "--out", tmp_path / "planner"),
            ("arm", "check", arm),
            ("arm", "calibrate", arm, "--out", tmp_path / "arm.toml"),
            ("arm", "valves", arm, "--pause", 0),
        )
    ):
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        assert ended.value.code == 0
        check(log, more_than=8 if number == 6 else 50)


def test_demonstrations_move_the_arm_through_the_guard(small_run, log):
    demonstrate(open_agent(small_run / "agent.safetensors"), Logged(), seed=1)
    check(log, more_than=50)


def test_environments_and_the_bound_move_their_arm_through_the_guard(log, monkeypatch):
    gymnasium = pytest.importorskip("gymnasium")
    from pneumarm.gym import register

    register()
    environment = gymnasium.make("pneumarm/PointToPoint-v0", arm=Logged())
    environment.reset(seed=1)
    for _ in range(5):
        environment.step(environment.action_space.sample())
    environment.close()
    check(log, more_than=5)
    monkeypatch.setattr("pneumarm.bound.reaching.VirtualArm", Logged)
    measure_bound(Logged(), np.array([[400.0, 600.0]]), BoundSettings(episodes=2))
    check(log, more_than=10)


def check(log: Path, more_than: int) -> None:
    lines = log.read_text().splitlines()
    log.unlink()
    by = np.array([line.split()[1] for line in lines if line.startswith("set")])
    assert len(by) > more_than
    assert set(by) <= {"guard", "itself"}
