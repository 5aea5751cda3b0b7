"""Goals are combinations of angles that the record has seen."""

import numpy as np
import pytest

from pneumarm.transitions.goals import Goals, seen_goals
from pneumarm.transitions.rows import Rows

RANGE = np.array([[200.0, 800.0], [300.0, 700.0]])


def rows(angle: np.ndarray) -> Rows:
    n, joints = angle.shape
    still = np.zeros((n, joints, 2))
    return Rows(np.zeros(n, np.int64), np.arange(n), np.arange(n) / 30, angle, still, still, np.ones(n, bool))


def wander(holds, n: int = 30_000) -> np.ndarray:
    """Stand at random places that ``holds``, half of the time; swing anywhere in between."""
    random = np.random.default_rng(1)
    places = random.uniform(*RANGE.T, (20 * n, 2))
    places = places[holds(places)][: n // 4].repeat(4, axis=0)
    places[2::4] = random.uniform(*RANGE.T, (len(places[2::4]), 2))
    return places


def test_all_within_the_range_are_goals_where_nothing_else_is_known():
    goals = Goals.of(RANGE)
    drawn = goals.draw(np.random.default_rng(0), 5)
    np.testing.assert_array_equal(drawn, np.random.default_rng(0).uniform(*RANGE.T, (5, 2)))
    assert goals.contain(drawn).all()
    assert not goals.contain(np.array([100.0, 500.0]))
    assert Goals.of(goals) is goals
    far = np.array([[100.0, 900.0], [500.0, 500.0]])
    np.testing.assert_allclose(goals.within(far), far)


def test_one_joint_has_a_range_and_nothing_else():
    path = np.linspace(0, 1000, 500)[:, None]
    goals = seen_goals(lambda: [rows(path)], np.array([[10.0, 990.0]]))
    assert goals.ways.shape == (0, 1)


def test_where_every_combination_was_seen_every_one_is_a_goal():
    path = wander(lambda places: np.ones(len(places), bool))
    goals = seen_goals(lambda: [rows(path)], RANGE)
    every = np.random.default_rng(2).uniform(*RANGE.T, (10_000, 2))
    assert goals.contain(every).mean() > 0.98


@pytest.mark.parametrize("side", [1, -1])
def test_what_both_joints_cannot_hold_together_is_no_goal(side):
    """Though each angle was seen for itself, and the arm swung through the combination."""

    def holds(places):
        outer = (places - RANGE.mean(axis=1)) / (np.ptp(RANGE, axis=1) / 2)
        return outer[:, 0] + side * outer[:, 1] < 0.6

    path = wander(holds)
    goals = seen_goals(lambda: [rows(path[:20_000]), rows(path[20_000:])], RANGE)
    drawn = goals.draw(np.random.default_rng(3), 5_000)
    outer = (drawn - RANGE.mean(axis=1)) / (np.ptp(RANGE, axis=1) / 2)
    assert (outer[:, 0] + side * outer[:, 1]).max() < 0.75
    assert goals.contain(drawn).all()
    held = np.random.default_rng(4).uniform(*RANGE.T, (10_000, 2))
    held = held[holds(held)]
    assert goals.contain(held).mean() > 0.97
    corner = RANGE[:, 1].copy() if side == 1 else np.array([RANGE[0, 1], RANGE[1, 0]])
    assert not goals.contain(corner)
    assert goals.contain(0.999 * goals.within(corner) + 0.001 * goals.middle)
    np.testing.assert_allclose(goals.within(drawn), drawn)
