"""Stop operators: where a joint is within the band that it drags along."""

import numpy as np

from pneumarm.transitions.hysteresis import stops_of


def test_operators_follow_up_to_their_radius_and_begin_anew_with_a_sequence() -> None:
    angle = np.array([0.0, 2.0, 4.0, 3.0, -9.0, 50.0, 51.0])[:, None]
    first = np.array([0, 0, 0, 0, 0, 5, 5])
    stops = stops_of(angle, first, np.array([1.0, 3.0]))
    assert stops[:, 0].tolist() == [0, 1, 1, 0, -1, 0, 1]
    assert stops[:, 1].tolist() == [0, 2, 3, 2, -3, 0, 1]


def test_joints_have_operators_of_their_own() -> None:
    angle = np.array([[0.0, 0.0], [1.0, -1.0], [1.0, 5.0]])
    stops = stops_of(angle, np.zeros(3, np.int64), np.array([2.0, 4.0]))
    assert stops[-1].tolist() == [1, 1, 2, 4]
