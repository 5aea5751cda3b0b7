"""Many simulated arms at once do what each would do alone."""

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.kernels import kernel
from pneumarm.learning import PolicySettings
from pneumarm.random import random_states
from pneumarm.task.environment import begin_episode, environment, episode, take
from pneumarm.task.fleet import begin_all, fleet, is_useful, limits, note_still, take_alive, take_all

ARMS = 5


@kernel
def alone(environment, one, actions, states, reached, random):  # type: ignore[no-untyped-def]
    begin_episode(environment, one, np.inf, random)
    for k in range(len(actions)):
        reached[k] = take(environment, one, actions[k])
        states[k] = one.state.x


@pytest.mark.parametrize("joints", [1, 2])
def test_every_arm_moves_as_it_would_alone(joints: int) -> None:
    simulation = synthetic_simulation(joints, direct=joints == 1)
    env = environment(simulation, synthetic_begin_states(simulation), PolicySettings())
    bounds = limits(simulation, 25.0)
    states = random_states(4, ARMS)
    arms = fleet(env, states.copy())
    begin_all(env, arms)
    goals = arms.goal.copy()
    actions = np.random.default_rng(0).integers(0, 9, (20, ARMS, joints))
    found, reached = np.zeros((20, *arms.x.shape), np.float32), np.zeros((20, ARMS), bool)
    for k in range(20):
        take_all(env, bounds, arms, actions[k], reached[k])
        found[k] = arms.x
    for e in range(ARMS):
        one = episode(env, states[e].copy())
        expected, ended = np.zeros((20, arms.x.shape[0]), np.float32), np.zeros(20, bool)
        alone(env, one, actions[:, e], expected, ended, one.state.random)
        np.testing.assert_array_equal(one.goal, goals[e])
        np.testing.assert_allclose(found[:, :, e], expected, atol=2e-4)
        np.testing.assert_array_equal(reached[:, e], ended)
        np.testing.assert_array_equal(one.state.random, arms.random[e])
        np.testing.assert_array_equal(one.switched, arms.switched[e])
    assert (arms.taken == 20).all()


def test_an_arm_does_not_depend_on_its_neighbours() -> None:
    simulation = synthetic_simulation()
    env = environment(simulation, synthetic_begin_states(simulation), PolicySettings())
    bounds = limits(simulation, 25.0)
    found = []
    for others in (1, 2):
        states = random_states(others, ARMS)
        states[2] = random_states(9, 1)[0]
        arms, reached = fleet(env, states), np.zeros(ARMS, bool)
        begin_all(env, arms)
        for k in range(10):
            actions = np.full((ARMS, 1), (k * others) % 9)
            actions[2] = k % 9
            take_all(env, bounds, arms, actions, reached)
        found.append(arms.x[:, 2].copy())
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("joints", [1, 2])
def test_arms_that_are_done_stay_and_the_others_do_not_notice(joints: int) -> None:
    simulation = synthetic_simulation(joints)
    env = environment(simulation, synthetic_begin_states(simulation), PolicySettings())
    bounds = limits(simulation, 25.0)
    all_arms, some = (fleet(env, random_states(4, ARMS)) for _ in range(2))
    begin_all(env, all_arms)
    begin_all(env, some)
    random, alive, reached = np.random.default_rng(0), np.ones(ARMS, bool), np.zeros((2, ARMS), bool)
    for _ in range(20):
        alive &= random.random(ARMS) < 0.9 + 0.1 * (np.arange(ARMS) == 0)  # one goes on to the end
        before = [array.copy() for array in (some.x, some.random, some.taken, reached[1])]
        actions = random.integers(0, 9, (ARMS, joints))
        take_all(env, bounds, all_arms, actions, reached[0])
        take_alive(env, bounds, some, actions, alive, reached[1])
        np.testing.assert_array_equal(some.x[:, alive], all_arms.x[:, alive])
        np.testing.assert_array_equal(reached[:, alive][0], reached[:, alive][1])
        for name in ("average", "random", "actions", "switched", "still", "taken"):
            one, other = getattr(some, name), getattr(all_arms, name)
            chosen = (slice(None), alive) if name == "average" else alive
            np.testing.assert_array_equal(one[chosen], other[chosen], err_msg=name)
        for was, now in zip(before, (some.x, some.random, some.taken, reached[1]), strict=True):
            done = (slice(None), ~alive) if was.shape == some.x.shape else ~alive
            np.testing.assert_array_equal(was[done], now[done])
    assert alive.any()
    assert not alive.all()


@kernel
def useful(limits, x, actions, still):  # type: ignore[no-untyped-def]
    return [is_useful(limits, x, actions, still, 0, action) for action in range(9)]


@kernel
def noted(limits, x, before, switched, still):  # type: ignore[no-untyped-def]
    note_still(limits, x, before, switched, still)


def test_useless_actions() -> None:
    simulation = synthetic_simulation()
    scale = simulation.scaling
    bounds = limits(simulation, 25.0, still=2.5, patience=2)
    x = np.zeros(24, np.float32)
    goal = bounds.layout.goal
    still, held = np.zeros(1, np.int64), np.array([6])
    x[goal] = 100 / scale.observation_scale[0]
    assert all(useful(bounds, x, held, still))

    x[2] = bounds.inlet[0, 0] + 0.01  # muscle 1 over its limit: actions 6, 7, 8 would fill it
    assert [a for a in range(9) if not useful(bounds, x, held, still)[a]] == [6, 7, 8]
    x[2] = x[3] = -1.0
    assert all(useful(bounds, x, held, still))
    bounds.outlet[...] = -0.9
    x[3] = 0.0  # muscle 1 is empty: action 1 would let nothing out
    assert [a for a in range(9) if not useful(bounds, x, held, still)[a]] == [1]
    x[3] = -1.0
    assert [a for a in range(9) if not useful(bounds, x, held, still)[a]] == [0, 1, 3]
    x[2] = x[3] = 0

    still[0] = 2
    assert [a for a in range(9) if not useful(bounds, x, held, still)[a]] == [6]
    x[goal] = 24 / scale.observation_scale[0]  # at the goal it may wait, for another joint
    assert all(useful(bounds, x, held, still))


def test_stillness_counts_steps_of_the_same_action_without_change() -> None:
    simulation = synthetic_simulation()
    scale = simulation.scaling.observation_scale
    bounds = limits(simulation, 25.0, still=2.5, patience=2)
    x, before, still = np.zeros(24, np.float32), np.zeros((1, 3), np.float32), np.zeros(1, np.int64)
    same, switch = np.zeros(1, np.int64), np.ones(1, np.int64)
    for expected in (1, 2, 3):
        noted(bounds, x, before, same, still)
        assert still[0] == expected
    noted(bounds, x, before, switch, still)
    assert still[0] == 1
    for place, quantity in ((0, 0), (2, 2), (3, 3)):
        still[0] = 5
        x[:] = 0
        x[place] = 3.0 / scale[quantity]
        noted(bounds, x, before, same, still)
        assert still[0] == 0
