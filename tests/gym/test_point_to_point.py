"""The Gymnasium environments: their contract, their rewards, and that all forms of them are the same task."""

import copy
import math
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_arm import synthetic_begin_states, synthetic_simulation

import pneumarm.gym
from pneumarm.arm import ControlCycle, Reading, guarded
from pneumarm.arm.cycle import BeginState
from pneumarm.arm.valves import to_valves
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.arm.virtual.faults import SensorNoise
from pneumarm.control import move
from pneumarm.errors import UnusableInput
from pneumarm.gym import ENVIRONMENT, ArmPointToPoint, PointToPointVector
from pneumarm.gym.spaces import nominal_goals, nominal_scaling, nominal_view
from pneumarm.simulation import NoiseSettings
from pneumarm.task import Reward, StateTracker
from pneumarm.transitions.window import Window

SIMULATIONS = {joints: synthetic_simulation(joints) for joints in (1, 2)}
BEGIN = {joints: synthetic_begin_states(simulation) for joints, simulation in SIMULATIONS.items()}
QUICK = BeginState(deflate=0.2, inflate=0.3, settle=0.2)


def make(joints: int = 1, **arguments) -> gymnasium.Env:  # type: ignore[no-untyped-def, type-arg]
    return gymnasium.make(ENVIRONMENT, arm=SIMULATIONS[joints], transitions=BEGIN[joints], **arguments)


def vector(n: int, joints: int = 1, **arguments) -> PointToPointVector:  # type: ignore[no-untyped-def]
    given_ = {"arm": SIMULATIONS[joints], "transitions": BEGIN[joints]}
    return gymnasium.make_vec(ENVIRONMENT, n, "vector_entry_point", **given_, **arguments)  # type: ignore[return-value]


def on_arm(seed: int = 2) -> ArmPointToPoint:
    arm = VirtualArm(draw_parameters(seed), seed=seed)
    return ArmPointToPoint(arm, nominal_view(arm.spec), begin=QUICK)


@pytest.mark.parametrize("joints", [1, 2])
def test_check_env_finds_nothing_in_a_simulation(joints: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(joints).unwrapped)


def test_check_env_finds_nothing_on_an_arm() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(ENVIRONMENT, arm="virtual:seed=2").unwrapped)


def raw_state(observation: np.ndarray, joints: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angles, velocities and goals in sensor units."""
    scaling = SIMULATIONS[joints].scaling
    newest = observation[: 4 * joints] * scaling.observation_scale + scaling.observation_offset
    goal = observation[-joints:] * scaling.observation_scale[::4] + scaling.observation_offset[::4]
    return newest[::4], newest[1::4], goal


@pytest.mark.parametrize("joints", [1, 2])
def test_rewards_follow_from_what_is_observed(joints: int) -> None:
    """The definitions in plain Python, from observations and actions alone."""
    reward, env, random = Reward(), make(joints), np.random.default_rng(joints)
    kinds = set()
    for seed in range(60):
        env.reset(seed=seed)
        before, done, steps = None, False, 0
        while not done:
            action = random.integers(0, 9, joints) if before is None or random.random() < 0.3 else before
            observation, paid, terminated, truncated, info = env.step(int(action[0]) if joints == 1 else action)
            assert env.observation_space.contains(observation)
            steps += 1
            angle, velocity, goal = raw_state(observation, joints)
            reached = reward.reached(angle, velocity, goal)
            switches = 0 if before is None else int((action != before).sum())
            assert terminated == reached == info["is_success"]
            assert paid == (50 if reached else -1) - 8 * switches
            assert truncated == (not reached and steps == 100)
            before, done = action, terminated or truncated
            kinds.add((terminated, truncated, switches))
        with pytest.raises(ResetNeeded):
            env.unwrapped.step(0 if joints == 1 else [0, 0])
    assert {(True, False), (False, True)} <= {kind[:2] for kind in kinds}
    assert {kind[2] for kind in kinds} == set(range(joints + 1))


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31), count=st.sampled_from([1, 3, 7]), joints=st.sampled_from([1, 2]))
def test_the_vector_is_many_single_ones(seed: int, count: int, joints: int) -> None:
    many = vector(count, joints, cutoff=9)
    observations, _ = many.reset(seed=seed)
    singles = [make(joints, cutoff=9) for _ in range(count)]
    for e, single in enumerate(singles):
        np.testing.assert_array_equal(single.reset(seed=seed + e)[0], observations[e])
    random, over = np.random.default_rng(seed), np.zeros(count, bool)
    for _ in range(25):
        actions = random.integers(0, 9, (count, joints))
        observations, rewards, terminated, truncated, info = many.step(actions if joints > 1 else actions[:, 0])
        for e, single in enumerate(singles):
            if over[e]:
                expected = (single.reset()[0], 0.0, False, False)
            else:
                expected = single.step(actions[e] if joints > 1 else int(actions[e, 0]))[:4]
            np.testing.assert_array_equal(observations[e], expected[0])
            assert (rewards[e], terminated[e], truncated[e]) == expected[1:]
        over = terminated | truncated
        assert over.any() == bool(info)
        if over.any():
            np.testing.assert_array_equal(info["_is_success"], over)
            np.testing.assert_array_equal(info["is_success"][over], terminated[over])


def test_resets_in_the_same_step_lose_no_step() -> None:
    n = 5
    late, same = vector(n, cutoff=7), vector(n, cutoff=7, autoreset_mode=AutoresetMode.SAME_STEP)
    first, _ = late.reset(seed=11)
    np.testing.assert_array_equal(same.reset(seed=11)[0], first)
    random = np.random.default_rng(0)
    wait = np.zeros(n, bool)
    ends = 0
    for _ in range(40):
        actions = random.integers(0, 9, n)
        observed, rewards, terminated, truncated, info = same.step(actions)
        ended = terminated | truncated
        # The other form needs a step more for each new movement, in which its action does not count.
        expected = late.step(actions)
        np.testing.assert_array_equal(rewards, expected[1])
        np.testing.assert_array_equal(ended, expected[2] | expected[3])
        if ended.any():
            ends += int(ended.sum())
            np.testing.assert_array_equal(info["final_obs"][ended], expected[0][ended])
            if not ended.all():
                break  # from here on the two forms are out of step
            np.testing.assert_array_equal(late.step(actions)[0], observed)
        else:
            np.testing.assert_array_equal(observed, expected[0])
        wait |= ended
    assert ends > 0


def test_threads_change_nothing() -> None:
    n = 700
    runs = []
    for threads in (1, 2):
        many = vector(n, threads=threads)
        random = np.random.default_rng(5)
        found = [many.reset(seed=3)[0]]
        for _ in range(30):
            found += list(many.step(random.integers(0, 9, n))[:2])
        many.close()
        runs.append(found)
    for one, two in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, two)


def test_what_is_returned_is_the_callers_own_unless_asked_otherwise() -> None:
    kept, shared = vector(3), vector(3, copy=False)
    for many, is_same in ((kept, False), (shared, True)):
        first, _ = many.reset(seed=1)
        before = first.copy()
        second = many.step(np.array([6, 6, 6]))[0]
        assert np.shares_memory(first, second) == is_same
        assert (first == before).all() != is_same


def test_seeds_repeat_and_differ() -> None:
    env = make()
    first = env.reset(seed=4)[0]
    assert (env.reset()[0] != first).any()
    np.testing.assert_array_equal(env.reset(seed=4)[0], first)
    assert (env.reset(seed=5)[0] != first).any()
    many = vector(4)
    many.reset(seed=[4, 5, 4, 6])
    observed, _ = many.reset(seed=[4, 5, 4, 6])
    np.testing.assert_array_equal(observed[0], observed[2])
    np.testing.assert_array_equal(observed[0], first)
    kept = observed.copy()
    mask = np.array([True, False, False, True])
    again, _ = many.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal((again != kept).any(axis=1), mask)


def test_a_goal_can_be_chosen() -> None:
    for env in (make(), on_arm()):
        observation, info = env.reset(seed=1, options={"goal": [444.0]})
        assert info["goal"] == [444.0]
        assert (env.reset(seed=1)[1]["goal"] != 444.0).all()
        with pytest.raises(UnusableInput, match="goal"):
            env.reset(options={"goal": [-1.0]})
    observation, _ = make().reset(options={"goal": 444.0})
    assert raw_state(observation, 1)[2] == pytest.approx(444.0, abs=1e-3)


class Replay:
    def __init__(self, actions: list[int]) -> None:
        self.actions = actions

    def reset(self, goal: np.ndarray) -> None:
        self.turn = -1

    def act(self, reading: Reading) -> np.ndarray:
        self.turn += 1
        return to_valves([self.actions[self.turn]])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_on_an_arm_it_is_the_movement_of_a_transfer(seed: int) -> None:
    """Turn by turn the same readings, reward and switches as the control cycle's, with noise and jitter."""
    env = on_arm(3)
    random = np.random.default_rng(seed)
    actions = np.repeat(random.integers(0, 9, 25), 4).tolist()
    _, info = env.reset(seed=seed)
    observed, paid, done = [], [], False
    while not done:
        observation, reward, terminated, truncated, _ = env.step(actions[len(paid)])
        observed.append(observation)
        paid.append(reward)
        done = terminated or truncated
    arm = guarded(VirtualArm(draw_parameters(3), seed=3))
    own = np.random.default_rng()
    own.bit_generator.state = gymnasium.utils.seeding.np_random(seed)[0].bit_generator.state
    low, high = nominal_goals(arm.spec).T
    goal = own.uniform(low, high)
    np.testing.assert_array_equal(goal, info["goal"])
    QUICK.reach(arm, own)
    movement = move(ControlCycle(arm), Replay(actions), goal)
    assert movement.actions == len(paid)
    assert movement.reward == sum(paid)
    assert movement.success == terminated
    tracker = StateTracker(Window(), nominal_scaling(arm.spec))
    recorded = movement.recorded
    for k in range(len(paid) + 1):
        state = tracker.push(recorded.time[k], recorded.angle[k], recorded.pressure[k])
        if k > 0:
            np.testing.assert_allclose(observed[k - 1][:-1], state, atol=1e-6)
        if k < len(paid):
            tracker.commanded(recorded.command[k])


def test_an_agents_view_is_the_same_in_simulation_and_on_the_arm() -> None:
    simulation = SIMULATIONS[1]
    env = gymnasium.make(ENVIRONMENT, arm=f"virtual:seed={3}", like=simulation)
    inside = make()
    assert env.observation_space.shape == inside.observation_space.shape
    assert env.observation_space.dtype == inside.observation_space.dtype
    observation, info = env.reset(seed=0)
    assert raw_state(observation, 1)[2] == pytest.approx(info["goal"], abs=1e-2)
    low, high = simulation.goal_range[0]
    assert low <= info["goal"][0] <= high
    env.close()


def test_noise_cutoff_and_reward_can_be_chosen() -> None:
    env = make(noise=NoiseSettings(kind="none"), cutoff=2, reward=Reward(goal=5.0, action=-2.0, switch=-3.0))
    ends = []
    for seed in (1, 1, 2):
        env.reset(seed=seed, options={"goal": [660.0]})
        ends.append([env.step(0), env.step(1)])
    np.testing.assert_array_equal(ends[0][1][0], ends[1][1][0])
    assert ends[0][0][1] == -2.0
    assert ends[0][1][1:4] == (-5.0, False, True)


@pytest.mark.parametrize(
    "arguments",
    [
        {"arm": "nonsense"},
        {"arm": SIMULATIONS[1]},
        {"arm": SIMULATIONS[1], "transitions": BEGIN[2]},
        {"arm": SIMULATIONS[1], "transitions": BEGIN[1], "like": SIMULATIONS[1]},
        {"arm": SIMULATIONS[1], "transitions": BEGIN[1], "goals": [500.0, 400.0]},
        {"arm": SIMULATIONS[1], "transitions": BEGIN[1], "goals": [1.0, 2.0, 3.0]},
        {"arm": "virtual", "transitions": BEGIN[1]},
        {"arm": "virtual", "like": SIMULATIONS[2]},
        {"arm": "simulation:/nowhere.sim", "transitions": BEGIN[1]},
    ],
)
def test_arguments_that_do_not_go_together_are_refused(arguments: dict[str, object]) -> None:
    with pytest.raises(UnusableInput):
        pneumarm.gym.point_to_point(**arguments)  # type: ignore[arg-type]


def test_wrong_actions_are_refused() -> None:
    one, two = make().unwrapped, make(2).unwrapped
    one.reset(seed=0)
    two.reset(seed=0)
    for action in (9, -1, 2.5):
        with pytest.raises(UnusableInput, match="action"):
            one.step(action)
    with pytest.raises(UnusableInput, match="action"):
        two.step([0, 9])
    many = vector(2)
    with pytest.raises(UnusableInput, match="reset"):
        many.step([0, 0])
    many.reset(seed=0)
    with pytest.raises(UnusableInput, match="0 to 8"):
        many.step([0, 9])
    with pytest.raises(UnusableInput, match="seed"):
        many.reset(seed=[1, 2, 3])
    with pytest.raises(UnusableInput, match="at least 1"):
        vector(0)
    with pytest.raises(UnusableInput, match="only simulations"):
        pneumarm.gym.point_to_point_vector("virtual", BEGIN[1], 2)
    with pytest.raises(UnusableInput, match="autoreset"):
        vector(2, autoreset_mode=AutoresetMode.DISABLED)


def test_registering_twice_is_harmless() -> None:
    pneumarm.gym.register()
    assert ENVIRONMENT in gymnasium.registry


def test_a_cut_off_by_gymnasiums_name_holds_too() -> None:
    for given_, steps in (({"max_episode_steps": 3}, 3), ({"max_episode_steps": 30, "cutoff": 4}, 4)):
        many = vector(2, **given_)
        many.reset(seed=1)
        ended = [bool(many.step([0, 0])[3][1]) for _ in range(steps)]
        assert ended == [False] * (steps - 1) + [True]
    with pytest.raises(UnusableInput, match="cutoff"):
        vector(2, max_episode_steps=0)


@pytest.mark.parametrize(
    "options",
    [
        {"goal": "12"},
        {"goal": None},
        {"goal": [[1.0], [2.0, 3.0]]},
        {"goal": {"angle": 500}},
        {"goal": math.nan},
        {"goal": True},
        {"goal": 500, "goal_deg": 0},
        {"goal_deg": "12"},
        {"goal_deg": 80},
        {"gaol": 500},
        "goal",
        [500],
    ],
)
def test_options_that_choose_no_goal_are_refused(options: Any) -> None:
    for env in (make().unwrapped, on_arm()):
        with pytest.raises(UnusableInput, match="goal"):
            env.reset(options=options)
        env.close()


@pytest.mark.parametrize("goal", [500, 500.0, np.float32(500), [500], (500.0,), np.array(500), np.array([[500]])])
def test_a_goal_is_any_number(goal: Any) -> None:
    for env in (make().unwrapped, on_arm()):
        degrees = SIMULATIONS[1].spec.degrees(goal)
        for options in ({"goal": goal}, {"goal_deg": degrees}):
            assert env.reset(options=options)[1]["goal"] == pytest.approx([500.0])
        env.close()


def test_options_of_the_vector_are_a_mask_or_refused() -> None:
    many = vector(2)
    first, _ = many.reset(seed=1)
    again, _ = many.reset(seed=7, options={"reset_mask": [False, True]})
    assert ((again == first).all(axis=1) == [True, False]).all()
    for options in ({"reset_mask": [True]}, {"reset_mask": "both"}, {"reset_mask": [0, 1]}, {"goal": 500}, "all"):
        with pytest.raises(UnusableInput, match="reset_mask"):
            many.reset(options=options)  # type: ignore[arg-type]


def pickled(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


def step_of(env: Any, action: Any) -> list[Any]:
    """Return what a step gives, but for what it says besides."""
    return list(env.step(action)[:4])


@pytest.mark.parametrize("copied", [copy.deepcopy, pickled])
@pytest.mark.parametrize("kind", ["simulation", "two joints", "virtual", "without pressures", "faults", "vector"])
def test_a_copy_carries_the_state_and_goes_its_own_way(kind: str, copied: Callable[[Any], Any]) -> None:
    hard = Reward(angle_tolerance=1e-6)  # so that no movement ends meanwhile
    made: dict[str, Callable[[], Any]] = {
        "simulation": lambda: make(reward=hard),
        "two joints": lambda: make(2, reward=hard),
        "virtual": lambda: on_arm(3),
        "without pressures": lambda: gymnasium.make(ENVIRONMENT, arm="virtual:seed=2,pressure_sensors=off"),
        "faults": lambda: ArmPointToPoint(
            VirtualArm(draw_parameters(2), seed=2, faults=[SensorNoise(angle=3.0)]),
            nominal_view(VirtualArm(draw_parameters(2)).spec),
            begin=QUICK,
        ),
        "vector": lambda: vector(600, threads=2, cutoff=9),
    }
    env = made[kind]()
    copied(env).reset(seed=5)  # before anything was done
    env.reset(seed=1)
    env.action_space.seed(1)
    before = [env.action_space.sample() for _ in range(3)]
    after = [env.action_space.sample() for _ in range(8)]
    for action in before:
        env.step(action)
    twin, third = copied(env), copied(env)
    found = [step_of(twin, action) for action in after]
    for number in range(2 if kind == "vector" else 1):  # other actions there change nothing here
        third.step(after[number + 1])
    for action, expected in zip(after, found, strict=True):
        for one, other in zip(step_of(env, action), expected, strict=True):
            np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])
    for one in (env, twin, third):
        one.close()


def test_copies_share_the_simulation_and_its_begin_states() -> None:
    env = make().unwrapped
    assert copy.deepcopy(env).simulation is env.simulation


def test_an_environment_on_hardware_is_not_copied() -> None:
    env = gymnasium.make(ENVIRONMENT, arm="emulated:virtual:seed=2")
    for copied in (copy.deepcopy, pickled):
        with pytest.raises(UnusableInput, match="emulated:virtual:seed=2 cannot be copied"):
            copied(env)
    env.close()
