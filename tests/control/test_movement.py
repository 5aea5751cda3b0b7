"""A movement is counted as the definitions say, whoever moves."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, ControlCycle, Reading, guarded
from pneumarm.control import LearningController, move
from pneumarm.errors import ControllerFailure
from pneumarm.simulation import SimulationArm
from pneumarm.task import Reward, TaskSettings
from simple_simulation import QUIET, simulation

GOAL = np.array([500.0])


class Dial(Arm):
    """An arm whose angle is what the valves of muscle 1 add up to, 10 counts a period."""

    def __init__(self, begin: float, over_pressure: bool = False) -> None:
        self.spec = ArmSpec(period=0.04)
        self.time, self.angle, self.valve = 0.0, begin, 0
        self.pressure = 300.0 if over_pressure else 20.0

    def read(self) -> Reading:
        return Reading(self.time, np.array([self.angle]), np.array([[self.pressure, 20.0]]))

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        self.valve = int(valves[0, 0])

    def wait(self, seconds: float) -> None:
        self.time += seconds
        self.angle += 10 * self.valve * seconds / self.spec.period

    def close(self) -> None:
        self.valve = 0


class Player:
    """Plays valves of muscle 1 in order, and notes what it is told."""

    def __init__(self, *valves: int) -> None:
        self.valves, self.told = list(valves), []

    def reset(self, goal: NDArray[np.float64]) -> None:
        self.goal = goal

    def act(self, reading: Reading) -> NDArray[np.int8]:
        return np.array([[self.valves.pop(0), 0]], np.int8)


class Pupil(Player):
    """A player that is also told what its actions led to."""

    def observe(
        self, reading: Reading, applied: NDArray[np.int8], reward: NDArray[np.float64], terminal: bool
    ) -> None:
        self.told.append((reading.angle[0], int(applied[0, 0]), reward[0], terminal))


def test_actions_switches_and_reward_are_counted_by_hand() -> None:
    pupil = Pupil(1, 1, -1, 1)
    arm = Dial(455)
    made = move(ControlCycle(guarded(arm)), pupil, GOAL)
    # 455 -> 465 -> 475: within 25 of the goal and slow (10 counts in 40 ms) after two actions.
    assert (made.actions, made.switches.tolist(), made.reward, made.success) == (2, [0], 49.0, True)
    assert made.velocity_end == pytest.approx([0.25])
    assert pupil.told == [(465.0, 1, -1.0, False), (475.0, 1, 50.0, True)]
    assert arm.valve == 0


def test_a_goal_is_reached_after_an_action_at_the_earliest_and_switches_cost() -> None:
    made = move(ControlCycle(guarded(Dial(500))), Player(0), GOAL)
    assert (made.actions, made.reward, made.success) == (1, 50.0, True)
    made = move(ControlCycle(guarded(Dial(445))), Player(1, -1, 1, 1, 1), GOAL)
    assert (made.actions, made.switches.tolist(), made.reward) == (5, [2], 50.0 - 4 - 16)


def test_a_movement_is_cut_off_and_that_is_no_terminal_state() -> None:
    pupil = Pupil(*[0] * 9)
    made = move(ControlCycle(guarded(Dial(100))), pupil, GOAL, TaskSettings(cutoff=7))
    assert (made.actions, made.reward, made.success) == (7, -7.0, False)
    assert [terminal for *_, terminal in pupil.told] == [False] * 7


def test_what_counts_is_what_the_guard_let_through() -> None:
    pupil = Pupil(1, 0, 1, 0)
    made = move(ControlCycle(guarded(Dial(100, over_pressure=True))), pupil, GOAL, TaskSettings(cutoff=4))
    assert made.switches.tolist() == [0]
    assert np.nanmax(made.recorded.command) == 0
    assert [applied for _, applied, *_ in pupil.told] == [0, 0, 0, 0]


def test_a_movement_is_recorded_whole() -> None:
    made = move(ControlCycle(guarded(Dial(455))), Player(1, 1), GOAL)
    assert made.recorded.angle[:, 0].tolist() == [455, 465, 475]
    assert made.recorded.command[:2, 0, 0].tolist() == [1, 1]
    assert np.isnan(made.recorded.command[2]).all()
    assert made.recorded.at_rest
    assert made.time_end - made.time_start == pytest.approx(0.08)


def test_too_fast_at_the_goal_is_not_at_the_goal() -> None:
    made = move(
        ControlCycle(guarded(Dial(455))), Player(1, 1), GOAL, TaskSettings(Reward(velocity_tolerance=0.2), cutoff=2)
    )
    assert not made.success


def test_valves_are_closed_when_a_controller_fails() -> None:
    arm = Dial(100)
    with pytest.raises(ControllerFailure, match="IndexError"):
        move(ControlCycle(guarded(arm)), Player(1), GOAL)
    assert arm.valve == 0


def test_only_who_observes_is_taught() -> None:
    assert isinstance(Pupil(), LearningController)
    assert not isinstance(Player(), LearningController)


@pytest.mark.parametrize("joints", [1, 2])
def test_any_number_of_joints(joints: int) -> None:
    class Both(Player):
        def act(self, reading: Reading) -> NDArray[np.int8]:
            return np.tile(np.array([self.valves.pop(0), 0], np.int8), (joints, 1))

    arm = guarded(SimulationArm(simulation(joints), noise=QUIET))
    made = move(ControlCycle(arm), Both(1, 0, 1, 0), np.full(joints, 100.0), TaskSettings(cutoff=4))
    assert made.switches.tolist() == [3] * joints
    assert made.reward == -4 - 8 * 3 * joints


def test_what_a_controller_does_after_the_end_is_recorded_and_not_counted() -> None:
    pupil, begin = Pupil(1, 1, 0, 0, 1, 1), 455
    held = move(ControlCycle(guarded(Dial(begin))), pupil, GOAL, hold=0.24)
    ended = move(ControlCycle(guarded(Dial(begin))), Pupil(1, 1), GOAL)
    assert held.row() == ended.row()
    assert len(pupil.told) == 2
    assert held.recorded.angle[:, 0].tolist() == [455, 465, 475, 475, 475, 485, 495]
