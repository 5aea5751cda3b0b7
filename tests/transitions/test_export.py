"""A store is exported, and what was exported is imported again."""

import csv
from pathlib import Path

import numpy as np
import pytest

from pneumarm.errors import UnusableInput
from pneumarm.transitions import Store, import_recording
from pneumarm.transitions.export import export_recording
from pneumarm.transitions.rows import join_rows


def test_csv_comes_back_as_it_was(exportable: Path, tmp_path: Path) -> None:
    with Store.open(exportable) as store:
        exported = export_recording(store, tmp_path / "arm.csv")
        before = join_rows(store.blocks())
        spec, sequences = store.spec, store.sequences
    assert exported.rows == len(before)
    assert exported.sequences == sequences
    imported = import_recording(tmp_path / "arm.csv", None, tmp_path / "again.db")
    assert imported.rows == exported.rows
    with Store.open(tmp_path / "again.db") as store:
        after = join_rows(store.blocks())
        assert store.spec == spec
    for name in ("time", "angle", "pressure", "command"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    for name, values in before.measured.items():
        np.testing.assert_allclose(after.measured[name], values)
    gaps = np.diff(before.step)[np.diff(before.sequence) == 0]
    assert gaps.max() == 12
    np.testing.assert_array_equal(np.diff(after.step)[np.diff(after.sequence) == 0], gaps)


def test_parquet_holds_the_same_rows_as_csv(exportable: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    with Store.open(exportable) as store:
        export_recording(store, tmp_path / "arm.csv")
        export_recording(store, tmp_path / "arm.parquet")
    table = parquet.read_table(tmp_path / "arm.parquet")
    with open(tmp_path / "arm.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert table.column_names == header
    found = np.column_stack([table[name].to_numpy() for name in header])
    np.testing.assert_array_equal(found, np.array(rows, float))


def test_files_of_others_are_left_alone(exportable: Path, tmp_path: Path) -> None:
    """Beside a recording often lies the calibration of its arm."""
    theirs = tmp_path / "arm.toml", tmp_path / "arm.parquet.toml"
    for file in theirs:
        file.write_text("[spec]\n")
    with Store.open(exportable) as store:
        for _ in range(2):  # its own mapping is replaced
            assert export_recording(store, tmp_path / "arm.csv").mapping == str(tmp_path / "arm.csv.toml")
        with pytest.raises(UnusableInput, match=r"arm\.parquet\.toml: .* left alone; export under another name"):
            export_recording(store, tmp_path / "arm.parquet")
    assert [file.read_text() for file in theirs] == ["[spec]\n"] * 2
    assert not (tmp_path / "arm.parquet").exists()
    (tmp_path / "arm.csv.toml").unlink()
    with pytest.raises(UnusableInput, match=r"no mapping .*arm\.csv\.toml.* by --mapping"):
        import_recording(tmp_path / "arm.csv", None, tmp_path / "again.db")


def test_what_cannot_be_written_is_refused(exportable: Path, tmp_path: Path) -> None:
    with Store.open(exportable) as store:
        with pytest.raises(UnusableInput, match=r"\.csv or \.parquet"):
            export_recording(store, tmp_path / "arm.xlsx")
        with pytest.raises(UnusableInput, match="does not exist"):
            export_recording(store, tmp_path / "none" / "arm.csv")
