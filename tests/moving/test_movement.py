"""Movements as people mean them, on an arm that does exactly what it is told."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, Reading
from pneumarm.arm.reference import Reference, constant
from pneumarm.errors import UnusableInput
from pneumarm.moving import Holding, MoveSettings, at_period, move, track
from pneumarm.task.changes import valve_changes


class Steered(Arm):
    """An arm that moves by 2 degrees in a period in which only its first muscle is filled, and back."""

    def __init__(self) -> None:
        self.spec = ArmSpec(period=0.1, counts_per_degree=10.0, angle_range=(0.0, 1000.0))
        self.time, self.angle, self.way = 0.0, 500.0, 0.0

    def read(self) -> Reading:
        return Reading(self.time, np.array([self.angle]), np.zeros((1, 2)))

    def set_valves(self, valves: NDArray[Any]) -> None:
        self.way = float(valves[0, 0])

    def wait(self, seconds: float) -> None:
        self.time += seconds
        self.angle += 20 * self.way * seconds / self.spec.period

    def close(self) -> None:
        self.way = 0.0


class Towards:
    """Goes to the goal a step a period; from ``stuck`` periods on it does nothing."""

    def __init__(self, stuck: int = 10**9) -> None:
        self.resets = 0
        self.stuck = stuck
        self.asked = 0

    def reset(self, goal: NDArray[np.float64]) -> None:
        self.track(constant(goal))
        self.resets += 1

    def track(self, reference: Reference) -> None:
        self.reference, self.begin = reference, None

    def act(self, reading: Reading) -> NDArray[np.int8]:
        self.begin = reading.time if self.begin is None else self.begin
        self.asked += 1
        off = self.reference.at(reading.time - self.begin) - reading.angle
        way = 0 if abs(off[0]) < 15 or self.asked > self.stuck else int(np.sign(off[0]))
        return np.array([[way, 0]], np.int8)


def test_a_movement_settles_when_it_no_longer_leaves_the_tolerance() -> None:
    (moved,) = move(Steered(), Towards(), [[600.0]], MoveSettings(hold=3.0))
    assert moved.success
    assert (moved.time_start, moved.time_settled) == (0.0, pytest.approx(0.5))
    assert (moved.tries, moved.switches) == (1, 2)
    np.testing.assert_allclose(moved.goal_degrees, [10.0])
    np.testing.assert_allclose(moved.rest_error, [0.0], atol=1e-9)
    assert moved.recorded.time[-1] == pytest.approx(3.0)
    assert moved.results()["air_litres"] is None
    assert set(moved.results()) == {
        "goal_deg", "time_start", "time_settled", "rest_error_deg", "overshoot_deg", "success", "tries", "switches",
        "air_litres",
    }  # fmt: skip


@pytest.mark.parametrize(("hold", "changes"), [(3.0, 0), (1.4, 1), (0.9, 2)])
def test_valve_changes_at_rest_are_those_of_the_last_second(hold: float, changes: int) -> None:
    (moved,) = move(Steered(), Towards(), [[600.0]], MoveSettings(hold=hold, tries=1))  # open from 0 to 0.5 s
    assert moved.changes_at_rest.tolist() == [changes]


@pytest.mark.parametrize(("hold", "settles"), [(0.7, False), (0.9, True)])
def test_an_arm_that_is_there_at_the_end_only_has_not_settled(hold: float, settles: bool) -> None:
    (moved,) = move(Steered(), Towards(), [[600.0]], MoveSettings(hold=hold, tries=1))  # there after 0.5 s
    assert moved.success == settles
    (moved,) = move(Steered(), Towards(), [[600.0]], MoveSettings(hold=hold, tries=1, dwell=0.1))
    assert moved.success


def test_a_movement_that_fails_is_tried_again_after_a_pause() -> None:
    arm, stuck = Steered(), Towards(stuck=3)
    (moved,) = move(arm, stuck, [[600.0]], MoveSettings(hold=1.0, tries=3))
    assert (moved.success, moved.time_settled, moved.tries, stuck.resets) == (False, None, 3, 3)
    np.testing.assert_allclose(moved.rest_error, [4.0])
    assert arm.time == pytest.approx(3 * 1 + 2 * 2)
    stuck.stuck = 10**9
    (moved,) = move(arm, stuck, [[600.0]])
    assert moved.success


def test_goals_are_taken_one_after_the_other() -> None:
    arm, given = Steered(), []

    def goals() -> Any:
        for goal in (600.0, 400.0):
            given.append(arm.time)
            yield [goal]

    made = list(move(arm, Towards(), goals(), MoveSettings(hold=2.5)))
    np.testing.assert_allclose(given, [0.0, 2.5])
    assert [one.success for one in made] == [True, True]
    with pytest.raises(UnusableInput, match="1 finite angle"):
        list(move(arm, Towards(), [[1.0, 2.0]]))


def test_tracking_begins_where_the_reference_begins() -> None:
    arm = Steered()
    followed = track(arm, Towards(), Reference(lambda time: np.array([600.0 + 100 * time])), 4.0)
    assert followed.time_start == pytest.approx(2.0)
    assert followed.seconds == pytest.approx(4.0)
    assert 0 < followed.rms_error[0] < 2.0
    assert set(followed.results()) == {"time_start", "seconds", "rms_error_deg", "switches", "air_litres"}
    with pytest.raises(UnusableInput, match="86400"):
        track(arm, Towards(), constant([600.0]), 0.0)


class Late(Steered):
    """One whose waits are a tenth of a period longer once 1.5 s have passed."""

    def wait(self, seconds: float) -> None:
        super().wait(seconds * (1.1 if 1.5 < self.time < 2.05 else 1.0))


def test_what_is_asked_for_counts_from_when_the_reference_began_and_not_from_a_late_turn() -> None:
    asked: list[float] = []

    def wave(time: float) -> NDArray[np.float64]:
        asked.append(time)
        return np.array([600.0 + 100 * time])

    followed = track(Late(), Towards(), Reference(wave), 3.0)
    assert followed.time_start == pytest.approx(2.0)
    assert followed.time[0] == followed.recorded.time[0] - 2.0
    assert followed.time[0] > 0.005  # the turn was late
    np.testing.assert_allclose(followed.wanted[:, 0], 600.0 + 100 * followed.time)
    np.testing.assert_allclose(
        followed.rms_error[0], np.sqrt(np.mean((followed.recorded.angle - followed.wanted) ** 2)) / 10
    )


def test_times_of_a_movement_are_those_of_its_last_try() -> None:
    (moved,) = move(Steered(), Towards(stuck=3), [[600.0]], MoveSettings(hold=1.0, tries=2))
    assert moved.tries == 2
    assert moved.time[0] == 0.0
    assert moved.time[-1] == pytest.approx(1.0)


def test_changes_of_valves_are_counted_by_muscle_and_a_pulse_is_two() -> None:
    commands = np.array([[[0, 0]], [[1, 0]], [[1, -1]], [[0, -1]], [[1, -1]]])
    assert valve_changes(commands).sum() == 4
    assert valve_changes(np.array([[[0.5, 0]], [[0.5, 0]], [[1.0, 0]], [[0.3, 0]]])).tolist() == [[2 + 2 + 1 + 1, 0]]


class Reaches(Towards):
    """Only reaches goals, and goes on moving about there."""

    def act(self, reading: Reading) -> NDArray[np.int8]:
        valves = super().act(reading)
        return valves if valves.any() else np.array([[1, 0]], np.int8)


def test_a_controller_that_only_reaches_goals_is_made_to_hold_them() -> None:
    arm, inner = Steered(), Reaches()
    holding = Holding(inner, arm.spec, np.array([[0.0, 1000.0]]), tolerance=4.0)
    (moved,) = move(arm, holding, [[600.0]], MoveSettings(tolerance=4.0))
    assert moved.success
    assert moved.switches <= 2
    arm.angle += 50.0  # pushed
    (moved,) = move(arm, holding, [[600.0]], MoveSettings(tolerance=4.0))
    assert moved.success
    followed = track(arm, holding, Reference(lambda time: np.array([600.0 + 50 * time])), 4.0)
    assert followed.rms_error[0] < 6.0


def test_another_period_is_chosen_before_the_guard() -> None:
    arm = Steered()
    at_period(arm, 0.01)
    assert (arm.spec.period, arm.spec.latency) == (0.01, 0.0)
