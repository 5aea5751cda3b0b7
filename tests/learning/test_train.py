"""The training phase as a whole: it learns, it is repeatable, and it survives being killed."""

import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from children import child, end, wait_until
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning import CURVES, Shaping, Training, TrainSettings, test, train
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates

SHORT = TrainSettings(agents=3, max_episodes=2_250, validation_episodes=50)


@pytest.fixture(scope="module")
def full(simulation: Simulation, begin: BeginStates) -> Training:
    return train(simulation, begin, TrainSettings(agents=4, validation_episodes=500), seed=1)


def same(one: Training, other: Training) -> bool:
    """Return whether two training phases came to the same result, bit for bit."""
    weights = all(np.array_equal(a, b) for a, b in zip(one.agent.networks, other.agent.networks, strict=True))
    curves = all(np.array_equal(a, b) for a, b in zip(one.curves, other.curves, strict=True))
    rewards = all(np.array_equal(a.reward, b.reward) for a, b in zip(one.validation, other.validation, strict=True))
    return weights and curves and rewards and np.array_equal(one.steps, other.steps) and one.best == other.best


def test_learns_to_reach_all_goals(full: Training, simulation: Simulation, begin: BeginStates) -> None:
    result = test(full.agent, simulation, begin, 2_000, seed=9)
    assert result.results()["success_rate"] > 0.97
    assert result.results()["reward"] > 20
    assert full.met.any()


def test_a_fresh_agent_does_not(full: Training, simulation: Simulation, begin: BeginStates) -> None:
    fresh = train(simulation, begin, TrainSettings(agents=1, max_episodes=1, learning_rate=0.0), seed=3)
    assert test(fresh.agent, simulation, begin, 500).results()["reward"] < -20


def test_curves_tell_the_story_of_shaping(full: Training) -> None:
    for curve, episodes, met in zip(full.curves, full.episodes, full.met, strict=True):
        rows = dict(zip(CURVES, curve.T, strict=True))
        assert rows["episodes"].tolist() == (500 * np.arange(1, len(curve) + 1)).tolist()
        assert rows["episodes"][-1] == episodes
        growth = rows["deviation"][1:] / rows["deviation"][:-1]
        exceeded = rows["performance"][:-1] > rows["criterion"][:-1]
        inside = (rows["deviation"][1:] < 1023) & (rows["deviation"][1:] > rows["deviation"][0])
        np.testing.assert_allclose(growth[inside], np.where(exceeded, 1.1, 0.97)[inside])
        if met:
            last = curve[-1]
            assert last[1] == 1023
            assert last[3] >= last[2] == pytest.approx(0.95)


def test_best_is_chosen_by_validation(full: Training) -> None:
    rewards = [result.reward.mean() for result in full.validation]
    assert full.best == int(np.argmax(rewards))
    begins = [result.angle_begin for result in full.validation]
    assert all(np.array_equal(begins[0], other) for other in begins)  # baselines move alike


def test_results_count_what_was_done(full: Training) -> None:
    results = full.results()
    assert results["episodes"] == full.episodes.sum()
    assert results["steps"] == full.steps.sum() > results["episodes"]
    assert results["steps_per_second_per_core"] == pytest.approx(results["steps"] / full.core_seconds)
    assert 0 < full.core_seconds < 10 * full.seconds


@pytest.mark.parametrize("settings", [SHORT, replace(SHORT, method="q-learning", trace_decay=0.3, shaping=None)])
def test_threads_do_not_matter_but_seeds_do(
    simulation: Simulation, begin: BeginStates, settings: TrainSettings
) -> None:
    one, two = (train(simulation, begin, settings, seed=5, threads=n) for n in (1, 3))
    assert same(one, two)
    assert one.episodes.tolist() == [2_250] * 3  # cut off in the middle of 500
    assert not same(one, train(simulation, begin, settings, seed=6))


def test_two_joints_learn(simulation: Simulation) -> None:
    """Both reach their goals more often after training than before, with nothing in the code for two."""
    arm = synthetic_simulation(2)
    begin = synthetic_begin_states(arm)
    settings = TrainSettings(agents=1, max_episodes=6_000, validation_episodes=1)
    trained = train(arm, begin, settings, seed=2)
    reached = trained.curves[0][:, 3]
    assert reached[-1] > 0.3
    result = test(trained.agent, arm, begin, 100)
    assert result.switches.shape == (100, 2)
    assert len(result.results()["switches"]) == 2
    fresh = train(arm, begin, replace(settings, max_episodes=1), seed=2).agent
    assert result.reward.mean() > test(fresh, arm, begin, 100).reward.mean()


class Killed(Exception):  # noqa: N818
    pass


def stop_after(rounds: int):  # type: ignore[no-untyped-def]
    def progress(_: object) -> None:
        nonlocal rounds
        rounds -= 1
        if rounds == 0:
            raise Killed

    return progress


def test_resumed_training_is_the_same(
    simulation: Simulation, begin: BeginStates, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pneumarm.learning.training._CHECKPOINT_EVERY", -1.0)
    path, whole = tmp_path / "training", train(simulation, begin, SHORT, seed=5)
    for _ in range(3):
        with pytest.raises(Killed):
            train(simulation, begin, SHORT, seed=5, checkpoint=path, progress=stop_after(1))
    resumed = train(simulation, begin, SHORT, seed=5, checkpoint=path)
    assert same(whole, resumed)
    assert same(whole, train(simulation, begin, SHORT, seed=5, checkpoint=path))  # nothing left to do


def test_killed_process_resumes(simulation: Simulation, begin: BeginStates, tmp_path: Path) -> None:
    """Kill -9 in the middle; what is then on disk leads to the results of an uninterrupted training."""
    settings = TrainSettings(agents=2, max_episodes=20_000, validation_episodes=50, shaping=Shaping(criterion=1.0))
    folder, path = Path(__file__).parent, tmp_path / "training"
    code = (
        "import sys; from pathlib import Path; from synthetic_arm import *; from pneumarm.learning import *\n"
        "import pneumarm.learning.training as module; module._CHECKPOINT_EVERY = 0.0\n"
        "simulation = synthetic_simulation()\n"
        "settings = TrainSettings(agents=2, max_episodes=20_000, validation_episodes=50,\n"
        "    shaping=Shaping(criterion=1.0))\n"
        "train(simulation, synthetic_begin_states(simulation), settings, seed=8, checkpoint=Path(sys.argv[1]))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
    with child(sys.executable, "-c", code, path, env=environment) as process:
        wait_until("a checkpoint", path.exists, process)
        end(process, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    _, arrays = read_arrays(path, "pneumarm training")
    assert 0 < arrays["0.counts"][0] < 20_000  # it was killed in the middle
    resumed = train(simulation, begin, settings, seed=8, checkpoint=path)
    assert same(resumed, train(simulation, begin, settings, seed=8))


def test_a_checkpoint_of_another_training_is_refused(
    simulation: Simulation, begin: BeginStates, tmp_path: Path
) -> None:
    path, tiny = tmp_path / "training", replace(SHORT, max_episodes=1)
    train(simulation, begin, tiny, seed=5, checkpoint=path)
    fewer = BeginStates(begin.window, begin.states[:-1], begin.angle[:-1])
    for states, settings, seed in [(begin, tiny, 6), (begin, replace(tiny, hidden=6), 5), (fewer, tiny, 5)]:
        with pytest.raises(UnusableInput, match="another training"):
            train(simulation, states, settings, seed=seed, checkpoint=path)
    settings, arrays = read_arrays(path, "pneumarm training")
    weights, curve = arrays["1.weights"], arrays["1.curve"]
    for name, array in [("weights", weights[:, :-1]), ("curve", curve[0]), ("counts", None)]:
        broken = {key: value for key, value in arrays.items() if key != f"1.{name}"}
        broken |= {} if array is None else {f"1.{name}": array}
        write_arrays(path, "pneumarm training", settings, broken)
        with pytest.raises(UnusableInput, match=name):
            train(simulation, begin, tiny, seed=5, checkpoint=path)


def test_what_does_not_fit_is_refused(full: Training, simulation: Simulation, begin: BeginStates) -> None:
    other = synthetic_simulation(history=2)
    with pytest.raises(UnusableInput, match="begin states"):
        train(other, begin, SHORT)
    with pytest.raises(UnusableInput, match="continuous"):
        train(replace(simulation, commands="continuous"), begin, SHORT)
    with pytest.raises(UnusableInput, match="history=2"):
        test(full.agent, other, begin)
    with pytest.raises(UnusableInput, match="at least one"):
        test(full.agent, simulation, begin, episodes=0)
    scaling = replace(simulation.scaling, observation_offset=simulation.scaling.observation_offset + 1)
    with pytest.raises(UnusableInput, match="scaled differently"):
        test(full.agent, replace(simulation, scaling=scaling), begin)


def test_a_test_adds_up(full: Training, simulation: Simulation, begin: BeginStates) -> None:
    """Rewards, successes, switches and the ends of the movements agree with their definitions."""
    result = test(full.agent, simulation, begin, 500, seed=2)
    again = test(full.agent, simulation, begin, 500, seed=2)
    assert np.array_equal(result.reward, again.reward)
    others = test(full.agent, simulation, begin, 500, seed=3)
    assert not np.array_equal(result.goal, others.goal)
    ends = np.where(result.success, 50.0, -1.0)
    np.testing.assert_allclose(result.reward, ends - (result.actions - 1) - 8 * result.switches[:, 0])
    inside = (np.abs(result.angle_end - result.goal) <= 25.01) & (np.abs(result.velocity_end) <= 1.0001)
    assert inside[result.success].all()
    assert (result.actions[~result.success] == 100).all()
    assert ((result.actions >= 1) & (result.actions <= 100)).all()
    low, high = simulation.goal_range[0]
    assert low <= result.goal.min() < low + 5
    assert high - 5 < result.goal.max() <= high
    for name, (below, above) in result.results()["intervals"].items():
        assert below <= result.results()[name] <= above
