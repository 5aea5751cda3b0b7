"""Several joints do what plans say, and compare it with what the policy would do; one joint is left as it is."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from pneumarm.arm import Reading
from pneumarm.arm.valves import CLOSED
from pneumarm.control import AgentController
from pneumarm.learning import PolicyAgent, PolicySettings
from pneumarm.learning.policy import courses
from pneumarm.learning.policy.acting import lanes
from pneumarm.learning.policy.agent import policy_sizes, scaled_for_joints
from pneumarm.learning.policy.courses import compare
from pneumarm.networks.layers import weight_count
from pneumarm.planning import search
from pneumarm.random import random_states
from pneumarm.task import BeginStates
from pneumarm.task.movements import Movements
from simple_simulation import QUIET, simulation

SETTINGS = PolicySettings(hidden=(4,), lookahead=48, nodes=5_000, noise=QUIET, cutoff=40)
IN_OUT, OUT_IN = 6, 2
"""Actions that fill muscle 1 and empty muscle 2, and the other way round."""


def untrained(joints: int) -> PolicyAgent:
    """Return an agent to which all actions are equal; it takes the first that it may."""
    made = simulation(joints)
    return PolicyAgent(made, np.zeros(weight_count(policy_sizes(made.window, SETTINGS)), np.float32), SETTINGS)


def at_rest(joints: int) -> BeginStates:
    """Return the one state in the middle of everything."""
    window = simulation(joints).window
    return BeginStates(window, np.zeros((1, window.state_size), np.float32), np.full((1, joints), 500.0))


def moved(agent: PolicyAgent, nodes: int) -> Movements:
    found = replace(agent, settings=replace(agent.settings, nodes=nodes)).test_ahead(
        agent.simulation, at_rest(agent.window.joints), 12, (0,)
    )
    assert found is not None
    return found


def test_plans_bring_two_joints_to_goals_that_the_policy_does_not_know() -> None:
    agent = untrained(2)
    alone, planned = moved(agent, 0), moved(agent, SETTINGS.nodes)
    np.testing.assert_array_equal(alone.goal, planned.goal)
    assert planned.success.all()
    assert planned.reward.mean() > alone.reward.mean() + 10


def test_an_arm_that_does_not_move_is_not_told_the_same_for_ever() -> None:
    agent = untrained(2)
    actor, state = agent.actor(), np.zeros(agent.window.state_size)
    actor.begin(state, [560.0, 440.0])
    told = []
    for _ in range(20):
        told.append(actor.act())
        actor.follow(state)
    changes = np.flatnonzero((np.diff(told, axis=0) != 0).any(axis=1))
    assert np.diff(changes).max() <= SETTINGS.patience + 1


def test_a_plan_is_followed_as_long_as_it_may_come_true() -> None:
    agent = untrained(2)
    actor, state = agent.actor(), np.zeros(agent.window.state_size)
    actor.begin(state, [560.0, 440.0])
    mind, single, plans, followed = actor._mind, actor._single, actor._courses, []
    for _ in range(20):
        followed.append(plans.plan(mind, single))
        single.fleet.actions[0] = IN_OUT, OUT_IN  # time passes, and the arm stays where it is
    periods = round(courses.behind(SETTINGS.reward) / -SETTINGS.reward.action)
    assert periods == 8
    assert followed == [True] * (periods + 1) + [False] * (19 - periods)
    np.testing.assert_array_equal(plans._plan[0], (IN_OUT, OUT_IN))
    actor.begin(state, [560.0, 440.0])
    assert plans.plan(mind, single)  # another movement
    actor.begin(state, [5_000.0, 440.0])  # there is no plan to where the arm cannot be
    assert not any(plans.plan(mind, single) for _ in range(3))


def test_plans_are_followed_where_switches_cost_nothing_too() -> None:
    reward = SETTINGS.reward
    assert courses.behind(replace(reward, switch=0.0)) == courses.behind(reward) == 8
    assert courses.behind(replace(reward, switch=-20.0)) == 20


def test_one_joint_decides_as_without_plans() -> None:
    agent = untrained(1)
    np.testing.assert_array_equal(moved(agent, 0).reward, moved(agent, SETTINGS.nodes).reward)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_course_of_the_highest_return_is_found_wherever_it_stands(place: int) -> None:
    agent = untrained(2)
    mind, noise = agent.mind(at_rest(2)), np.zeros((12, 4), np.uint64)
    single, many = lanes(mind, agent.sizes, random_states(0, 1)), lanes(mind, agent.sizes, noise)
    single.fleet.goal[0] = 560.0, 440.0
    single.fleet.x[mind.limits.layout.goal : mind.limits.layout.goal + 2, 0] = 0.15, -0.15  # 60 of 400 counts
    towards, away, waiting = (IN_OUT, OUT_IN), (OUT_IN, IN_OUT), (CLOSED, CLOSED)
    courses = np.array([np.tile(one, (20, 1)) for one in (away, waiting, waiting)])
    courses[place] = towards
    if place != 0:
        courses[0] = away
    assert compare(mind, single, many, np.zeros(12, np.int64), courses, 20) == place
    totals = [many.total[k::3].mean() for k in range(3)]
    assert totals[place] == max(totals) > 20


@pytest.fixture
def sought(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return for how many states each search has room, from now on."""
    seen: list[int] = []

    def noted(world: Any, states: Any, problem: Any, workspace: search.Tree, *last: Any) -> search.Plan:
        seen.append(len(workspace.free))
        return find(world, states, problem, workspace, *last)

    find = search.find
    monkeypatch.setattr(courses, "find", noted)
    return seen


@pytest.fixture
def compared(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return in how many simulated arms courses are compared each time, from now on in every turn."""
    seen: list[int] = []
    plan = courses.Courses.plan
    monkeypatch.setattr(courses.Courses, "plan", lambda self, mind, single: plan(self, mind, single) and False)

    def noted(mind: Any, single: Any, many: Any, *how: Any) -> int:
        seen.append(len(many.total))
        best: int = compare(mind, single, many, *how)
        return best

    monkeypatch.setattr(courses, "compare", noted)
    return seen


def readings(late: int) -> Iterator[Reading]:
    """Yield readings of an arm at rest; from the fourth on ``late`` come a period after they were due."""
    period, time = simulation(2).spec.period, 0.0
    for turn in count():
        yield Reading(time, np.full(2, 500.0), np.full((2, 2), 500.0))
        time += period * (2 if 2 <= turn < 2 + late else 1)


@pytest.mark.parametrize(("late", "parts"), [(0, [1, 1, 1, 1]), (1, [2, 2, 2, 2]), (3, [2, 4, 4, 4])])
def test_decisions_take_half_as_long_where_turns_come_late_but_never_hardly_any_time(
    sought: list[int], compared: list[int], late: int, parts: list[int]
) -> None:
    agent = untrained(2)
    controller = AgentController(replace(agent, settings=replace(agent.settings, lookahead=96)))
    controller.reset(np.array([560.0, 440.0]))
    for reading, _ in zip(readings(late), range(7), strict=False):
        controller.act(reading)
    assert sought[:3] == [sought[0]] * 3
    assert sought[3:] == [sought[0] // part for part in parts]
    assert compared == [96, 96, 96, *(96 // part for part in parts)]


def test_what_little_is_looked_ahead_is_not_halved(compared: list[int]) -> None:
    agent = untrained(2)
    controller = AgentController(replace(agent, settings=replace(agent.settings, lookahead=20)))
    controller.reset(np.array([560.0, 440.0]))
    for reading, _ in zip(readings(3), range(7), strict=False):
        controller.act(reading)
    assert compared == [20, 20, 20, 18, 18, 18, 18]


def test_several_joints_practise_more() -> None:
    settings = PolicySettings(updates=10, practice=3)
    assert scaled_for_joints(settings, simulation(1)) == settings
    assert [scaled_for_joints(settings, simulation(joints)).updates for joints in (2, 3)] == [30, 90]
