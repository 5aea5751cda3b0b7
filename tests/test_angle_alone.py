"""Arms that read angles alone: the whole job on one with physics of its own, and what refuses, in one line."""

import json

import numpy as np
import pytest

from pneumarm.arm import guarded, open_arm
from pneumarm.arm.virtual import FrozenPotentiometer
from pneumarm.checkup import measure
from pneumarm.classical import TuneSettings, tune
from pneumarm.commands.run_ import how_it_moves
from pneumarm.console import show
from pneumarm.control import Monitor
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.gym import point_to_point
from pneumarm.transitions import Store, collect, import_recording
from small import exit_status, servo_on

PLAIN, VIRTUAL = "python:tests.plain_arms:angle_alone", "virtual:seed=3,pressure_sensors=off"
MAPPING = """
sequence = "sequence"
time = "time"
commands = "pulses"
[arm]
name = "elsewhere"
period = 0.03333333
pressure_sensors = false
[[joint]]
angle = {column = "angle", unit = "counts"}
command_1 = {column = "command_1"}
command_2 = {column = "command_2"}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the folder and the results of the whole job on an arm with physics of its own."""
    folder = tmp_path_factory.mktemp("angle_alone") / "run"
    return folder, servo_on(PLAIN, folder)


def test_the_whole_job_settles_and_its_report_says_what_was_estimated(run):
    folder, results = run
    assert results["settle"]["settled"] >= 0.9
    assert results["collect"]["findings"] == []
    page = (folder / "report.html").read_text()
    assert "Its pressures are not measured" in page
    assert "estimated pressure" in page


def test_the_terminal_says_how_the_arm_moves(run, capsys):
    _, results = run
    show(results, False, lambda: list(how_it_moves(results)))
    said, settled = capsys.readouterr().out, results["settle"]
    assert f"of {settled['movements']} goals" in said
    assert f"{100 * settled['settled']:.4g} %" in said
    assert f"{settled['median_seconds']:.2f} s" in said
    for one in results["track"]:
        assert f"{one['rms_error_deg'][0]:.2f}°" in said
    assert list(how_it_moves({"settle": None, "track": []})) == []


def test_its_agent_is_refused_by_an_arm_with_pressures_and_moves_its_own(run, capsys):
    folder, _ = run
    agent = str(folder / "agent.safetensors")
    assert exit_status(["move", agent, "--arm", PLAIN, "15deg", "-10deg", "--json"]) == 0
    moved = json.loads(capsys.readouterr().out.splitlines()[-1])["movements"]
    assert all(one["success"] for one in moved)
    assert exit_status(["move", agent, "--arm", "python:tests.plain_arms:with_pressures", "15deg"]) == 2
    assert "without pressure sensors" in capsys.readouterr().err


def test_the_check_up_says_in_one_line_that_it_cannot_judge_such_an_arm(capsys):
    with open_arm(VIRTUAL) as arm, pytest.raises(UnusableInput, match="no pressure sensors"):
        measure(arm)
    assert exit_status(["arm", "check", VIRTUAL]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert exit_status(["arm", "sensors", VIRTUAL, "--seconds", "0.3", "--json"]) == 0
    assert [row["sensor"] for row in json.loads(capsys.readouterr().out.splitlines()[-1])["sensors"]] == ["angle"]


def test_the_monitor_finds_a_frozen_potentiometer_by_the_valves_and_nothing_on_a_sound_arm(tmp_path):
    with open_arm(VIRTUAL) as arm, Store.for_arm(tmp_path / "sound.db", arm.spec) as store:
        watch = Monitor(arm.spec)
        collect(arm, store, 4000, 1, watch=watch)
        assert watch.findings == []
    with open_arm(VIRTUAL) as arm, Store.for_arm(tmp_path / "frozen.db", arm.spec) as store:
        arm.faults = [FrozenPotentiometer(joint=1)]
        with pytest.raises(ArmFailure, match="stays the same while valves act"):
            collect(arm, store, 4000, 1, watch=watch)
    assert {one.kind for one in watch.findings} == {"frozen-potentiometer"}


def test_a_collection_that_was_interrupted_goes_on_bit_for_bit(tmp_path):
    rows = []
    for name, parts in (("whole", [2600]), ("parts", [2000, 2600])):
        for transitions in parts:
            arm = open_arm(VIRTUAL)
            store = Store.append_to(tmp_path / name) if (tmp_path / name).exists() else None
            with arm, store or Store.for_arm(tmp_path / name, arm.spec) as store:
                collect(arm, store, transitions, 4)
                found = np.concatenate([block.pressure for block in store.blocks()])
        rows.append(found)
    assert np.array_equal(*rows)


def test_a_pid_is_tuned_on_estimates():
    with open_arm(VIRTUAL) as arm:
        tuned = tune("pid", arm, TuneSettings(seconds=240))
        controller = tuned.controller()
        guard = guarded(arm)
        controller.reset(np.array([600.0]))
        for _ in range(90):
            guard.decide(controller.act(guard.read()))
            guard.wait(guard.spec.period)
        assert guard.read().angle[0] == pytest.approx(600, abs=60)


def test_a_recording_without_pressures_is_imported_with_estimates(tmp_path):
    lines = ["sequence,time,angle,command_1,command_2"]
    lines += [f"1,{k / 30:.5f},{500 + k},{1 if k < 15 else 0},{-0.5}" for k in range(60)]
    (tmp_path / "r.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "m.toml").write_text(MAPPING)
    import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "s.db")
    with Store.open(tmp_path / "s.db") as store:
        rows = next(iter(store.blocks()))
    assert not store.spec.pressure_sensors
    assert (np.diff(rows.pressure[:15, 0, 0]) > 0).all()
    assert np.ptp(rows.pressure[15:, 0, 0]) == 0
    (tmp_path / "m.toml").write_text(MAPPING.replace("pressure_sensors = false", ""))
    with pytest.raises(UnusableInput, match="needs pressure_1 and pressure_2"):
        import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "other.db")


def test_an_environment_of_such_an_arm_takes_steps():
    env = point_to_point(VIRTUAL)
    observation, _ = env.reset(seed=1)
    following, *_ = env.step(env.action_space.sample())
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(following)
    env.close()
