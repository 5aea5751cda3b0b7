"""The whole job on an arm with further sensors, which the state takes: collect, fit, train, transfer."""

import json
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import pneumarm
import pneumarm.errors
import pneumarm.gym
from pneumarm.arm import open_arm
from pneumarm.cli import main
from pneumarm.learning import ServoSettings, load_agent
from pneumarm.run import Run, RunSettings, RunTransferSettings
from pneumarm.simulation import FitSettings, Simulation, fit_store
from pneumarm.transitions import Store
from pneumarm.transitions.rows import join_rows

ARM = "virtual:seed=3,sensors=velocity+temperature"
NEEDS = ("joint_1_velocity", "joint_1_temperature_1", "joint_1_temperature_2")
SETTINGS = RunSettings(
    arm=ARM,
    seed=5,
    transitions=2_000,
    test_episodes=100,
    bound_episodes=3,
    fit=FitSettings(epochs=6, sensors=("velocity", "temperature")),
    servo=ServoSettings(agents=1, updates=100, arms=32, validation_movements=50),
    transfer=RunTransferSettings(episodes=12, test_episodes=5),
)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("further") / "run"
    Run(folder, SETTINGS).do()
    return folder


def command(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(one) for one in arguments])
    return int(ended.value.code or 0)


def test_a_run_stores_fits_and_uses_them(done: Path) -> None:
    results = json.loads((done / "results.json").read_text())
    assert list(results["simulation"]["std"])[4:] == list(NEEDS[1:])
    assert 0 < results["simulation"]["relative_error"]["velocity"] < 1
    assert len((done / "episodes.csv").read_text().splitlines()) == 1 + 5 + 12 + 5
    assert results["bound"]["closed_loop"]["episodes"] == 3
    assert (done / "report.html").exists()
    simulation, agent = Simulation.load(done / "simulation.safetensors"), load_agent(done / "agent.safetensors")
    for kept in (simulation, agent):
        assert kept.window.needs == NEEDS == kept.spec.further
    with Store.open(done / "transitions.db") as store:
        rows = join_rows(store)
    low, high = simulation.further_range.T
    temperature = rows.measured[NEEDS[1]]
    assert len(temperature) == len(rows)
    assert (temperature > low[0] - 2).all()
    assert (temperature < high[0] + 2).all()
    follows = (np.diff(rows.sequence) == 0) & (np.diff(rows.step) == 1)
    derived = np.diff(rows.angle[:, 0]) / (1e3 * np.diff(rows.time))
    assert np.corrcoef(derived[follows], rows.measured[NEEDS[0]][1:][follows])[0, 1] > 0.9


def test_success_is_judged_by_the_velocity_that_the_agent_sees(done: Path) -> None:
    with Store.open(done / "transitions.db") as store:
        movements = [entry for entry in store.catalogue() if entry.kind == "episode"]
        rows = join_rows(store.blocks(kinds=["episode"]))
    for entry in movements:
        own = rows.where(rows.sequence == entry.number)
        info, end = entry.info, entry.info["actions"]  # what was held on after the end is recorded, too
        slow = abs(own.measured[NEEDS[0]][end]) <= 1
        assert info["velocity_end"][0] == pytest.approx(own.measured[NEEDS[0]][end], abs=1e-4)
        assert info["success"] == (slow and abs(own.angle[end, 0] - info["goal"][0]) <= 25)


def test_its_agent_moves_an_arm_behind_a_board_and_refuses_one_without_the_sensors(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    agent, few = done / "agent.safetensors", ("--episodes", 2, "--test-episodes", 2)
    with Store.open(done / "transitions.db") as store:
        fit_store(store, FitSettings(epochs=1)).simulation.save(tmp_path / "plain")
    for arm in ("virtual:seed=3", "virtual:seed=3,sensors=temperature", f"simulation:{tmp_path / 'plain'}"):
        assert command("transfer", agent, "--arm", arm, "--out", tmp_path / "none") == 2
        said = capsys.readouterr().err
        assert "lacks joint_1_velocity" in said
        assert "use an arm that has these sensors" in said
        assert not (tmp_path / "none").exists()
    assert command("transfer", agent, "--arm", f"emulated:{ARM}", "--out", tmp_path / "moved", *few, "--json") == 0
    with Store.open(tmp_path / "moved" / "transitions.db") as store:
        assert store.further == NEEDS


def test_a_fit_refuses_sensors_that_the_arm_has_not(done: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    asked = ("--sensors", "acceleration")
    assert command("fit", done / "transitions.db", "--out", tmp_path / "sim", *asked) == 2
    assert "has no sensor of acceleration; it has temperature, velocity" in capsys.readouterr().err


def test_its_controller_acts_on_readings_with_them(done: Path) -> None:
    controller = pneumarm.load_controller(done / "agent.safetensors")
    controller.reset([500.0])
    with open_arm(ARM, 1) as arm:
        for _ in range(3):
            assert controller.act(arm.read()).shape == (1, 2)
            arm.wait(arm.spec.period)
        with pytest.raises(pneumarm.errors.ArmFailure, match="joint_1_velocity"):
            controller.act(replace(arm.read(), velocity=None, time=1e3))


def test_gymnasium_sees_states_with_them(done: Path) -> None:
    simulation = Simulation.load(done / "simulation.safetensors")
    store = done / "transitions.db"
    inside = gymnasium.make(
        "pneumarm/PointToPoint-v0", arm=f"simulation:{done / 'simulation.safetensors'}", transitions=store
    )
    outside = gymnasium.make("pneumarm/PointToPoint-v0", arm=ARM, like=simulation)
    for env in (inside, outside):
        observation, _ = env.reset(seed=1)
        assert observation.shape == (8 * 6 + 7 * 2 + 2 + 1,)
        for _ in range(3):
            observation, *_ = env.step(int(env.action_space.sample()))
            assert env.observation_space.contains(observation)
        env.close()
    with pytest.raises(pneumarm.errors.UnusableInput, match="lacks joint_1_velocity"):
        gymnasium.make("pneumarm/PointToPoint-v0", arm="virtual:seed=3", like=simulation)
