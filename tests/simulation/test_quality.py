"""The quality of a simulation: every figure against what it should be by hand or by definition."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.networks import Network
from pneumarm.simulation import FitResult, Simulation
from pneumarm.simulation.quality import (
    Resynchronisation,
    advanced,
    classified,
    free_run,
    isoplot_cells,
    propagation,
    residue,
    starts,
    statistics,
    validity,
)
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Transitions, Window, transitions

Fitted = tuple[FitResult, Transitions]


@pytest.fixture(scope="module")
def still(fitted: Fitted) -> Simulation:
    """A simulation in which nothing ever changes."""
    simulation = fitted[0].simulation
    inputs = simulation.window.input_size
    nothing = Network(np.zeros((inputs, 0)), np.zeros(0), np.zeros((0, 3)), np.zeros(3))
    return replace(simulation, networks=(nothing,))


def test_the_residue_is_simulated_minus_observed(fitted: Fitted, still: Simulation) -> None:
    _, others = fitted
    expected = others.observation[:, [0, 2, 3]] - others.target[:, [0, 2, 3]]
    np.testing.assert_allclose(residue(still, others)[:, [0, 2, 3]], expected, rtol=1e-6)


def test_statistics_of_standing_still(fitted: Fitted, still: Simulation) -> None:
    """Its error is the change itself: relative error 1, slope 0."""
    found = statistics(still, fitted[1])
    np.testing.assert_allclose(found.relative[[0, 2, 3]], 1.0)
    np.testing.assert_allclose(found.slope[[0, 2, 3]], 0.0, atol=1e-12)
    assert found.rows == len(fitted[1].target)


def test_statistics_match_numpy_whatever_the_blocks(fitted: Fitted) -> None:
    result, others = fitted
    predicted = result.simulation.predict(others.inputs) - others.observation
    observed = (others.target - others.observation).astype(np.float64)
    cuts = [Transitions(*(a[part] for a in others)) for part in (slice(0, 1), slice(1, 200), slice(200, None))]
    found = statistics(result.simulation, cuts)
    error = predicted - observed
    np.testing.assert_allclose(found.mean, error.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(found.std, error.std(axis=0), rtol=1e-4)
    np.testing.assert_allclose(found.change_std, observed.std(axis=0), rtol=1e-5)
    for column in range(4):
        covariance = np.cov(observed[:, column], predicted[:, column], bias=True)
        assert found.slope[column] == pytest.approx(covariance[0, 1] / covariance[0, 0], rel=1e-4)
        assert found.calibration[column] == pytest.approx(covariance[0, 1] / covariance[1, 1], rel=1e-4)


def test_no_transition_is_no_statistic(fitted: Fitted) -> None:
    with pytest.raises(UnusableInput, match="no transition to judge"):
        statistics(fitted[0].simulation, [])


def test_classes_by_hand() -> None:
    found = classified([1.0, 3.0, 10.0, 7.0, 99.0], by=[0.0, 0.5, 1.0, 3.0, 8.0], classes=[0.0, 1.0, 2.0, 3.0])
    assert found.counts.tolist() == [2, 1, 1]
    np.testing.assert_allclose(found.mean, [2.0, 10.0, 7.0])
    np.testing.assert_allclose(found.std, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(found.quantiles[:, 1], [2.0, 10.0, 7.0])


@given(st.integers(1, 300), st.integers(1, 30))
@settings(max_examples=30, deadline=None)
def test_classes_hold_everything_once(rows: int, classes: int) -> None:
    g = np.random.default_rng(rows)
    values, by = g.normal(size=rows), g.integers(-5, 5, rows)
    found = classified(values, by, classes)
    assert found.counts.sum() == rows
    assert np.nansum(found.mean * found.counts) == pytest.approx(values.sum())
    assert np.isnan(found.mean[found.counts == 0]).all()


def test_an_isoplot_counts_every_transition() -> None:
    g = np.random.default_rng(0)
    observed = g.normal(0, 5, 5000)
    predicted = observed + g.normal(0, 1, 5000)
    found = isoplot_cells(observed, predicted, cells=20, points=300)
    assert found.counts.sum() == 5000
    assert len(found.observed) == len(found.density) == 300
    assert found.density.min() >= 1
    densest = np.argmax(found.density)
    assert np.hypot(found.observed[densest], found.predicted[densest]) < 5
    same = isoplot_cells([2.0, 2.0], [2.0, 2.0], cells=3)
    assert same.counts.sum() == 2


@pytest.mark.parametrize(("joints", "history"), [(1, 1), (1, 2), (1, 3), (2, 3), (1, 5)])
def test_a_perfect_prediction_advances_to_the_recorded_window(
    joints: int, history: int, make_rows: Callable[..., Rows]
) -> None:
    window = Window(joints, history)
    known = transitions(make_rows(joints, sequences=2, steps=20), window)
    k = np.flatnonzero((np.diff(known.step) == 1) & (np.diff(known.sequence) == 0))
    following = advanced(
        known.inputs[k].astype(np.float64), known.target[k], known.inputs[k + 1, window.state_size :], window
    )
    np.testing.assert_array_equal(following, known.inputs[k + 1])


def test_runs_start_only_where_they_can_go_on(make_rows: Callable[..., Rows]) -> None:
    known = transitions(make_rows(sequences=3, steps=20), Window(1, 3))
    gap = np.delete(np.arange(len(known.step)), 5)  # sequence 0 is torn at its step 5
    known = Transitions(*(a[gap] for a in known))
    begin = starts(known, steps=10)
    assert {(int(known.sequence[i]), int(known.step[i])) for i in begin} == {
        *((0, step) for step in range(6, 11)),
        *((sequence, step) for sequence in (1, 2) for step in range(11)),
    }
    assert len(starts(known, steps=10, at_most=7)) == 7
    with pytest.raises(UnusableInput, match="no sequence has 21 transitions"):
        starts(known, steps=21)
    with pytest.raises(UnusableInput, match="no sequence has 1000 transitions"):
        starts(known, steps=1000)


def test_the_first_step_of_a_free_run_is_a_prediction(fitted: Fitted) -> None:
    result, others = fitted
    begin = starts(others, 3)
    runs = list(free_run(result.simulation, others, begin, 3))
    assert len(runs) == 3
    np.testing.assert_array_equal(runs[0][1], result.simulation.predict(others.inputs[begin]))
    np.testing.assert_array_equal(runs[1][0][:, :4], runs[0][1])
    np.testing.assert_array_equal(runs[2][2], others.target[begin + 2])


def test_propagation_of_standing_still_is_the_change(fitted: Fitted, still: Simulation) -> None:
    found = propagation(still, fitted[1], steps=8)
    np.testing.assert_allclose(found.measured[:, [0, 2, 3]], found.change_std[:, [0, 2, 3]], rtol=1e-5)
    np.testing.assert_allclose(found.expected[:, 0], np.sqrt(np.arange(1, 9)) * found.measured[0, 0])


def test_propagation_of_a_good_fit_stays_far_below_the_change(fitted: Fitted) -> None:
    result, others = fitted
    found = propagation(result.simulation, others, steps=30)
    assert found.measured.shape == (30, 4)
    assert (found.measured[29] < 0.35 * found.change_std[29])[[0, 2, 3]].all()
    error = residue(result.simulation, others)[starts(others, 30)]
    np.testing.assert_allclose(found.measured[0], error.std(axis=0), rtol=1e-6)
    np.testing.assert_allclose(found.mean[0], error.mean(axis=0), rtol=1e-6, atol=1e-9)


def test_resynchronisation_takes_the_nearest_state(fitted: Fitted) -> None:
    result, others = fitted
    window = result.simulation.window
    states = others.inputs[:, : window.state_size]
    of = Resynchronisation(states)
    np.testing.assert_array_equal(of.nearest(states[5:300].astype(np.float64), result.simulation), states[5:300])
    wanted = states[:40] + np.float32(0.3)
    scaled = [result.simulation.scaling.inputs(s, window) for s in (wanted, states)]
    brute = ((scaled[0][:, None] - scaled[1][None]) ** 2).sum(axis=2).argmin(axis=1)
    np.testing.assert_array_equal(of.nearest(wanted.astype(np.float64), result.simulation), states[brute])


def test_resynchronised_runs_are_at_known_states_every_so_many_steps(fitted: Fitted) -> None:
    result, others = fitted
    window = result.simulation.window
    known = others.inputs[::7, : window.state_size]
    of = Resynchronisation(known, every=3)
    begin = starts(others, 8, at_most=20)
    rows = {row.tobytes() for row in known.astype(np.float64)}
    for step, (inputs, _, _) in enumerate(free_run(result.simulation, others, begin, 8, of)):
        among = [row.tobytes() in rows for row in np.ascontiguousarray(inputs[:, : window.state_size])]
        if step in (3, 6):
            assert all(among)
            np.testing.assert_array_equal(inputs[:, window.state_size :], others.inputs[begin + step, -2:])
        elif step:
            assert not any(among)


def test_validity_tells_simulated_from_recorded(fitted: Fitted, still: Simulation) -> None:
    """Known is only what was recorded: a simulation that stands still soon has its angles elsewhere."""
    _, others = fitted
    recorded = others.inputs[:, 0]

    def known(inputs: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.isin(inputs[:, 0].astype(np.float32), recorded)

    moved = replace(still, networks=(replace(still.networks[0], output_bias=np.array([0.01, 0.0, 0.0])),))
    found = validity(moved, others, known, steps=10)
    assert (found.recorded == 0).all()
    assert found.simulated[0] == 0
    assert found.simulated[1:].min() > 0.5
    assert found.runs == len(starts(others, 10))


def test_a_window_of_one_observation_runs_freely(make_fit: Callable[..., Fitted]) -> None:
    result, others = make_fit(history=1, epochs=5)
    assert np.isfinite(propagation(result.simulation, others, steps=5).measured).all()
