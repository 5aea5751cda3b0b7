"""Goals as angles and as x and y of the hand; forward and inverse kinematics."""

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.arm.hand import both_elbows, hand, link_ends, turning
from pneumarm.errors import UnusableInput
from pneumarm.task.goals import Goal, goal_at, goal_in_counts, goal_of
from pneumarm.transitions.goals import Goals

LINKS = (0.25, 0.2, 0.1)
RANGE = np.tile([200.0, 823.0], (3, 1))


def arm(joints: int) -> ArmSpec:
    return ArmSpec(joints=joints, links=LINKS[:joints])


def test_links_hang_down_in_a_line_at_0_and_turn_to_x_with_higher_angles() -> None:
    np.testing.assert_allclose(link_ends([0.0, 0.0], (0.25, 0.2)), [[0, 0], [0, -0.25], [0, -0.45]], atol=1e-15)
    np.testing.assert_allclose(hand([90.0, -90.0], (0.25, 0.2)), [0.25, -0.2], atol=1e-15)
    assert hand(np.zeros((4, 7, 3)), LINKS).shape == (4, 7, 2)


def test_how_the_hand_moves_is_the_difference_of_where_it_is() -> None:
    degrees, step = np.array([20.0, -35.0, 50.0]), 1e-4
    moved = [hand(degrees + step * one, LINKS) - hand(degrees - step * one, LINKS) for one in np.eye(3)]
    np.testing.assert_allclose(turning(degrees, LINKS), np.stack(moved, axis=-1) / (2 * step), atol=1e-10)


def test_two_joints_reach_a_point_with_either_elbow() -> None:
    degrees = np.array([25.0, -40.0])
    pairs = both_elbows(hand(degrees, LINKS[:2]), LINKS[:2])
    np.testing.assert_allclose(pairs[1], degrees)
    assert pairs[0, 1] == pytest.approx(40)
    np.testing.assert_allclose(hand(pairs[0], LINKS[:2]), hand(degrees, LINKS[:2]))
    assert both_elbows([0.5, 0.0], LINKS[:2]).shape == (0, 2)  # further than both links
    assert both_elbows([0.0, 0.01], LINKS[:2]).shape == (0, 2)  # nearer than their difference


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_every_place_that_the_hand_can_be_held_at_is_a_goal(joints: int) -> None:
    spec, goals = arm(joints), Goals.of(RANGE[:joints])
    for angle in goals.draw(np.random.default_rng(0), 25):
        xy = hand(spec.degrees(angle), spec.links)
        found = goal_at(xy, spec, goals)
        assert goals.contain(found.angle)
        np.testing.assert_allclose(hand(spec.degrees(found.angle), spec.links), xy, atol=0.0005 * sum(LINKS))


def test_of_two_elbows_the_one_is_taken_that_the_arm_holds_then_the_nearer_one() -> None:
    spec, bent = arm(2), np.array([600.0, 300.0])
    xy = hand(spec.degrees(bent), spec.links)
    other = goal_at(xy, spec, np.array([[100.0, 923.0], [511.5, 1000.0]])).angle
    assert other[1] > 511.5
    for before in (bent, other):
        np.testing.assert_allclose(goal_at(xy, spec, RANGE[:2], Goal(before)).angle, before)


def test_a_joint_alone_reaches_places_near_its_arc() -> None:
    spec = arm(1)
    assert goal_of("0.086m,-0.235m", spec, RANGE[:1]).angle == pytest.approx(511.5 + 20 * 11.378, abs=3)
    with pytest.raises(UnusableInput, match=r"nearest is about 0\.1..m,-0\.2..m"):
        goal_of("0.15m,-0.26m", spec, RANGE[:1])


def test_what_is_out_of_reach_is_refused_with_what_can_be_reached_and_that_is_a_goal() -> None:
    for text in ("0.3m,0.2m", "0.5m,-0.5m", "0m,0m"):
        with pytest.raises(UnusableInput, match=r"hand lie at x from -0.*m to 0.*m and y from") as refused:
            goal_of(text, arm(2), RANGE[:2])
        nearest = str(refused.value).rpartition("about ")[2]
        assert goal_of(nearest, arm(2), RANGE[:2]).xy is not None


@pytest.mark.parametrize("text", ["0.05m,-0.44m", "5cm, -44 cm", "50mm,-.44m"])
def test_lengths_have_a_unit(text: str) -> None:
    goal = goal_of(text, arm(2), RANGE[:2])
    np.testing.assert_allclose(goal.xy, [0.05, -0.44])


@pytest.mark.parametrize("text", ["0.05m", "0.05m,-0.4", "0.05m,10deg", "0.1m,-0.2m,0.1m"])
def test_a_place_is_two_lengths(text: str) -> None:
    with pytest.raises(UnusableInput, match="expected x and y"):
        goal_of(text, arm(2), RANGE[:2])


def test_an_arm_without_links_says_how_to_give_them() -> None:
    with pytest.raises(UnusableInput, match=r"links = \[0\.2, 0\.2\] under \[spec\] in its arm\.toml"):
        goal_of("0.1m,-0.3m", ArmSpec(joints=2), RANGE[:2])


@pytest.mark.parametrize("links", [(0.2,), (0.2, 0.0), (0.2, -0.1), (0.2, np.nan)])
def test_links_are_one_length_a_joint(links: tuple[float, ...]) -> None:
    with pytest.raises(UnusableInput, match="links"):
        ArmSpec(joints=2, links=links)


def test_goals_lie_where_the_arm_was_seen() -> None:
    spec, known = ArmSpec(), np.array([[300.0, 700.0]])
    for goal in (300.0, 700.0):
        assert goal_in_counts([goal], None, spec, known).tolist() == [goal]
    for goal in (299.0, 701.0, 1e6):
        with pytest.raises(UnusableInput, match="goals of joint 1 lie from"):
            goal_in_counts([goal], None, spec, known)


def test_joints_that_were_not_seen_to_hold_angles_together_are_not_asked_to() -> None:
    way = np.array([[1.0, 1.0]])
    goals = Goals(RANGE[:2], way, np.array([[723.0, 1323.0]]))
    assert goal_of("600,600", arm(2), goals).xy is None
    with pytest.raises(UnusableInput, match="not all of them together; towards it they reach") as refused:
        goal_of("800,800", arm(2), goals)
    goal_of(str(refused.value).rpartition("reach ")[2], arm(2), goals)
    with pytest.raises(UnusableInput, match="together"):
        goal_in_counts([800, 800], None, arm(2), goals)
    goal_in_counts([800, 800], None, arm(2), RANGE[:2])
