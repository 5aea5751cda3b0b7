"""What errors are measured on: sequences in which the arm moves, or stretches of them; and what is said of it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneumarm.analysis import analyse
from pneumarm.arm import ArmSpec
from pneumarm.cli import main
from pneumarm.simulation import FitSettings, Simulation, StoreFit, fit_store, refiltered
from pneumarm.simulation.enough import enough_data
from pneumarm.simulation.fit import fitted_on
from pneumarm.transitions import Recorded, Store, Window, new_cells
from pneumarm.transitions.choice import (
    HeldOut,
    Stretched,
    choose_held_out,
    held_out,
    join_transitions,
    share_held_out,
)
from pneumarm.transitions.grid import GridSettings
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.rows import join_rows as joined_rows

Make = Callable[..., Rows]
EVERYTHING = GridSettings(per_cell=1_000_000)
SETTINGS = FitSettings(epochs=15, hidden=6, ahead=0.0, spread=False, history=3, grid=EVERYTHING)


def at_rest(rows: Rows, which: np.ndarray, noise: float = 0.0) -> Rows:
    """Return ``rows`` in which the arm stands still in those (n,), but for noise."""
    draws = np.random.default_rng(5).normal(0, 1, (len(rows), 1, 3)) * noise * which[:, None, None]
    still = which[:, None]
    return replace(
        rows,
        angle=np.where(still, 500.0, rows.angle) + draws[..., 0],
        pressure=np.where(still[..., None], 60.0, rows.pressure) + draws[..., 1:],
        command=np.where(still[..., None], 0.0 * rows.command, rows.command),
    )


def stored(path: Path, rows: Rows) -> Path:
    with Store.create(path, ArmSpec(joints=rows.joints)) as store:
        for number in np.unique(rows.sequence):
            of = rows.where(rows.sequence == number)
            store.append(Recorded(of.time, of.angle, of.pressure, of.command, of.step, at_rest=True))
    return path


def fitted(path: Path, settings: FitSettings = SETTINGS) -> StoreFit:
    with Store.open(path) as store:
        return fit_store(store, replace(settings, grid=EVERYTHING))


def test_what_moves_is_held_out_where_the_usual_sequences_stand_still(make_rows: Make, tmp_path: Path) -> None:
    rows = make_rows(sequences=25, steps=60)
    number = rows.sequence + 1  # in the store
    rows = at_rest(rows, held_out(number, share_held_out(np.unique(number), 0.1)))
    result = fitted(stored(tmp_path / "store.db", rows)).result
    assert result.simulation.stretch == 0
    assert all(0 < error < 1 for error in result.relative_error.values())
    assert (result.held_out.change_std > 0.1).all()
    assert result.remarks == []


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_noise_of_a_resting_arm_is_no_movement(make_rows: Make, noise: float) -> None:
    rows = make_rows(sequences=25, steps=60)
    share = share_held_out(np.unique(rows.sequence), 0.1)
    chosen = choose_held_out([at_rest(rows, held_out(rows.sequence, share), noise)], 0.1, 0, 3)
    assert chosen.share > share
    assert choose_held_out([rows], 0.1, 0, 3) == HeldOut(share, 0)


def test_each_joint_moves_in_what_is_held_out(make_rows: Make) -> None:
    rows = make_rows(joints=2, sequences=25, steps=60)
    share = share_held_out(np.unique(rows.sequence), 0.1)
    angle = rows.angle.copy()
    angle[held_out(rows.sequence, share), 1] = 500.0
    chosen = choose_held_out([replace(rows, angle=angle)], 0.1, 0, 3)
    assert angle[held_out(rows.sequence, chosen.share), 1].std() > 1
    assert chosen.stretch == 0


@pytest.mark.parametrize("resting", [False, True])
def test_of_a_single_sequence_stretches_are_held_out_that_no_fitted_window_reaches(
    make_rows: Make, tmp_path: Path, resting: bool
) -> None:
    rows = make_rows(sequences=1, steps=2400)
    if resting:  # and of one beside which another stands still
        still = make_rows(sequences=1, steps=600)
        still = at_rest(replace(still, sequence=still.sequence + 1), still.step >= 0)
        rows = joined_rows([rows, still])
    with Store.open(stored(tmp_path / "store.db", rows)) as store:
        made = fit_store(store, SETTINGS)
        simulation = made.simulation
        assert simulation.stretch > 0
        assert all(0 < error < 1 for error in made.result.relative_error.values())
        history = simulation.window.history
        read = [
            {
                (s >> 32, k)
                for s, last in zip(t.sequence, t.step, strict=True)
                for k in range(last - history + 1, last + 2)
            }
            for t in (made.filtered.transitions, join_transitions(list(made.filtered.stream("held-out"))))
        ]
        assert len(read[1]) > 100
        assert not read[0] & read[1]
        simulation.save(tmp_path / "sim")
        loaded = Simulation.load(tmp_path / "sim")
        again = refiltered(store, loaded)
        np.testing.assert_array_equal(again.transitions.inputs, made.filtered.transitions.inputs)
        found = analyse(store, loaded, again).figures
        assert found["held_out"]["relative_error"] == pytest.approx(made.result.relative_error)
        assert fitted_on(loaded, store, ahead=0.0).stretch == simulation.stretch


def test_files_of_whole_sequences_are_as_they_were(make_rows: Make, tmp_path: Path) -> None:
    simulation = fitted(stored(tmp_path / "store.db", make_rows(sequences=25))).simulation
    assert "stretch" not in simulation.parts()[0]


def test_what_never_changes_is_null_and_named(
    make_rows: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = make_rows(sequences=25)
    pressure = rows.pressure.copy()
    pressure[..., 0] = 60.0
    rows = replace(rows, pressure=pressure, command=rows.command * [0, 1])  # its valve never acts
    path = stored(tmp_path / "store.db", rows)
    made = fitted(path)
    assert made.result.relative_error["pressure_1"] is None
    assert made.result.std["pressure_1"] == pytest.approx(0, abs=1e-6)
    remark = made.results()["remarks"][0]
    assert remark.startswith("nothing can be said of the error of pressure 1: ")
    assert "pressure_1 nan" in repr(made)
    out = tmp_path / "arm.sim"
    with pytest.raises(SystemExit, match="0"):
        main(["fit", str(path), "--out", str(out), "--epochs", "3", "--ahead", "0", "--json"])
    said = capsys.readouterr()
    assert json.loads(said.out)["relative_error"]["pressure_1"] is None
    assert remark in said.err
    with pytest.raises(SystemExit, match="0"):
        main(["analyse", str(path), str(out), "--out", str(tmp_path / "page"), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["held_out"]["relative_error"]["pressure_1"] is None
    assert found["held_out"]["slope"]["pressure_1"] is None
    assert remark in found["remarks"]


def test_an_error_larger_than_the_change_is_warned_of(make_rows: Make, tmp_path: Path) -> None:
    rows = make_rows(sequences=25)
    number = rows.sequence + 1
    apart = held_out(number, share_held_out(np.unique(number), 0.1))
    backwards = np.where(apart[:, None], 2 * 512 - rows.angle, rows.angle)
    made = fitted(stored(tmp_path / "store.db", replace(rows, angle=backwards)))
    assert made.result.relative_error["angle"] > 1
    assert any(one.startswith("the one-step error of angle is ") for one in made.result.remarks)
    assert any("worse than saying that nothing changes" in one for one in made.result.remarks)


def test_more_data_is_judged_by_what_moves(make_rows: Make, tmp_path: Path) -> None:
    rows = make_rows(sequences=80, steps=60)
    pressure = rows.pressure.copy()
    pressure[..., 0] = 60.0
    still = replace(rows, pressure=pressure, command=rows.command * [0, 1])
    for number, each in enumerate((rows, still)):
        with Store.open(stored(tmp_path / f"{number}.db", each)) as store:
            judged = enough_data(store)
        assert judged is not None
        assert 0 < judged.error < 1
        assert judged.gain < 0.5


def test_of_a_large_store_a_part_is_used_evenly_drawn(make_rows: Make, tmp_path: Path) -> None:
    with Store.open(stored(tmp_path / "store.db", make_rows(sequences=100))) as store:
        assert store.drawn(6000) is store
        assert store.used == []
        part = store.drawn(2000)
        numbers = [entry.number for entry in part.catalogue()]
        assert part.used == ["used 1,980 of 6,000 transitions, evenly drawn"]
        assert part.transitions == 60 * len(numbers) == 1980
        assert {entry.number for entry in store.drawn(2000).catalogue()} == set(numbers)
        assert np.unique(np.concatenate([rows.sequence for rows in part])).tolist() == numbers
        assert [sum(low < n <= low + 25 for n in numbers) > 3 for low in (0, 25, 50, 75)] == [True] * 4
        few = part.blocks(sequences=lambda sequence: sequence <= 50)
        assert {n for rows in few for n in rows.sequence.tolist()} == {n for n in numbers if n <= 50}
        assert new_cells(part, Window(1)).whole.seen == 1980
        made = fit_store(part, SETTINGS)
        assert made.result.rows + made.result.held_out.rows == 1980
        assert made.results()["remarks"] == part.used
        assert analyse(part, made.simulation).figures["remarks"] == part.used
        assert store.transitions == 6000


def test_stretches_are_sequences_of_their_own(make_rows: Make) -> None:
    rows = make_rows(sequences=2, steps=450)
    (cut,) = Stretched([rows], 200)
    assert np.unique(cut.sequence, return_counts=True)[1].tolist() == [200, 200, 51] * 2
    (whole,) = Stretched([rows], 0)
    assert whole.sequence is rows.sequence
