"""The state window built from readings is the one that the simulation was fitted to."""

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.arm.seam import Reading
from pneumarm.simulation.kernel import scaled_state
from pneumarm.task import StateTracker
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import transitions


@pytest.mark.parametrize("hysteresis", [(), (30.0, 150.0)])
@pytest.mark.parametrize(("joints", "history"), [(1, 3), (1, 1), (2, 4), (3, 2)])
def test_windows_are_those_of_the_transitions(joints: int, history: int, hysteresis: tuple[float, ...]) -> None:
    """Uneven time stamps, random readings and valves; the same windows as a fit sees in the store."""
    random, n = np.random.default_rng(0), 30
    simulation = synthetic_simulation(joints, history, hysteresis=hysteresis)
    rows = Rows(
        np.zeros(n, np.int64), np.arange(n), np.cumsum(random.uniform(0.03, 0.037, n)),
        random.uniform(300, 700, (n, joints)), random.uniform(0, 180, (n, joints, 2)),
        random.integers(-1, 2, (n, joints, 2)).astype(float), np.ones(n, bool),
    )  # fmt: skip
    known = transitions(rows, simulation.window)
    expected = scaled_state(known.inputs[:, : simulation.window.state_size], simulation.window, simulation.scaling)
    tracker = StateTracker(simulation.window, simulation.scaling)
    for _ in range(2):  # a second episode has forgotten the first
        tracker.reset()
        for k in range(n - 1):
            got = tracker.reading(Reading(rows.time[k], rows.angle[k], rows.pressure[k]))
            np.testing.assert_allclose(got, expected[k], rtol=1e-4, atol=1e-5)
            np.testing.assert_allclose(tracker.velocity, known.observation[k, 1::4], rtol=1e-5, atol=1e-6)
            tracker.commanded(rows.command[k])
    before = got.copy()
    tracker.push(rows.time[-1], rows.angle[-1], rows.pressure[-1])
    np.testing.assert_array_equal(got, before)  # what was returned stays
