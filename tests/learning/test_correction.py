"""Corrections of a moving reference: what is missed again and again is learned, what is missed by far is not."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.arm.reference import Reference
from pneumarm.learning.servo.correction import Correction, features_of
from pneumarm.learning.servo.following import Following

MIDDLE = np.array([500.0])
PERIOD = 1 / 30


def followed(plant, reference, steps: int = 600) -> np.ndarray:
    """Return the errors (steps,) of a joint that ``plant`` moves from what it is asked for and the step."""
    correction, errors = Correction(1, 25.0), []
    for k in range(steps):
        path = np.array([[reference(k + ahead)] for ahead in (-1, 0, 1)])
        features = features_of(path, MIDDLE)
        asked = reference(k) + correction.of(features)[0, 0]
        errors.append(reference(k) - plant(asked, k))
        correction.learn(np.array([errors[-1]]), features[0])
    return np.abs(errors)


def wave(frequency: float, amplitude: float = 100.0):
    return lambda k: 500 + amplitude * np.sin(2 * np.pi * frequency * PERIOD * k)


@pytest.mark.parametrize("frequency", [0.1, 0.5, 1.0, 2.0])
def test_a_bias_a_gain_and_a_lag_are_learned(frequency: float) -> None:
    reference = wave(frequency)

    def plant(asked: float, k: int) -> float:
        slope = reference(k) - reference(k - 1)
        return asked - 8.0 - 0.05 * (reference(k) - 500) - 0.4 * slope

    errors = followed(plant, reference)
    assert errors[-100:].max() < 0.2 * errors[:30].max()


def test_a_constant_reference_gets_integral_action() -> None:
    errors = followed(lambda asked, k: asked - 10.0, lambda k: 620.0, 200)
    assert errors[0] == pytest.approx(10.0)
    assert errors[-1] < 0.1


@pytest.mark.parametrize("error", [300.0, -300.0, 25.5, -25.5])
def test_errors_of_a_joint_on_its_way_teach_nothing(error: float) -> None:
    correction = Correction(1, 25.0)
    features = features_of(np.array([[500.0], [510.0], [520.0]]), MIDDLE)
    for _ in range(50):
        correction.learn(np.array([error]), features[0])
    assert correction.of(features)[0, 0] == 0


@pytest.mark.parametrize("error", [24.5, -24.5])
def test_no_correction_is_larger_than_twice_the_largest_error_that_teaches(error: float) -> None:
    correction = Correction(1, 25.0)
    features = features_of(np.array([[500.0], [510.0], [520.0]]), MIDDLE)
    for _ in range(300):
        correction.learn(np.array([error]), features[0])
    assert correction.of(features)[0, 0] == np.copysign(50.0, error)


def test_what_was_learned_is_forgotten_where_it_may_be_what_is_wrong() -> None:
    correction = Correction(1, 25.0)
    features = features_of(np.array([[500.0], [510.0], [520.0]]), MIDDLE)
    for _ in range(50):
        correction.learn(np.array([20.0]), features[0])
    assert correction.of(features)[0, 0] == pytest.approx(50.0)  # no more than twice the largest error that teaches
    for _ in range(30):
        correction.learn(np.array([300.0]), features[0])
    assert correction.of(features)[0, 0] < 5


def test_what_the_policy_misses_is_no_longer_corrected_where_plans_take_its_place() -> None:
    spec, tolerance = ArmSpec(), ArmSpec.counts_per_degree
    settings, goals = SimpleNamespace(tolerance=1.0), np.array([[300, 700]])
    agent: Any = SimpleNamespace(spec=spec, goal_range=goals, settings=settings)
    plans: Any = SimpleNamespace(gains=lambda *_: 0.0)
    following = Following(Reference(lambda time: np.array([500 + 100 * np.sin(3 * time)])), agent, tolerance)
    moves, unused = np.array([True]), np.zeros(1, np.float32)
    for k in range(30):
        path = following.path(k * spec.period, 3)
        corrections = following.corrections(path, moves, path[1] - tolerance)
        planned = following.is_planned(plans, moves, np.array([3 * tolerance]), unused, unused)
        assert planned == (k == 29)  # a second of errors that are larger than those hoped of plans
    assert corrections.min() > tolerance / 2
    path = following.path(30 * spec.period, 3)
    assert following.corrections(path, moves, path[1]).tolist() == [[0.0]] * 4
