"""Figures of the goals that people give."""

import numpy as np
import pytest

from pneumarm.live.figures import HELD, PlayFigures
from pneumarm.moving.movement import MoveSettings
from pneumarm.moving.settling import settled_at


def see(figures: PlayFigures, errors: list[float], begin: float = 0.0) -> None:
    for number, error in enumerate(errors):
        figures.see("pid", begin + 0.1 * number, np.array([0.2, error]))


def test_a_goal_that_is_left_alone_is_counted() -> None:
    figures = PlayFigures()
    figures.new_goal(0.0, np.array([0.0, 20.0]))
    see(figures, [20, 10, 0.5, 1.5, 0.9, *[0.4] * 20])
    found = figures.of("pid").results()
    assert (found["goals"], found["settled"]) == (1, 1)
    assert found["time"] == pytest.approx(0.4)
    assert found["rest"] == pytest.approx(0.4)


def test_one_that_is_not_settled_at_counts_too_and_a_near_one_does_not() -> None:
    figures = PlayFigures()
    figures.new_goal(0.0, np.array([20.0]))
    see(figures, [3.0] * 25)
    figures.new_goal(10.0, np.array([3.0]))
    see(figures, [0.1] * 25, begin=10.0)
    assert figures.of("pid").results() == {
        "goals": 1,
        "settled": 0,
        "time": None,
        "rest": pytest.approx(3.0),
        "curve": None,
    }


def test_settled_is_what_it_is_for_a_move() -> None:
    """Readings that scatter at the goal are no reason to have left it; to pass it at the end is not to settle."""
    noise = np.random.default_rng(0).normal(0, 0.5, 60)
    coming = 20 * np.maximum(1 - np.arange(60) / 12, 0.0)
    passing = np.where(np.arange(60) < 55, 4.0, 0.3)
    found = []
    for errors in (coming + noise, passing):
        figures, times = PlayFigures(), np.arange(60) / 28
        figures.new_goal(0.0, np.array([20.0]))
        for time, error in zip(times, errors, strict=True):
            figures.see("pid", time, np.array([error]))
        found.append(figures.of("pid").results())
        seen = times <= HELD + 1 / 28
        settled = settled_at(times[seen], errors[seen, None], MoveSettings.tolerance, MoveSettings.dwell)
        assert found[-1]["time"] == settled
    assert [one["settled"] for one in found] == [1, 0]
    assert found[0]["time"] == pytest.approx(12 / 28, abs=0.1)


def test_a_goal_that_is_dragged_counts_from_its_last_place() -> None:
    figures = PlayFigures()
    for step in range(5):
        figures.new_goal(float(step), np.array([0.0, 20.0]))
        figures.see("pid", float(step), np.array([0.0, 20.0]))
    see(figures, [20.0, *[0.5] * 25], begin=4.0)
    assert figures.of("pid").results()["goals"] == 1
    assert figures.of("pid").results()["time"] == pytest.approx(0.1)


def test_a_curve_has_the_root_of_its_mean_square() -> None:
    figures = PlayFigures()
    figures.new_curve()
    see(figures, [3.0, 4.0])
    figures.end_curve("pid")
    see(figures, [9.0])
    assert figures.of("pid").results()["curve"] == pytest.approx(np.sqrt(12.5))
