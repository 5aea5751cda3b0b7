"""A movement on an arm is counted by the same rules as one in simulation."""

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.arm.valves import to_valves
from pneumarm.task import Reward, TaskSettings
from pneumarm.task.movements import movements
from pneumarm.task.noting import goes_on, note_action
from pneumarm.task.reward import has_reached, is_switch, paid
from pneumarm.task.tally import Tally

REWARD = Reward(goal=40.0, action=-2.0, switch=-3.0)


@pytest.mark.parametrize("joints", [1, 3])
def test_an_arm_and_a_compiled_loop_count_alike(joints: int) -> None:
    random, task, cut_off = np.random.default_rng(joints), TaskSettings(REWARD, cutoff=7), 0
    for e in range(40):
        tally, record, last = Tally(task, ArmSpec(joints=joints)), movements(1, joints), np.full(joints, -1)
        goal = random.uniform(400, 600, joints)
        while not tally.over:
            actions = random.integers(3, 5, joints)
            angle = goal + random.uniform(-26, 26, joints) * (0.5, 1, 9)[e % 3]  # the last are cut off
            velocity = random.uniform(-1.2, 1.2, joints)
            gained = tally.count(to_valves(actions), angle, velocity, goal)
            parts = REWARD.parameters
            reached = all(has_reached(parts, *one) for one in zip(angle, velocity, goal, strict=True))
            switched = np.array([is_switch(*one) for one in zip(last, actions, strict=True)], np.int64)
            note_action(parts, switched, reached, record, 0)
            assert gained.tolist() == [paid(parts, reached, one) for one in switched]
            assert tally.over == (not goes_on.py_func(task, reached, record, 0))
            assert (tally.actions, tally.reward, tally.reached) == (record.actions[0], record.reward[0], reached)
            assert tally.paid == paid(parts, reached, switched.sum())
            last = actions
        cut_off += not tally.reached
        assert tally.actions <= 7
        assert tally.switches.tolist() == record.switches[0].tolist()
    assert 0 < cut_off < 40


def test_what_is_no_number_has_not_reached_a_goal() -> None:
    assert not REWARD.reached([np.nan], [0.0], [500.0])
    assert not has_reached(REWARD.parameters, np.nan, 0.0, 500.0)
    assert not has_reached(REWARD.parameters, 500.0, np.nan, 500.0)


def test_a_goal_is_reached_within_the_same_degrees_whatever_the_sensor_counts():
    fine = ArmSpec(counts_per_degree=10 * ArmSpec.counts_per_degree)
    for away, speed, reached in ((200, 5.0, True), (300, 5.0, False), (200, 15.0, False)):
        tally = Tally(TaskSettings(), fine)
        tally.count(np.zeros((1, 2), np.int8), np.array([5000.0 + away]), np.array([speed]), np.array([5000.0]))
        assert tally.reached == reached
    assert Reward().on(ArmSpec()) == Reward()
