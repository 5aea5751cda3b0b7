"""Arms with one muscle a joint: the whole job on one with physics of its own, and what refuses, in one line."""

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from pneumarm.arm import ArmSpec, guarded, open_arm
from pneumarm.arm.spec_file import save_spec
from pneumarm.arm.valves import possible_actions, to_valves
from pneumarm.arm.virtual import StuckValve, resting_angle
from pneumarm.classical import tune
from pneumarm.control import Monitor
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.gym import point_to_point
from pneumarm.learning import PolicySettings, load_agent
from pneumarm.planning import PlanSettings
from pneumarm.planning.search import problem
from pneumarm.run import Run
from pneumarm.simulation import Simulation
from pneumarm.task.reward import Reward
from pneumarm.transitions import Store, collect
from pneumarm.transitions.goals import held_range
from small import SMALL, exit_status, servo_on

PLAIN, VIRTUAL = "python:tests.plain_arms:single", "virtual:seed=3,muscles=1"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the folder and the results of the whole job on an arm with physics of its own."""
    folder = tmp_path_factory.mktemp("one_muscle") / "run"
    return folder, servo_on(PLAIN, folder)


def test_the_whole_job_settles_and_finds_nothing_wrong(run):
    folder, results = run
    assert results["settle"]["settled"] >= 0.9
    assert results["collect"]["findings"] == []
    assert (folder / "report.html").exists()
    with Store.open(folder / "transitions.db") as store:
        assert store.spec.muscles == 1
        for block in store.blocks():
            assert (block.pressure[:, :, 1] == 0).all()
            assert (np.nan_to_num(block.command[:, :, 1]) == 0).all()
            assert set(np.sign(np.nan_to_num(block.command[:, :, 0])).ravel()) == {-1, 0, 1}


def test_its_simulation_does_not_see_the_muscle_that_is_not_there(run):
    simulation = Simulation.load(run[0] / "simulation.safetensors")
    window = simulation.window
    inputs = np.random.default_rng(1).uniform(0, 1, (20, window.input_size))
    other = inputs.copy()
    names = window.input_names()
    absent = [i for i, name in enumerate(names) if "pressure_2" in name or "command_2" in name]
    assert len(absent) == 2 * window.history
    newest = [i for i in absent if i < window.observation_size]
    other[:, [i for i in absent if i not in newest]] += 1.0
    np.testing.assert_array_equal(simulation.predict(inputs), simulation.predict(other))
    assert (simulation.predict(other)[:, 3] == 0).all()


def test_its_agent_moves_it_with_one_muscle_and_is_refused_by_an_arm_with_two(run, capsys):
    folder, _ = run
    agent = str(folder / "agent.safetensors")
    assert exit_status(["move", agent, "--arm", PLAIN, "15deg", "-10deg", "--json"]) == 0
    moved = json.loads(capsys.readouterr().out.splitlines()[-1])["movements"]
    assert all(one["success"] for one in moved)
    assert exit_status(["move", agent, "--arm", "python:tests.plain_arms:noisy", "15deg"]) == 2
    assert exit_status(["track", agent, "--arm", PLAIN, "--reference", "sine:0.25Hz,10deg", "--seconds", "5"]) == 0


def test_a_simulated_environment_and_plans_have_three_actions_too(run):
    folder, _ = run
    name = f"simulation:{folder / 'simulation.safetensors'}"
    for env in (
        point_to_point(name, transitions=folder / "transitions.db"),
        gymnasium.make_vec(
            "pneumarm/PointToPoint-v0", 4, "vector_entry_point", arm=name, transitions=folder / "transitions.db"
        ),
    ):
        many = getattr(env, "num_envs", 1) > 1
        for action in range(3):
            env.reset(seed=1)  # an action may reach the goal
            env.step(np.full(4, action) if many else action)
        env.reset(seed=1)
        with pytest.raises(UnusableInput, match="0 to 2"):
            env.step(np.full(4, 3) if many else 3)
        env.close()
    sought = problem(np.zeros(1), Reward(), PlanSettings(), muscles=1)
    assert sought.commands.tolist() == [[[-1, 0]], [[0, 0]], [[1, 0]]]
    assert exit_status(["move", f"plan:{folder / 'simulation.safetensors'}", "--arm", PLAIN, "10deg"]) == 0


def test_its_servo_says_nothing_to_the_other_muscle(run):
    agent = load_agent(run[0] / "agent.safetensors")
    actor = agent.actor()
    random = np.random.default_rng(3)
    state = random.normal(size=agent.window.state_size)
    for goal in random.uniform(*agent.goal_range[0], 30):
        actor.begin(state, [goal])
        assert actor.act()[0, 1] == 0


@pytest.mark.parametrize("method", ["policy", "sarsa", "batched"])
def test_reaching_agents_have_three_actions(tmp_path, method):
    folder = tmp_path / "run"
    policy = PolicySettings(updates=20, arms=64, validation_episodes=50)
    small = replace(SMALL, arm=VIRTUAL, bound_episodes=0, method=method, policy=policy, transitions=3_000)
    results = Run(folder, small).do()
    assert results["transfer"]["counts"]["before"]["interventions"]["nonsense"] == 0
    agent = load_agent(folder / "agent.safetensors")
    actor, random, found = agent.actor(), np.random.default_rng(2), set()
    for _ in range(200):
        actor.begin(random.normal(size=agent.window.state_size), random.uniform(*agent.goal_range.T))
        found.add(int(actor.act()[0]))
    assert found <= set(np.flatnonzero(possible_actions(1)))


def test_three_of_nine_actions_keep_the_other_muscle_closed():
    assert possible_actions(2).all()
    assert np.flatnonzero(possible_actions(1)).tolist() == [1, 4, 7]
    assert to_valves([1, 4, 7]).tolist() == [[-1, 0], [0, 0], [1, 0]]


@pytest.mark.parametrize("name", [VIRTUAL, "virtual:wide,seed=8,muscles=1", "virtual:joints=2,seed=3,muscles=1"])
def test_a_virtual_joint_goes_from_end_to_end_against_its_spring(name):
    with open_arm(name) as arm:
        full = min(arm.parameters.air.supply, arm.parameters.max_pressure)
        angles = [
            np.degrees(resting_angle(arm.parameters, np.tile([share * full, 0.0], (arm.spec.joints, 1))))
            for share in np.linspace(0, 1, 6)
        ]
        assert (np.diff(angles, axis=0) > 1).all()
        assert (angles[0] < -15).all()
        assert (angles[-1] > 25).all()
        safe = guarded(arm)
        safe.set_valves(np.ones((arm.spec.joints, 2)))
        safe.wait(1.0)
        assert (safe.applied == [1, 0]).all()
        assert (np.abs(arm.pressure[:, 1]) < 500).all()


def test_a_joint_with_one_muscle_may_always_be_vented():
    with open_arm(VIRTUAL) as arm:
        arm.spec = replace(arm.spec, angle_limits=(1000.0, 1010.0))
        safe = guarded(arm)
        safe.read()
        safe.set_valves(np.full((1, 2), -1))
        assert safe.applied.tolist() == [[-1, 0]]


def test_what_needs_two_muscles_says_so_in_one_line(capsys):
    with open_arm(VIRTUAL) as arm, pytest.raises(UnusableInput, match="one muscle a joint"):
        tune("pid", arm)
    assert exit_status(["arm", "check", VIRTUAL]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    with pytest.raises(UnusableInput, match="1 or 2"):
        open_arm("virtual:muscles=3")
    with pytest.raises(UnusableInput, match="muscles"):
        ArmSpec(muscles=3)


def test_its_file_says_so_too(tmp_path):
    save_spec(ArmSpec(name="two"), tmp_path / "arm.toml")
    with pytest.raises(UnusableInput, match="muscle"):
        open_arm(f"{PLAIN},spec={tmp_path / 'arm.toml'}")
    with open_arm(PLAIN) as arm:
        assert arm.read().pressure.shape == (1, 1)
        save_spec(arm.spec, tmp_path / "arm.toml")
    with open_arm(f"{PLAIN},spec={tmp_path / 'arm.toml'}") as arm:
        safe = guarded(arm)
        safe.set_valves(np.ones((1, 2)))
        assert safe.applied.tolist() == [[1, 0]]
        assert safe.read().pressure.shape == (1, 2)


def test_without_a_pressure_sensor_too(tmp_path):
    name = "python:tests.plain_arms:single_angle_alone"
    with open_arm(name) as arm, Store.for_arm(tmp_path / "s.db", arm.spec) as store:
        collect(arm, store, 2000, 1)
        pressure = np.concatenate([block.pressure for block in store.blocks()])
    assert (pressure[:, 0, 1] == 0).all()
    assert np.ptp(pressure[:, 0, 0]) > 100


def test_its_goals_are_angles_at_which_it_stands(tmp_path):
    with open_arm("virtual:seed=13,muscles=1") as arm, Store.for_arm(tmp_path / "s.db", arm.spec) as store:
        collect(arm, store, 4000, 1)
        seen = store.percentiles()
        ((low, high),) = arm.spec.degrees(held_range(store.blocks, seen, arm.spec.period))
        full = min(arm.parameters.air.supply, arm.parameters.max_pressure)
        vented, filled = (float(np.degrees(resting_angle(arm.parameters, [[p, 0.0]]))[0]) for p in (0.0, full))
    assert arm.spec.degrees(seen)[0, 0] < vented - 2  # as far as it swings
    assert vented - 1 < low < vented + 6
    assert filled - 10 < high < filled + 1


def test_the_monitor_finds_a_stuck_inlet_and_plans_name_no_other_muscle(tmp_path):
    with open_arm(VIRTUAL) as arm, Store.for_arm(tmp_path / "stuck.db", arm.spec) as store:
        with pytest.raises(UnusableInput, match="muscle 1"):
            arm.faults = [StuckValve(joint=1, muscle=2, valve="inlet", position="closed")]
        arm.faults = [StuckValve(joint=1, muscle=1, valve="inlet", position="closed")]
        watch = Monitor(arm.spec)
        with pytest.raises(ArmFailure):
            collect(arm, store, 6000, 1, watch=watch)
    assert {(one.joint, one.muscle) for one in watch.findings} == {(1, 1)}


def test_an_environment_of_such_an_arm_has_three_actions():
    env = point_to_point(VIRTUAL)
    assert env.action_space.n == 3
    observation, _ = env.reset(seed=1)
    following, *_ = env.step(env.action_space.sample())
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(following)
    env.close()
