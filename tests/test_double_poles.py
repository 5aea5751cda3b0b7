"""Two poles on a cart: the balance of energy, the order of the solution, and that evolution balances them."""

import math

import numpy as np
import pytest
from benchmarks import double_poles as poles
from numpy.typing import NDArray


def energy(state: NDArray[np.float64]) -> float:
    """Return kinetic and potential energy of cart and poles, thin rods hinged at an end [J]."""
    speed = state[1]
    total = 0.5 * poles.CART * speed**2
    for (mass, half), angle, turn in zip(poles.POLES, state[2::2], state[3::2], strict=True):
        sideways, upwards = speed + half * turn * math.cos(angle), -half * turn * math.sin(angle)
        total += 0.5 * mass * (sideways**2 + upwards**2) + 0.5 * (mass * half**2 / 3) * turn**2
        total += mass * poles.GRAVITY * half * math.cos(angle)
    return total


def test_energy_changes_by_what_the_force_does_and_friction_takes() -> None:
    random = np.random.default_rng(0)
    for _ in range(50):
        state, slope, force = random.normal(0, 0.5, 6), np.zeros(6), random.uniform(-10, 10)
        poles.slopes(state, force, poles.POLES, slope)
        tiny = 1e-6
        change = (energy(state + tiny * slope) - energy(state - tiny * slope)) / (2 * tiny)
        lost = poles.CART_FRICTION * abs(state[1]) + poles.HINGE_FRICTION * (state[3] ** 2 + state[5] ** 2)
        assert change == pytest.approx(force * state[1] - lost, abs=1e-6)


def test_the_solution_is_of_fourth_order() -> None:
    def after(steps: int) -> NDArray[np.float64]:
        state = np.array([0.1, 0.5, 0.1, -0.2, 0.05, 0.3])
        for _ in range(steps):
            poles.advance(state, 3.0, poles.POLES, np.zeros((6, 6)), 0.2 / steps)
        return state

    exact = after(2_000)
    errors = [np.abs(after(steps) - exact).max() for steps in (10, 20, 40)]
    ratios = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(ratios, 4.0, atol=0.4)


def test_poles_fall_without_a_force_and_from_the_middle_they_stay_up() -> None:
    still = np.zeros((poles.UNITS, poles.INPUTS + poles.UNITS), np.float32)
    fallen = poles.tried(still, 1_000)
    assert 20 < fallen.steps < 60, "0.4 to 1.2 s from 4.5 to 36 degrees"
    assert fallen.damping == pytest.approx(0.1 * fallen.steps / 1_000), "too short for the reward of standing still"
    assert poles.tried(still, 1_000, np.zeros(6)).steps == 1_000


def test_the_beginnings_are_gruaus() -> None:
    found = poles.beginnings()
    assert len(np.unique(found, axis=0)) == 625
    np.testing.assert_allclose(found[:, 0].max(), 2.16 * 0.9)
    assert (found[:, 4:] == 0).all()


def test_evolution_balances_the_poles_without_velocities() -> None:
    found = [poles.evolve("steps", seed, generations=100) for seed in range(3)]
    solved = [one for one in found if one.is_solved]
    assert solved, "none of three runs in 8,000 evaluations; half of all runs take fewer"
    assert poles.tried(solved[0].network, poles.LONG).steps == poles.LONG
