import numpy as np
import pytest

from pneumarm.arm import ArmSpec, Reading
from pneumarm.arm.seam import checked
from pneumarm.arm.valves import ACTIONS, CLOSED, VALVES, to_actions, to_valves
from pneumarm.errors import UnusableInput


def test_actions_and_valves_are_one_to_one():
    actions = np.arange(ACTIONS)
    assert np.array_equal(to_actions(to_valves(actions)), actions)
    assert {tuple(v) for v in VALVES.tolist()} == {(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)}
    assert to_valves(CLOSED).tolist() == [0, 0]
    assert to_actions([[[-1, 1], [1, 0]]]).tolist() == [[2, 7]]


def test_a_proper_reading_is_handed_on_as_it_is():
    reading = Reading(1.0, np.array([3.0]), np.array([[1.0, 2.0]]))
    assert checked(reading, ArmSpec()) is reading


def test_a_reading_in_lists_becomes_arrays_and_keeps_its_extras():
    velocity = np.array([0.5])
    reading = checked(Reading(1, [3], [1, 2], velocity=velocity), ArmSpec())
    assert reading.angle.tolist() == [3.0]
    assert reading.pressure.tolist() == [[1.0, 2.0]]
    assert type(reading.time) is float
    assert reading.velocity is velocity


def test_counts_and_units():
    spec = ArmSpec()
    assert spec.degrees(511.5) == 0
    assert spec.degrees(511.5 + 11.378) == pytest.approx(1)
    assert spec.bar([166, 83]).tolist() == [1.0, 0.5]
    assert spec.max_pressure_counts == pytest.approx(174.3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"joints": 0},
        {"joints": 1.5},
        {"period": 0.0},
        {"period": float("nan")},
        {"latency": 0.05},
        {"latency": -0.001},
        {"angle_range": (5.0, 5.0)},
        {"max_pressure": -1.0},
        {"counts_per_bar": float("inf")},
    ],
)
def test_impossible_specs_are_refused(wrong):
    with pytest.raises(UnusableInput, match=f"ArmSpec: {next(iter(wrong))} cannot be"):
        ArmSpec(**wrong)
