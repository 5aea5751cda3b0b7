"""A small arm of equations: pressures follow the valves, and the angle the difference of pressures."""

from collections.abc import Callable

import numpy as np
import pytest

from pneumarm.arm.seam import ArmSpec
from pneumarm.simulation import FitResult, FitSettings, fit
from pneumarm.simulation.history import USUAL
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Transitions, Window, transitions

PERIOD = 1 / 30


def recorded(joints: int = 1, sequences: int = 20, steps: int = 60, seed: int = 0, noise: float = 0.5) -> Rows:
    """Return rows of random valves, each held for some steps."""
    g = np.random.default_rng(seed)
    n = steps + 1
    angle, pressure = np.empty((sequences, n, joints)), np.empty((sequences, n, joints, 2))
    command = np.full((sequences, n, joints, 2), np.nan)
    p = g.uniform(20, 150, (sequences, joints, 2))
    theta = 512 + 2 * (p[..., 0] - p[..., 1])
    valves = np.zeros((sequences, joints, 2))
    for k in range(n):
        angle[:, k], pressure[:, k] = theta, p
        change = g.random((sequences, joints, 2)) < 0.3
        valves = np.where(change, g.integers(-1, 2, (sequences, joints, 2)), valves)
        if k < steps:
            command[:, k] = valves
        p = p + np.where(valves > 0, 0.2 * (166 - p), np.where(valves < 0, -0.15 * p, 0.0))
        theta = theta + 0.3 * (512 + 2 * np.tanh((p[..., 0] - p[..., 1]) / 100) * 100 - theta)
    angle += g.normal(0, noise, angle.shape)
    pressure = np.maximum(pressure + g.normal(0, noise, pressure.shape), 0)
    total = sequences * n
    return Rows(
        sequence=np.repeat(np.arange(sequences), n),
        step=np.tile(np.arange(n), sequences),
        time=np.tile(np.arange(n) * PERIOD, sequences),
        angle=angle.reshape(total, joints),
        pressure=pressure.reshape(total, joints, 2),
        command=command.reshape(total, joints, 2),
        at_rest=np.ones(total, bool),
    )


@pytest.fixture(scope="session")
def make_rows() -> Callable[..., Rows]:
    return recorded


@pytest.fixture(scope="session")
def make_fit() -> Callable[..., tuple[FitResult, Transitions]]:
    """Return a function that fits a simulation to the small arm; gives the result and the held-out transitions."""

    def make(joints: int = 1, **settings: object) -> tuple[FitResult, Transitions]:
        chosen = FitSettings(**{"epochs": 15, "hidden": 6, "spread": False, **settings})  # type: ignore[arg-type]
        window = Window(joints, chosen.history or USUAL)
        training = transitions(recorded(joints, seed=1), window)
        held_out = transitions(recorded(joints, sequences=6, seed=2), window)
        spec = ArmSpec(joints=joints, period=PERIOD)
        goals = np.tile([200.0, 800.0], (joints, 1))
        return fit(training, held_out, spec=spec, goal_range=goals, settings=chosen), held_out

    return make


@pytest.fixture(scope="session")
def fitted(make_fit: Callable[..., tuple[FitResult, Transitions]]) -> tuple[FitResult, Transitions]:
    return make_fit()
