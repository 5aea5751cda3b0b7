"""The fit: what it predicts, and what it says of its own errors."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.errors import UnusableInput
from pneumarm.simulation import (
    SINGLE_STEPS,
    FitResult,
    FitSettings,
    Simulation,
    by_quantity,
    fit,
    fit_store,
    refiltered,
)
from pneumarm.simulation.fit import _rows_to_fit
from pneumarm.transitions import CollectSettings, GridSettings, Store, collect, filter_transitions, held_out
from pneumarm.transitions.rows import Recorded, Rows
from pneumarm.transitions.window import QUANTITIES, Transitions, Window, transitions

Fitted = tuple[FitResult, Transitions]
NOISE = 0.5
"""Sensor noise of the small arm [counts]."""


def test_the_small_arm_is_learned(fitted: Fitted) -> None:
    """An error near the noise of two readings, and far below the change."""
    result, _ = fitted
    assert set(result.std) == set(result.relative_error) == set(QUANTITIES)
    assert result.std["angle"] < 4 * NOISE
    assert result.std["pressure_1"] < 3 * NOISE
    assert result.relative_error["angle"] < 0.15
    assert (result.training.relative < 0.3).all()


def test_errors_are_those_of_the_simulation(fitted: Fitted) -> None:
    result, others = fitted
    residue = result.simulation.predict(others.inputs) - others.target
    np.testing.assert_allclose(list(result.std.values()), residue.std(axis=0), rtol=1e-6)
    np.testing.assert_allclose(result.simulation.error_std[0], residue.std(axis=0), rtol=1e-6)
    change = (others.target - others.observation).std(axis=0)
    np.testing.assert_allclose(list(result.relative_error.values()), residue.std(axis=0) / change, rtol=1e-4)


def test_a_curve_ends_at_the_training_error(fitted: Fitted) -> None:
    """Curves are in units of the change's variance, for each network."""
    result, _ = fitted
    assert result.outputs == ["angle", "pressure_1", "pressure_2"]
    relative = result.training.relative[[0, 2, 3]] ** 2
    np.testing.assert_allclose([curve[-1] for curve in result.curves], relative, rtol=0.02)


def test_a_network_does_better_than_a_line(make_fit: Callable[..., Fitted], fitted: Fitted) -> None:
    linear, _ = make_fit(approximator="least-squares")
    assert linear.curves == []
    assert linear.simulation.networks[0].direct is not None
    assert fitted[0].std["pressure_1"] < 0.8 * linear.std["pressure_1"]


def test_a_linear_arm_is_predicted_by_a_line(make_rows: Callable[..., Rows]) -> None:
    rows = make_rows(noise=0.0)
    window = Window(1, 1)
    known = transitions(rows, window)
    linear = known._replace(target=(known.inputs[:, :4] + 3 * known.inputs[:, 4:5]).astype(np.float32))
    options = FitSettings(history=1, approximator="least-squares", velocity="network")
    spec = ArmSpec(angle_range=(-1e4, 1e4))
    result = fit(linear, linear, spec=spec, goal_range=np.array([[0.0, 1.0]]), settings=options)
    assert result.std["angle"] < 1e-3
    assert result.importance.ranking(0)[0][0] == "command_1[k]"


def test_two_layers_are_one_network_of_all_outputs(make_fit: Callable[..., Fitted]) -> None:
    result, _ = make_fit(joints=2, ahead=0.0, layers=2, hidden=None)
    (network,) = result.simulation.networks
    assert network.second_bias is not None
    assert network.second_bias.size == network.hidden_bias.size == 64
    (curve,) = result.curves
    relative = result.training.relative[[0, 2, 3, 4, 6, 7]]
    assert curve[-1] == pytest.approx((relative**2).sum(), rel=0.05)
    assert (relative < 0.15).all()


@pytest.mark.parametrize(("ahead", "passes"), [(0.0, 120), (0.1, 60)])
def test_an_epoch_of_two_layers_is_forty_passes(make_fit: Callable[..., Fitted], ahead: float, passes: int) -> None:
    result, _ = make_fit(joints=2, ahead=ahead, layers=2, hidden=None, epochs=3)
    assert [len(curve) - 1 for curve in result.curves] == [passes]


@pytest.mark.parametrize(
    ("joints", "rows", "options", "layers"),
    [
        (2, 20_000, {}, 2),
        (2, 2_000, {}, 1),
        (1, 20_000, {}, 1),
        (2, 20_000, {"layers": 1}, 1),
        (1, 2_000, {"layers": 2}, 2),
        (2, 20_000, {"approximator": "least-squares"}, 1),
    ],
)
def test_several_joints_get_two_layers_where_there_is_enough_to_learn_from(
    joints: int, rows: int, options: dict[str, Any], layers: int
) -> None:
    for usual in (SINGLE_STEPS, FitSettings()):
        assert replace(usual, **options).with_layers(joints, rows).layers == layers


@pytest.mark.parametrize(
    "options",
    [
        {"one_network": True, "hidden": 12},
        {"velocity": "network"},
        {"joints": 2},
        {"one_network": True, "layers": 2, "ahead": 0.0, "hidden": None},
    ],
)
def test_alternatives_learn_too(options: dict[str, Any], make_fit: Callable[..., Fitted]) -> None:
    result, _ = make_fit(**options)
    relative = np.ravel(result.relative_error["angle"])
    assert (relative < 0.25).all()
    assert len(relative) == options.get("joints", 1)
    outputs = len(result.outputs)
    assert len(result.simulation.networks) == (1 if options.get("one_network") else outputs)


def test_the_same_seed_gives_the_same_fit(make_fit: Callable[..., Fitted], fitted: Fitted) -> None:
    again, _ = make_fit()
    np.testing.assert_array_equal(again.simulation.error_std, fitted[0].simulation.error_std)
    other, _ = make_fit(seed=1)
    assert not np.array_equal(other.simulation.error_std, fitted[0].simulation.error_std)


def test_blocks_of_held_out_transitions_are_as_good_as_one(fitted: Fitted, make_rows: Callable[..., Rows]) -> None:
    result, others = fitted
    halves = [Transitions(*(a[part] for a in others)) for part in (slice(0, 100), slice(100, None))]
    training = transitions(make_rows(seed=1), Window(1, 3))
    again = fit(
        training,
        iter(halves),
        spec=result.simulation.spec,
        goal_range=result.simulation.goal_range,
        settings=FitSettings(epochs=15, hidden=6, spread=False),
    )
    np.testing.assert_allclose(again.held_out.std, result.held_out.std, rtol=1e-9)


def test_angles_beyond_the_nominal_range_widen_it(make_rows: Callable[..., Rows]) -> None:
    """Else every prediction would be clipped; the middle, which is 0 degrees, stays."""
    known = transitions(make_rows(seed=3), Window(1, 3))
    spec = ArmSpec(angle_range=(500.0, 524.0))
    options = FitSettings(epochs=5, hidden=4)
    result = fit(known, known, spec=spec, goal_range=np.array([[0.0, 1.0]]), settings=options)
    low, high = result.simulation.spec.angle_range
    assert low <= known.target[:, 0].min()
    assert high >= known.target[:, 0].max()
    assert (low + high) / 2 == 512


def test_quantities_by_name() -> None:
    assert by_quantity(np.arange(4.0)) == {"angle": 0.0, "velocity": 1.0, "pressure_1": 2.0, "pressure_2": 3.0}
    assert by_quantity(np.arange(8.0))["velocity"] == [1.0, 5.0]


def test_progress_reaches_the_end_without_going_back(make_rows: Callable[..., Rows]) -> None:
    rows = make_rows()
    known = transitions(rows, Window(1, 3))
    told: list[tuple[int, int]] = []
    fit(
        known,
        known,
        spec=ArmSpec(),
        goal_range=np.array([[0.0, 1.0]]),
        recorded=[rows],
        settings=FitSettings(epochs=4, hidden=3, tolerance=0),
        progress=lambda done, total: told.append((done, total)),
    )
    done, total = zip(*told, strict=True)
    assert len(set(total)) == 1
    assert done[-1] == total[0]
    assert (np.diff(done[12:]) >= 0).all()  # before, networks are fitted side by side
    assert max(done[:12]) == 12


@pytest.mark.parametrize(
    "wrong",
    [
        {"history": 0},
        {"hidden": 0},
        {"epochs": 0},
        {"approximator": "magic"},
        {"velocity": "guess"},
        {"held_out": 0.0},
        {"held_out": 1.0},
        {"seed": -1},
        {"decay": -1.0},
        {"tolerance": 1.0},
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(UnusableInput, match=f"FitSettings: {next(iter(wrong))} cannot be"):
        FitSettings(**wrong)


def test_transitions_of_another_window_are_refused(fitted: Fitted) -> None:
    _, others = fitted
    with pytest.raises(UnusableInput, match=r"history of 5.*got 18"):
        fit(others, others, spec=ArmSpec(), goal_range=np.zeros((1, 2)), settings=FitSettings(history=5))
    few = Transitions(*(a[:10] for a in others))
    with pytest.raises(UnusableInput, match="10 transitions are too few"):
        fit(few, few, spec=ArmSpec(), goal_range=np.zeros((1, 2)))


def stored(path: Path, rows: Rows) -> None:
    with Store.create(path, ArmSpec(joints=rows.joints)) as store:
        store.begin_run("collect", {})
        for number in np.unique(rows.sequence):
            of = rows.sequence == number
            store.append(
                Recorded(
                    rows.time[of], rows.angle[of], rows.pressure[of], rows.command[of], rows.step[of], at_rest=True
                )
            )


def test_a_store_is_filtered_fitted_and_judged(make_rows: Callable[..., Rows], tmp_path: Path) -> None:
    stored(tmp_path / "store.db", make_rows(sequences=60, steps=50))
    options = FitSettings(epochs=5, hidden=4, held_out=0.2, seed=3)
    with Store.open(tmp_path / "store.db") as store:
        result, filtered = fit_store(store, options)
        assert result.rows == len(filtered.transitions.sequence)
        assert not held_out(filtered.transitions.sequence, 0.2, 3).any()
        assert result.generalisation is not None
        parts = result.rows + result.held_out.rows + result.generalisation.rows
        assert parts == store.transitions
        np.testing.assert_allclose(result.simulation.goal_range, store.percentiles())
        again = refiltered(store, result.simulation)
        np.testing.assert_array_equal(again.transitions.inputs, filtered.transitions.inputs)
        other = replace(result.simulation, window=Window(2, 3))
        with pytest.raises(UnusableInput, match="belong together"):
            refiltered(store, other)


def test_the_grid_of_the_filter_can_be_chosen_and_is_kept(make_rows: Callable[..., Rows], tmp_path: Path) -> None:
    stored(tmp_path / "store.db", make_rows(sequences=60, steps=50))
    options = FitSettings(epochs=2, hidden=4, grid=GridSettings(angle_bins=4, velocity_bins=4, per_cell=1))
    with Store.open(tmp_path / "store.db") as store:
        result, filtered = fit_store(store, options)
        usual = fit_store(store, replace(options, grid=GridSettings())).result
        assert filtered.filter.settings == options.grid
        assert result.rows < usual.rows
        for simulation in (result.simulation, usual.simulation):
            simulation.save(tmp_path / "arm.sim")
            loaded = Simulation.load(tmp_path / "arm.sim")
            assert loaded.grid == simulation.grid
            again = refiltered(store, loaded)
            assert len(again.transitions.sequence) == (result if simulation.grid == options.grid else usual).rows


def test_the_fewest_transitions_allowed_can_be_fitted_with_any_seed(
    make_rows: Callable[..., Rows], tmp_path: Path
) -> None:
    stored(tmp_path / "store.db", make_rows(sequences=10, steps=200))
    everything = GridSettings(per_cell=1_000_000)
    with Store.open(tmp_path / "store.db") as store:
        numbers = [entry.number for entry in store.catalogue()]
        unlucky = [seed for seed in range(100) if not held_out(numbers, 0.1, seed).any()]
        for seed in unlucky[:3]:
            result, filtered = fit_store(store, FitSettings(epochs=3, hidden=3, seed=seed, grid=everything))
            assert result.held_out.rows == 200
            assert result.rows == 1800
            assert result.generalisation is None  # the filter left nothing out
            again = refiltered(store, result.simulation)
            np.testing.assert_array_equal(again.transitions.inputs, filtered.transitions.inputs)


def test_a_small_store_is_refused(make_rows: Callable[..., Rows], tmp_path: Path) -> None:
    stored(tmp_path / "store.db", make_rows(sequences=2))
    with (
        Store.open(tmp_path / "store.db") as store,
        pytest.raises(UnusableInput, match=r"120 transitions are too few to fit; collect at least 1,000"),
    ):
        fit_store(store)


def test_the_length_of_pulses_is_learned(tmp_path: Path) -> None:
    """From a record of whole periods and pulses: what they do grows with their length.

    Air begins to flow 19 ms after a reading, so of a long pulse the end works in the period after its own.
    """
    arm = VirtualArm(draw_parameters(3), seed=1)
    with Store.create(tmp_path / "store.db", arm.spec) as store:
        collect(arm, store, 4000, settings=CollectSettings(pulses=0.5))
        simulation = fit_store(store, FitSettings(epochs=30, hidden=6))[0].simulation
        states = filter_transitions(store, simulation.window).transitions.inputs[::20].copy()
    assert simulation.commands == "pulses"
    assert simulation.valves
    names = simulation.window.input_names()
    for name, shares in (("command_1[k]", (0.0, 0.2, 0.4)), ("command_1[k-1]", (0.4, 0.7, 1.0))):
        pressures = []
        for share in shares:
            states[:, names.index(name)] = share
            pressures.append(simulation.predict(states)[:, QUANTITIES.index("pressure_1")].mean())
        assert (np.diff(pressures) > 0.5).all()


def test_what_commands_were_fitted_is_known_and_kept(fitted: Fitted, tmp_path: Path) -> None:
    simulation = fitted[0].simulation
    assert simulation.commands == "valves"
    replace(simulation, commands="pulses").save(tmp_path / "sim")
    assert Simulation.load(tmp_path / "sim").commands == "pulses"


def test_two_coupled_joints_are_fitted_with_goals_that_they_were_seen_to_hold(tmp_path: Path) -> None:
    arm = VirtualArm(draw_parameters(1, 2))
    with Store.for_arm(tmp_path / "two.db", arm.spec) as store:
        collect(arm, store, 2_000)
        simulation = fit_store(store, FitSettings(epochs=2, hidden=2))[0].simulation
    assert [network.hidden_bias.size for network in simulation.networks] == [4] * 6
    assert simulation.goals.ways.shape == (6, 2)
    drawn = simulation.goals.draw(np.random.default_rng(0), 500)
    assert simulation.goals.contain(drawn).all()
    assert np.ptp(drawn, axis=0).min() > 0.5 * np.ptp(simulation.goal_range, axis=1).min()
    simulation.save(tmp_path / "two.sim")
    np.testing.assert_array_equal(Simulation.load(tmp_path / "two.sim").goal_limits, simulation.goal_limits)


def test_a_part_of_the_rows_is_enough_for_large_networks() -> None:
    assert _rows_to_fit(500_000, 200, 0) == slice(None)  # a single joint has all that the filter keeps
    chosen = _rows_to_fit(500_000, 760, 0)
    assert isinstance(chosen, np.ndarray)
    assert 40_000 < len(chosen) < 60_000
    assert len(np.unique(chosen)) == len(chosen)


def test_agents_that_reach_are_fitted_to_single_steps_unless_something_else_is_asked_for() -> None:
    assert FitSettings(epochs=7).of_single_steps() == FitSettings(epochs=7, ahead=0.0, spread=False)
    for asked in (FitSettings(ahead=0.2), FitSettings(spread=False)):
        assert asked.of_single_steps() == asked
    with pytest.raises(UnusableInput, match="ahead"):
        FitSettings(ahead=-0.1)
