"""The inverse simulation (thesis eq. 4.17): turned round transitions, steps back, and which actions are possible."""

import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.simulation.inverse import InverseSimulation, fit_inverse, nearest, turned_round
from pneumarm.transitions import Transitions

pytest.importorskip("scipy.spatial")
GAIN = 0.2
"""Share of what a valve's pressure is still away from, that a period brings."""


def a_step(observation: NDArray[np.float64], valves: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what follows: muscles fill to 180 counts, or empty, and the joint turns by what they differ."""
    pressure = observation[:, 2:]
    target = np.where(valves > 0, 180.0, np.where(valves < 0, 0.0, pressure))
    after = pressure + GAIN * (target - pressure)
    angle = observation[:, :1] + 0.1 * (pressure[:, :1] - pressure[:, 1:])
    return np.concatenate([angle, 0.1 * (pressure[:, :1] - pressure[:, 1:]) / 33.0, after], axis=1)


def recorded(count: int, seed: int) -> Transitions:
    random = np.random.default_rng(seed)
    before = np.column_stack([random.uniform(350, 670, count), np.zeros(count), random.uniform(0, 180, (count, 2))])
    valves = random.integers(-1, 2, (count, 2)).astype(float)
    numbers = np.arange(count)
    return Transitions(
        np.concatenate([before, valves], axis=1).astype(np.float32),
        a_step(before, valves).astype(np.float32),
        numbers, numbers, np.full(count, 0.033, np.float32), 0.033 * numbers,
    )  # fmt: skip


@pytest.fixture(scope="module")
def inverse() -> InverseSimulation:
    goals = np.array([[350.0, 670.0]])
    return fit_inverse(recorded(4_000, 0), recorded(500, 1), ArmSpec(joints=1, name="made up"), goals)


def test_transitions_turned_round_twice_are_as_they_were() -> None:
    known = recorded(50, 0)
    back = turned_round(known)
    np.testing.assert_array_equal(back.target, known.observation)
    np.testing.assert_array_equal(back.inputs[:, 4:], known.inputs[:, 4:])
    np.testing.assert_array_equal(turned_round(back).inputs, known.inputs)


def test_a_step_back_is_where_the_step_came_from(inverse: InverseSimulation) -> None:
    for command in np.array([[0.0, 0.0], [1.0, -1.0], [-1.0, 0.0]]):
        before = np.array([[500.0, 0.0, 90.0, 40.0], [420.0, 0.0, 30.0, 120.0]])
        after = a_step(before, np.tile(command, (2, 1)))
        assert inverse.is_possible(after, command).all()
        np.testing.assert_allclose(inverse.before(after, command)[:, [0, 2, 3]], before[:, [0, 2, 3]], atol=4.0)


def test_a_full_muscle_cannot_just_have_let_air_out(inverse: InverseSimulation) -> None:
    """After a period of letting air out at most 144 of 180 counts are left, after letting air in at least 36."""
    full, empty = np.array([[510.0, 0.54, 179.0, 2.0]]), np.array([[510.0, -0.27, 1.0, 90.0]])
    out, into = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    assert not inverse.is_possible(full, out)[0]
    assert inverse.is_possible(full, into)[0]
    assert not inverse.is_possible(empty, into)[0]
    assert inverse.is_possible(empty, out)[0]


def test_a_command_that_was_never_recorded_is_not_possible(inverse: InverseSimulation) -> None:
    assert not inverse.is_possible(np.array([[510.0, 0.0, 90.0, 90.0]]), np.array([0.5, 0.0])).any()


def test_without_its_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.spatial", None)
    with pytest.raises(UnusableInput, match=r"the inverse simulation needs scipy: pip install 'pneumarm\[inverse\]'"):
        nearest(np.zeros((2, 2)))
