"""Fitting over several steps: stretches of recorded movement, and what the networks say of their later steps."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from pneumarm.arm import open_arm
from pneumarm.simulation import FitSettings, Simulation, fit_store
from pneumarm.simulation.ahead import (
    Stretches,
    _put,
    _tape,
    _trainable,
    fitted_ahead,
    learn_ahead,
    move_ahead,
    stretches,
)
from pneumarm.simulation.kernel import simulation_parameters
from pneumarm.transitions import CollectSettings, Store, collect, held_out
from pneumarm.transitions.hysteresis import RADII
from pneumarm.transitions.rows import Rows

STEPS = 6


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ahead") / "arm.db"
    with open_arm("virtual:seed=5", 0) as arm, Store.for_arm(path, arm.spec) as opened:
        collect(arm, opened, 3000, settings=CollectSettings(actions=100))
    return path


@pytest.fixture(scope="module")
def single(store: Path) -> Simulation:
    with Store.open(store) as opened:
        return fit_store(opened, FitSettings(epochs=10, ahead=0.0)).simulation


def recorded(store: Path, simulation: Simulation) -> Stretches:
    with Store.open(store) as opened:
        return stretches(opened.blocks(), simulation, STEPS)


def test_stretches_are_what_was_recorded(store: Path, single: Simulation) -> None:
    """Each begins with a whole window, and its steps follow each other in one sequence that is not held out."""
    found = recorded(store, single)
    with Store.open(store) as opened:
        (rows,) = opened.blocks(rows=10**9)
    assert found.state.shape == (len(found.command), single.window.state_size)
    assert found.command.shape[1:] == (STEPS, 2)
    assert found.observed.shape[1:] == (STEPS, 3)
    fitted = [number for number in np.unique(rows.sequence) if not held_out(number, single.held_out, single.seed)[0]]
    longest = sum((rows.sequence == number).sum() - STEPS for number in fitted)
    assert 0.9 * longest < len(found.state) <= longest
    scaling = single.scaling
    angles = found.observed[:, :, 0] * scaling.observation_scale[0] + scaling.observation_offset[0]
    whole = np.concatenate([rows.angle[rows.sequence == number, 0] for number in fitted])
    windows = {tuple(np.round(one, 1)) for one in np.lib.stride_tricks.sliding_window_view(whole, STEPS)}
    assert all(tuple(np.round(one, 1)) in windows for one in angles[::50])


def test_there_is_no_stretch_over_a_gap(single: Simulation, store: Path) -> None:
    with Store.open(store) as opened:
        (rows,) = opened.blocks(rows=10**9)
    sequence = next(n for n in np.unique(rows.sequence) if not held_out(n, single.held_out, single.seed)[0])
    one = rows.where(rows.sequence == sequence)
    broken: Rows = one.where(one.step != 50)
    whole, parted = (len(stretches([source], single, STEPS).state) for source in (one, broken))
    # Lost are those that would hold the missing row, in one of their steps or in the window that they begin with.
    assert whole - parted >= STEPS
    assert parted > whole - 4 * STEPS


@pytest.mark.parametrize("layers", [1, 2])
def test_the_gradient_is_that_of_the_cost(store: Path, single: Simulation, layers: int) -> None:
    """Compared with differences of the cost along random directions."""
    if layers == 2:
        with Store.open(store) as opened:
            single = fit_store(opened, FitSettings(layers=2, hidden=8, ahead=0.0)).simulation
    found = recorded(store, single)
    net, parameters = _trainable(simulation_parameters(single))
    tape = _tape(single, parameters, found)
    _put(tape, found, np.random.default_rng(0))
    tape.weight[...] = 5.0

    def cost(step: np.ndarray[Any, np.dtype[np.float32]]) -> float:
        net.flat[:] += step
        parameters.output[:] = net.layers[-1][:-1].T
        move_ahead(parameters, tape)
        net.flat[:] -= step
        error = (tape.x[1:, parameters.place] - tape.observed) * tape.weight[:, :, None]
        clipped = np.minimum(np.abs(error), 4.0)
        return float((clipped * np.abs(error) - 0.5 * clipped**2).sum(axis=1).mean(dtype=np.float64))

    learn_ahead(net, parameters, tape)
    gradient = net.gradient * net.mask
    random = np.random.default_rng(1)
    for _ in range(5):
        way = (random.standard_normal(net.flat.shape) * net.mask).astype(np.float32)
        slope = (cost(1e-3 * way) - cost(-1e-3 * way)) / 2e-3
        assert slope == pytest.approx(float(gradient @ way), rel=0.05, abs=0.05 * float(np.linalg.norm(gradient)))


@pytest.mark.parametrize("layers", [1, 2])
def test_later_steps_are_predicted_better(store: Path, single: Simulation, layers: Literal[1, 2]) -> None:
    """And single ones about as well, on sequences that were not fitted."""
    with Store.open(store) as opened:
        chosen = FitSettings(epochs=10, memory=1, hysteresis=(), layers=layers)
        single = single if layers == 1 else fit_store(opened, replace(chosen, ahead=0.0, spread=False)).simulation
        fitted = fit_store(opened, chosen).simulation
        blocks = [rows.where(held_out(rows.sequence, single.held_out, single.seed)) for rows in opened.blocks()]
    apart = stretches(blocks, replace(single, held_out=0.0), STEPS)
    later = [_errors(one, apart) for one in (single, fitted)]
    assert (later[1][0] < 1.1 * later[0][0]).all()
    assert later[1][-1, 0] < 0.97 * later[0][-1, 0]


@pytest.mark.thorough
def test_an_arm_that_sticks_is_foreseen_better_by_how_it_came_to_where_it_is(tmp_path: Path) -> None:
    """A fifth of a second ahead; the simulation is stored with its radii."""
    arm = open_arm("virtual:wide,seed=6001")
    with Store.create(tmp_path / "arm.db", arm.spec) as opened:
        collect(arm, opened, 6000)
        forgetful, fitted = (fit_store(opened, FitSettings(hysteresis=radii)).simulation for radii in ((), None))
        blocks = [rows.where(held_out(rows.sequence, fitted.held_out, fitted.seed)) for rows in opened.blocks()]
    assert fitted.window.hysteresis == pytest.approx(np.multiply(RADII, arm.spec.counts_per_degree))
    apart = (stretches(blocks, replace(one, held_out=0.0), STEPS) for one in (forgetful, fitted))
    without, with_ = (_errors(one, found)[-1, 0] for one, found in zip((forgetful, fitted), apart, strict=True))
    assert with_ < 0.8 * without
    fitted.save(tmp_path / "arm.sim")
    assert Simulation.load(tmp_path / "arm.sim").window == fitted.window


def _errors(simulation: Simulation, found: Stretches) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return root mean squares of the errors (steps, outputs)."""
    parameters = simulation_parameters(simulation)
    tape = _tape(simulation, parameters, found)
    squares = []
    for part in range(8):
        _put(tape, found, np.random.default_rng(part))
        move_ahead(parameters, tape)
        squares.append(((tape.x[1:, parameters.place] - tape.observed) ** 2).mean(axis=2))
    return np.asarray(np.sqrt(np.mean(squares, axis=0)), np.float64)


def test_the_same_comes_of_the_same(store: Path, single: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pneumarm.simulation.ahead.UPDATES", 20)
    told: list[float] = []
    one, two = (fitted_ahead(single, recorded(store, single), 3, told.append) for _ in range(2))
    assert told[:1] == [0.0]
    for a, b, before in zip(one.networks, two.networks, single.networks, strict=True):
        np.testing.assert_array_equal(a.hidden_weights, b.hidden_weights)
        assert (a.hidden_weights != before.hidden_weights).any()
        assert a.output_weights.shape == before.output_weights.shape


def test_nothing_long_enough_changes_nothing(single: Simulation, make_rows: Callable[..., Rows]) -> None:
    short = make_rows()
    assert fitted_ahead(single, stretches([short.where(short.step < 3)], single, STEPS), 0) is single


def test_few_of_many_stretches_are_kept(store: Path, single: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the blocks are."""
    monkeypatch.setattr("pneumarm.simulation.ahead._MOST", 500)
    with Store.open(store) as opened:
        one, two = (stretches(opened.blocks(rows), single, STEPS) for rows in (150, 10**9))
    assert len(one.state) == 500
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)
