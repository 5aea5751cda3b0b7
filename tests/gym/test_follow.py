"""The environment in which a reference is followed: its contract, its rewards, its pictures."""

import copy
import math
import warnings
from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from children import python
from pneumarm.arm import ControlCycle, guarded
from pneumarm.arm.cycle import BeginState
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.errors import UnusableInput
from pneumarm.gym import ENVIRONMENT, FOLLOW, ArmFollow, FollowSettings, follow
from pneumarm.gym.drawing import Drawing
from pneumarm.gym.spaces import nominal_scaling, nominal_view

QUICK = BeginState(deflate=0.2, inflate=0.3, settle=0.2)


def on_arm(reference: str | None = None, seconds: float = 1.0, joints: int = 1) -> ArmFollow:
    arm = VirtualArm(draw_parameters(2, joints), seed=2)
    settings = FollowSettings(seconds, change=0.1, preview=(0.034, 0.1))
    return ArmFollow(arm, nominal_view(arm.spec), reference, settings, QUICK)


@pytest.fixture
def env() -> Iterator[ArmFollow]:
    made = on_arm()
    yield made
    made.close()


@pytest.mark.parametrize("joints", [1, 2])
def test_check_env_finds_nothing(joints: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(on_arm(joints=joints), skip_render_check=True)


def test_a_fresh_interpreter_makes_it_by_name() -> None:
    code = (
        "import gymnasium, pneumarm.gym\n"
        "env = gymnasium.make('pneumarm/Follow-v0', arm='virtual:seed=7', seconds=0.1)\n"
        "observation, info = env.reset(seed=0)\n"
        "assert env.observation_space.contains(observation)\n"
        "print(len([env.step(env.action_space.sample()) for _ in range(3)]))"
    )
    assert python("-c", code, check=True).stdout.strip() == "3"


def test_rewards_are_errors_and_valve_changes(env: ArmFollow) -> None:
    observation, info = env.reset(seed=1, options={"goal_deg": 10})
    np.testing.assert_allclose(info["wanted_deg"], 10)
    scale = nominal_scaling(env.arm.spec).observation_scale[0]
    state = env.observation_space.shape[0] - 3
    error = -observation[state] * scale / env.arm.spec.counts_per_degree
    assert error == pytest.approx(info["error_deg"][0], abs=1e-3)
    _, reward, terminated, truncated, info = env.step(np.array([1.0, 0.5], np.float32))
    assert info["valve_changes"] == 3  # one opens and stays open, the other opens and closes
    assert reward == pytest.approx(-abs(info["error_deg"][0]) - 0.3)
    assert not terminated
    assert not truncated
    _, reward, *_, info = env.step(np.array([1.0, 0.0], np.float32))
    assert info["valve_changes"] == 0
    assert reward == pytest.approx(-abs(info["error_deg"][0]))


def test_an_episode_ends_after_its_seconds_and_repeats_by_its_seed(env: ArmFollow) -> None:
    seen = []
    for _ in range(2):
        observation, _ = env.reset(seed=3)
        steps, truncated = [observation], False
        random = np.random.default_rng(0)
        while not truncated:
            observation, _, terminated, truncated, _ = env.step(random.uniform(-1, 1, 2).astype(np.float32))
            assert not terminated
            assert env.observation_space.contains(observation)
            steps.append(observation)
        seen.append(np.array(steps))
    assert len(seen[0]) == 31
    np.testing.assert_array_equal(*seen)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2, np.float32))


def test_the_reference_is_seen_ahead() -> None:
    env = on_arm("sine:1Hz,15deg")
    observation, info = env.reset(seed=0)
    scale = nominal_scaling(env.arm.spec).observation_scale[0] / env.arm.spec.counts_per_degree
    wanted = info["angle_deg"][0] + observation[-3:] * scale
    expected = [15 * math.sin(2 * math.pi * k * env.arm.spec.period) for k in (0, 1, 3)]
    np.testing.assert_allclose(wanted, expected, atol=0.01)
    env.close()


def test_turns_are_those_of_the_control_cycle() -> None:
    """The same pulses give the same readings as when the control cycle makes the turns."""
    env, random = on_arm(), np.random.default_rng(4)
    pulses = random.uniform(-1, 1, (20, 1, 2)).astype(np.float32).astype(np.float64)
    _, info = env.reset(seed=5)
    found = [info["angle_deg"], *(env.step(one.ravel())[4]["angle_deg"] for one in pulses)]
    env.close()
    twin = guarded(VirtualArm(draw_parameters(2), seed=2))
    QUICK.reach(twin, np.random.Generator(np.random.PCG64(5)))
    left = iter([*pulses, None])
    steps = list(ControlCycle(twin).run(lambda reading: next(left)))
    np.testing.assert_array_equal(np.array(found), [twin.spec.degrees(one.reading.angle) for one in steps])
    twin.close()


def test_mistakes_are_told(env: ArmFollow) -> None:
    env.reset(seed=0)
    for wrong in (np.array([2.0, 0.0]), np.zeros(3), np.array([np.nan, 0.0])):
        with pytest.raises(UnusableInput, match="shares of -1 to 1"):
            env.step(wrong)
    with pytest.raises(UnusableInput, match="goals of joint"):
        env.reset(options={"goal_deg": 80})
    with pytest.raises(UnusableInput, match="expected sine"):
        env.reset(options={"reference": "sinus"})
    for options, words in (
        ({"goal_deg": "12"}, "1 finite angle.s., as numbers, got '12'"),
        ({"goal_deg": [1, 2]}, "1 finite angle"),
        ({"goal_deg": None}, "expected one goal"),
        ({"reference": 5}, "expected a Reference"),
        ({"reference": "sine:1Hz,15deg", "goal_deg": 3}, "one of goal_deg and reference"),
        ({"goal": 500}, "goal_deg or reference"),
        ("goal_deg", "goal_deg or reference"),
    ):
        with pytest.raises(UnusableInput, match=words):
            env.reset(options=options)  # type: ignore[arg-type]
    for arguments, words in (
        ({"seconds": 0}, "seconds cannot be 0; expected a number, more than 0"),
        ({"preview": (20.0,)}, r"preview cannot be \(20.0,\)"),
        ({"reference": "sine:1Hz,60deg"}, "asks joint 1"),
        ({"render_mode": "ascii"}, "render_mode"),
    ):
        with pytest.raises(UnusableInput, match=words):
            follow("virtual:seed=2", **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("reference", [None, "sine:1Hz,15deg"])
def test_a_copy_carries_the_state_and_goes_its_own_way(reference: str | None) -> None:
    env = Drawing(on_arm(reference), lambda seen: (seen[:1] * 0, seen[:1], np.zeros((1, 2))), VirtualArm().spec)
    env.reset(seed=2)
    env.render()
    random = np.random.default_rng(0)
    before, *after = random.uniform(-1, 1, (6, 2)).astype(np.float32)
    env.step(before)
    twin, third = copy.deepcopy(env), copy.deepcopy(env)
    found = [twin.step(action)[:2] for action in after]
    third.step(-after[0])
    np.testing.assert_array_equal(twin.render().shape, (400, 400, 3))
    for action, (observation, reward) in zip(after, found, strict=True):
        seen, paid, *_ = env.step(action)
        np.testing.assert_array_equal(seen, observation)
        assert paid == reward
    for one in (env, twin, third):
        one.close()


def test_pictures_show_where_the_arm_is_and_is_wanted() -> None:
    simulation = synthetic_simulation()
    within = {"arm": simulation, "transitions": synthetic_begin_states(simulation)}
    for name, arguments in ((FOLLOW, {"arm": "virtual:seed=2"}), (ENVIRONMENT, within)):
        env = gymnasium.make(name, render_mode="rgb_array", **arguments)
        assert env.render_mode == "rgb_array"
        env.reset(seed=1)
        first = env.render()
        assert isinstance(first, np.ndarray)
        assert (first.shape, first.dtype) == ((400, 400, 3), np.uint8)
        for _ in range(10 if name == FOLLOW else 1):
            env.step(np.array([1.0, -1.0], np.float32) if name == FOLLOW else 6)
        assert (env.render() != first).any()
        env.close()


def test_a_window_is_opened_where_there_is_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gymnasium.make(FOLLOW, arm="virtual:seed=2", render_mode="human")
        env.reset(seed=0)
        env.step(np.zeros(2, np.float32))
        env.close()
