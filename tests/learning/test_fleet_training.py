"""Learning in many arms: it learns, it is reproducible whatever the threads, and it goes on after a kill."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm import Reading
from pneumarm.arm.valves import CLOSED
from pneumarm.control import AgentController
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning import (
    BatchedSettings,
    Learns,
    PolicyAgent,
    PolicySettings,
    Training,
    TrainSettings,
    load_agent,
    results_with_lookahead,
    test,
    test_ahead,
    train,
)
from pneumarm.learning.policy.agent import KIND, PolicyLearner, with_longer_cutoff
from pneumarm.learning.training import CHECKPOINT
from pneumarm.simulation import SimulationArm
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates

POLICY = PolicySettings(updates=30, arms=32, steps=16, hidden=(8,), validation_episodes=50, lookahead=18)
BATCHED = BatchedSettings(updates=100, arms=32, steps=16, hidden=4, validation_episodes=50)
SETTINGS = {"policy": POLICY, "batched": BATCHED}


class Killed(Exception):  # noqa: N818
    pass


@pytest.fixture(scope="module")
def trained(simulation: Simulation, begin: BeginStates) -> dict[str, Training]:
    return {name: train(simulation, begin, settings, seed=1, threads=1) for name, settings in SETTINGS.items()}


@pytest.fixture(scope="module")
def agent(trained: dict[str, Training]) -> PolicyAgent:
    return trained["policy"].agent


def test_slow_muscles_have_more_actions_until_a_movement_is_cut_off(simulation: Simulation) -> None:
    needed = [
        with_longer_cutoff(PolicySettings(cutoff=10, fillings=fillings), simulation).cutoff for fillings in (1, 2, 4)
    ]
    assert needed[0] > 10
    np.testing.assert_allclose(needed, needed[0] * np.array([1, 2, 4]), atol=3)
    assert with_longer_cutoff(PolicySettings(), simulation).cutoff == max(100, needed[1])
    assert with_longer_cutoff(PolicySettings(cutoff=10, fillings=0), simulation).cutoff == 10


@pytest.mark.parametrize("method", SETTINGS)
def test_it_learns(method: str, trained: dict[str, Training], simulation: Simulation, begin: BeginStates) -> None:
    curves, n = np.stack(trained[method].curves), SETTINGS[method].agents
    assert curves.shape == (n, SETTINGS[method].updates // 10, 3)
    assert (curves[:, -1, 1] > curves[:, 0, 1] + 10).all()  # rewards
    tested = test(trained[method].agent, simulation, begin, 200)
    assert tested.success.mean() > 0.9
    assert tested.reward.mean() > curves[:, 0, 1].max()


@pytest.mark.parametrize("method", SETTINGS)
def test_the_number_of_threads_changes_nothing(
    method: str, trained: dict[str, Training], simulation: Simulation, begin: BeginStates
) -> None:
    again = train(simulation, begin, SETTINGS[method], seed=1, threads=2)
    np.testing.assert_array_equal(again.agent.weights(), trained[method].agent.weights())
    np.testing.assert_array_equal(again.curves, trained[method].curves)
    other = train(simulation, begin, SETTINGS[method], seed=2, threads=2)
    assert not np.array_equal(other.agent.weights(), trained[method].agent.weights())


@pytest.mark.parametrize("method", SETTINGS)
def test_a_killed_training_goes_on_bit_for_bit(
    method: str,
    trained: dict[str, Training],
    simulation: Simulation,
    begin: BeginStates,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pneumarm.learning.training._CHECKPOINT_EVERY", 0.0)
    checkpoint = tmp_path / "checkpoint"

    def kill(now: object) -> None:
        raise Killed

    for _ in range(2):  # each time a little further
        with pytest.raises(Killed):
            train(simulation, begin, SETTINGS[method], seed=1, checkpoint=checkpoint, progress=kill)
    resumed = train(simulation, begin, SETTINGS[method], seed=1, checkpoint=checkpoint)
    np.testing.assert_array_equal(resumed.agent.weights(), trained[method].agent.weights())
    np.testing.assert_array_equal(resumed.curves, trained[method].curves)
    np.testing.assert_array_equal(resumed.episodes, trained[method].episodes)
    np.testing.assert_array_equal(resumed.steps, trained[method].steps)

    with pytest.raises(UnusableInput, match="checkpoint of another training"):
        train(simulation, begin, SETTINGS[method], seed=2, checkpoint=checkpoint)
    settings, arrays = read_arrays(checkpoint, CHECKPOINT)
    write_arrays(checkpoint, CHECKPOINT, settings, {**arrays, "0.counts": np.zeros(2, np.int64)})
    with pytest.raises(UnusableInput, match="damaged checkpoint"):
        train(simulation, begin, SETTINGS[method], seed=1, checkpoint=checkpoint)


def test_baselines_are_tested_on_the_same_movements(
    trained: dict[str, Training], simulation: Simulation, begin: BeginStates
) -> None:
    one, other = (test(t.agent, simulation, begin, 300, seed=3) for t in trained.values())
    np.testing.assert_array_equal(one.goal, other.goal)
    np.testing.assert_allclose(one.angle_begin, other.angle_begin, atol=1e-3)


def test_a_policy_and_its_file(agent: PolicyAgent, tmp_path: Path) -> None:
    path = tmp_path / "agent"
    agent.save(path)
    loaded = load_agent(path)
    assert isinstance(loaded, PolicyAgent)
    np.testing.assert_array_equal(loaded.weights(), agent.weights())
    assert loaded.settings == agent.settings
    state, goal = np.zeros(agent.window.state_size), [600.0]
    for one in (agent, loaded):
        one_actor = one.actor()
        one_actor.begin(state, goal)
        assert one_actor.act() == agent_actions(agent, state, goal)


@pytest.mark.parametrize("passes", [0, 4])
def test_a_joint_that_swings_about_its_goal_is_left_alone_until_it_rests(agent: PolicyAgent, passes: int) -> None:
    agent = replace(agent, settings=replace(agent.settings, passes=passes, rest=0.5))
    goal, scale = agent.window.of_joints(agent.scaling.observation_offset)[:, 0], agent.scaling.observation_scale[0]
    actor, state = agent.actor(), np.zeros(agent.window.state_size)
    swing = 3 * agent.settings.reward.angle_tolerance * agent.spec.angle_unit / scale
    state[0] = swing
    actor.begin(state, goal)
    closed = []
    for k in range(40):
        state[0] = swing * (1 if k % 4 < 2 else -1)  # a pass every other turn, after the second and so on
        closed.append(actor.act()[0] == CLOSED)
        actor.follow(state)
    begun = 9  # four passes later
    resting = range(begun, begun + round(0.5 / agent.spec.period))
    assert all(closed[k] for k in resting) == bool(passes)
    assert not all(closed[k] for k in range(40) if k not in resting)
    actor.begin(state, goal)  # another movement knows nothing of it
    assert (actor.act() == agent_actions(agent, state, list(goal))).all()


def agent_actions(agent: PolicyAgent, state: np.ndarray, goal: list[float]) -> np.ndarray:
    actor = agent.actor()
    actor.begin(state, goal)
    return actor.act()


@pytest.mark.parametrize("how", ["other hidden", "unknown settings", "no simulation", "short", "wrong type", "list"])
def test_damaged_files_are_refused(how: str, agent: PolicyAgent, tmp_path: Path) -> None:
    path = tmp_path / "agent"
    agent.save(path)
    settings, arrays = read_arrays(path, KIND)
    weights = arrays["policy_weights"]
    if how == "other hidden":
        settings["settings"]["hidden"] = [9]
    elif how == "unknown settings":
        settings["settings"]["epochs"] = "many"
    elif how == "no simulation":
        del settings["simulation"]
    elif how == "short":
        arrays["policy_weights"] = weights[:-1]
    elif how == "wrong type":
        arrays["policy_weights"] = weights.astype(np.float64)
    else:
        settings = [settings]
    write_arrays(path, KIND, settings, arrays)
    with pytest.raises(UnusableInput, match=str(path)):
        load_agent(path)


def test_other_files_are_no_agents(simulation: Simulation, tmp_path: Path) -> None:
    simulation.save(tmp_path / "sim")
    with pytest.raises(UnusableInput, match="expected an agent"):
        load_agent(tmp_path / "sim")


def success(agent: PolicyAgent, movements: int = 25) -> tuple[float, float]:
    """Return success and mean reward of movements on a simulated arm, through the controller of any agent."""
    arm, controller = SimulationArm(agent.simulation, seed=5), AgentController(agent)
    goals = np.random.default_rng(0).uniform(*agent.goal_range[0], movements)
    reached, total = 0, 0.0
    for goal in goals:
        controller.reset(np.array([goal]))
        before: Reading = arm.read()
        last = None
        for _ in range(100):
            valves = controller.act(before)
            arm.set_valves(valves)
            arm.wait(arm.spec.period)
            now = arm.read()
            velocity = (now.angle - before.angle) / (1e3 * (now.time - before.time))
            is_reached = agent.settings.reward.reached(now.angle, velocity, np.array([goal]))
            total += (50 if is_reached else -1) - 8 * (last is not None and (valves != last).any())
            before, last = now, valves
            if is_reached:
                reached += 1
                break
        arm.set_valves(np.zeros((1, 2), np.int8))
        arm.wait(2.0)
    arm.close()
    return reached / movements, total / movements


def test_the_policy_moves_an_arm_and_looking_ahead_does_not_make_it_worse(agent: PolicyAgent) -> None:
    plain = replace(agent, settings=replace(agent.settings, lookahead=0))
    ahead = replace(agent, settings=replace(agent.settings, lookahead=180, clear=0.0))
    (rate, reward), (rate_ahead, reward_ahead) = success(plain), success(ahead)
    assert min(rate, rate_ahead) > 0.9
    assert reward_ahead > reward - 1


def test_two_joints(tmp_path: Path) -> None:
    simulation = synthetic_simulation(2)
    begin = synthetic_begin_states(simulation)
    short = replace(POLICY, updates=3, agents=1)
    for settings in (short, replace(BATCHED, updates=3, agents=1)):
        agent = train(simulation, begin, settings).agent
        agent.save(tmp_path / "agent")
        loaded = load_agent(tmp_path / "agent")
        actor = loaded.actor()
        actor.begin(np.zeros(simulation.window.state_size), [500.0, 600.0])
        assert actor.act().shape == (2,)
        assert test(loaded, simulation, begin, 10).switches.shape == (10, 2)


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (PolicySettings, "hidden", ()),
        (PolicySettings, "clip", 0.0),
        (PolicySettings, "squash", (25.0, -1.0)),
        (PolicySettings, "learning_rate", float("nan")),
        (BatchedSettings, "hidden", 0),
        (BatchedSettings, "trace_decay", 1.1),
    ],
)
def test_impossible_settings_are_refused(
    kind: type[PolicySettings] | type[BatchedSettings], name: str, value: object
) -> None:
    with pytest.raises(UnusableInput, match=name):
        kind(**{name: value})  # type: ignore[arg-type]


def test_the_batched_agent_goes_on_as_the_thesis(trained: dict[str, Training], tmp_path: Path) -> None:
    agent = trained["batched"].agent
    assert isinstance(agent.settings, TrainSettings)
    agent.save(tmp_path / "agent")
    assert isinstance(load_agent(tmp_path / "agent"), Learns)


def test_looking_ahead_is_tested_on_the_first_of_the_same_movements(
    agent: PolicyAgent, trained: dict[str, Training], simulation: Simulation, begin: BeginStates
) -> None:
    plain, ahead = test(agent, simulation, begin, 120, seed=4), test_ahead(agent, simulation, begin, 100, seed=4)
    assert ahead is not None
    np.testing.assert_array_equal(ahead.goal, plain.goal[:100])
    np.testing.assert_array_equal(ahead.angle_begin, plain.angle_begin[:100])
    assert ahead.reward.mean() > plain.reward[:100].mean()  # a short training leaves much to be seen ahead
    found = results_with_lookahead(plain, ahead)
    assert found["reward"] == plain.results()["reward"]
    assert found["lookahead"] == ahead.results()
    blind = replace(agent, settings=replace(agent.settings, lookahead=0))
    assert test_ahead(blind, simulation, begin, 10) is None
    assert test_ahead(trained["batched"].agent, simulation, begin, 10) is None
    assert results_with_lookahead(plain, None)["lookahead"] is None
    scaling = replace(simulation.scaling, observation_scale=2 * simulation.scaling.observation_scale)
    with pytest.raises(UnusableInput, match="another simulation"):
        test_ahead(agent, replace(simulation, scaling=scaling), begin, 10)


@pytest.mark.parametrize("joints", [1, 2])
def test_several_joints_begin_with_easier_goals_and_end_with_those_asked_for(joints):
    simulation = synthetic_simulation(joints=joints, hidden=4)
    learner = PolicyLearner(simulation, synthetic_begin_states(simulation), replace(POLICY, updates=100), 0, 0)
    asked, found = learner.environment.task.reward, []
    for done in range(11):
        learner.counts[0] = done
        found.append(learner._eased().task.reward)
    assert found[8:] == [asked] * 3
    if joints == 1:
        assert found[0] == asked
    else:
        tolerances = [reward.angle_tolerance for reward in found[:9]]
        assert tolerances == sorted(tolerances, reverse=True)
        assert tolerances[0] == 4 * asked.angle_tolerance
        assert [reward.switch for reward in found[:9]] == sorted(
            (reward.switch for reward in found[:9]), reverse=True
        )
