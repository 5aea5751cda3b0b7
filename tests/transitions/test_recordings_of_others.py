"""Recordings as other programs leave them: dialects, rows that cannot be used, time, names, further files."""

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneumarm.errors import UnusableInput
from pneumarm.transitions import Rows, Store, import_recording
from pneumarm.transitions.recording import ImportResult
from pneumarm.transitions.rows import join_rows

MAPPING = """
time = "t"
commands = "valves"
[arm]
name = "bench"
period = 0.02
counts_per_degree = 10.0
counts_per_bar = 400.0
angle_range = [0, 1000]
[[joint]]
angle = { column = "q", unit = "deg" }
pressure_1 = { column = "p1", unit = "bar" }
pressure_2 = { column = "p2", unit = "bar" }
command_1 = { column = "a1" }
command_2 = { column = "a2" }
"""
NAMES = ["t", "q", "p1", "p2", "a1", "a2"]
ROWS = 60
Cells = list[list[str]]
Imported = Callable[..., tuple[ImportResult, Rows]]


def cells() -> Cells:
    """Return a sound recording as text, row by row; the angle of row k is k / 10 degrees."""
    return [[f"{k * 0.02:.4f}", f"{k / 10:.3f}", f"{k / 100:.3f}", "0.125", f"{k % 3 - 1}", "0"] for k in range(ROWS)]


def written(rows: Sequence[Sequence[str]], separator: str = ",", names: Sequence[str] = NAMES) -> str:
    return "".join(separator.join(row) + "\n" for row in [names, *rows])


@pytest.fixture
def imported(tmp_path: Path) -> Imported:
    """Import a text by a mapping; return the outcome and all rows."""

    def run(text: str | bytes, mapping: str = MAPPING, name: str = "r.csv") -> tuple[ImportResult, Rows]:
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        (tmp_path / "m.toml").write_text(mapping)
        result = import_recording(tmp_path / name, tmp_path / "m.toml", tmp_path / f"{name}.db")
        with Store.open(tmp_path / f"{name}.db") as store:
            store.check()
            return result, join_rows(store)

    return run


def assert_sound(result: ImportResult, rows: Rows) -> None:
    """Check that all of the sound recording was imported."""
    assert (result.transitions, result.rows, result.skipped) == (ROWS - 1, ROWS, {})
    np.testing.assert_allclose(rows.time, 0.02 * np.arange(ROWS))
    np.testing.assert_allclose(rows.angle[:, 0], 500 + np.arange(ROWS))
    np.testing.assert_allclose(rows.pressure[:, 0], np.column_stack([4.0 * np.arange(ROWS), np.full(ROWS, 50.0)]))
    np.testing.assert_array_equal(rows.command[:-1, 0, 0], np.arange(ROWS - 1) % 3 - 1)


# ---- dialects

SOUND, SEMICOLONS = written(cells()), written(cells(), ";")
DIALECTS = {
    "semicolons": written(cells(), ";"),
    "semicolons, decimal commas": written(cells(), ";").replace(".", ","),
    "tabs": written(cells(), "\t"),
    "tabs, decimal commas": written(cells(), "\t").replace(".", ","),
    "bars": written(cells(), "|"),
    "spaces": written(cells(), "  "),
    "columns aligned": written(cells(), " ,\t ".replace("\t", "  ")),
    "spaces after commas": written(cells(), ", "),
    "spaces after semicolons": written(cells(), "; "),
    "quoted fields": written([[f'"{one}"' for one in row] for row in cells()], ", ", [f'"{n}"' for n in NAMES]),
    "a comma after each row": SOUND.replace("\n", ",\n").replace("a2,\n", "a2\n", 1),
    "a comma after each line": SOUND.replace("\n", ",\n"),
    "a comma after the header": SOUND.replace("a2\n", "a2,\n", 1),
    "a mark of UTF-8": b"\xef\xbb\xbf" + SOUND.encode(),
    "lines of Windows": SOUND.replace("\n", "\r\n"),
    "lines of old Macintoshes": SOUND.replace("\n", "\r"),
    "comments": "# bench\n#\n" + SOUND.replace("\n0.2000", "\n# a pause, here\n0.2000"),
    "a header in a comment": "# measured on Monday\n# " + SOUND,
    "a title": "Recorder 3.1\nrate;50 Hz\n\n" + written(cells(), ";"),
    "a remark that is not in UTF-8": b"# at 20 \xb0C\n" + SOUND.encode(),
    "a name that is not in UTF-8": written([[*row, "1"] for row in cells()], names=[*NAMES, "w"]).encode("cp1252")
    .replace(b"w", b"\xb0"),
    "blank lines": "\n" + SOUND.replace("\n", "\n\n") + "\n \n",
    "no end of the last line": SOUND[:-1],
    "a column without a name": "," + SOUND.replace("\n", "\n7,")[:-2],
    "a column of text": written([[*row, '"it says ""stop"",\ntwice"'] for row in cells()], names=[*NAMES, "x"]),
}  # fmt: skip


@pytest.mark.parametrize("name", DIALECTS)
def test_csv_is_read_as_it_is_met_with(imported: Imported, name: str) -> None:
    assert_sound(*imported(DIALECTS[name]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (written(cells(), ";", ["t", "angle", *NAMES[2:]]), r"line 1: .* column\(s\) q once .* has t, angle, p1"),
        ("title\n" + written(cells(), names=["t", "q", *NAMES[1:5]]), "once each; the file has q, q"),
        (written(cells(), ";", NAMES).replace(";", ":"), "the file has t:q:p1:p2:a1:a2"),
        (written([row[:4] for row in cells()]), "line 2: expected 6 fields, got 4 separated by ','"),
        (written([[*row, "1"] for row in cells()]), "line 2: expected 6 fields, got 7"),
        # 1,234 is a thousand where decimals have a point, and 1.234 where they have a comma
        (SEMICOLONS.replace("1.1", "1,234"), "expected a finite number, got '1,23"),
        (SEMICOLONS.replace(".", ",").replace("1,1", "1.234"), r"expected a finite number, got '1\.23"),
        (written([["1,234.5", *row[1:]] for row in cells()], ";"), "expected a finite number, got '1,234.5'"),
    ],
)  # fmt: skip
def test_what_cannot_be_told_is_refused_by_its_place(imported: Imported, text: str, message: str) -> None:
    with pytest.raises(UnusableInput, match=message):
        imported(text)


# ---- rows that cannot be used


def spoilt(row: int, column: str, value: str) -> str:
    rows = cells()
    rows[row][NAMES.index(column)] = value
    return written(rows)


def lost(*rows: int) -> list[int]:
    """Return the transitions, by their rows, that are left where nothing spans ``rows``, which are left out."""
    return [k for k in range(ROWS - 1) if not {k, k + 1} & {*rows}]


@pytest.mark.parametrize(
    ("text", "reason", "kept"),
    [
        *[(spoilt(30, "p1", value), "value missing", lost(30)) for value in ("", " ", "nan", "NaN", "NA", "null")],
        (spoilt(30, "a2", "x"), "not a number", lost(30)),
        (spoilt(30, "q", "inf"), "not a number", lost(30)),
        (spoilt(30, "p1", "77"), "out of range", lost(30)),
        (spoilt(30, "a1", "0.5"), "out of range", lost(30)),
        (spoilt(30, "q", "3").encode().replace(b",3,", b",\xff,"), "not a number", lost(30)),
        (spoilt(30, "t", ""), "value missing", lost(30)),
        (spoilt(30, "t", "0.58"), "time not after that of the row before", lost(30)),
        (spoilt(30, "t", "0.03"), "time not after that of the row before", lost(30)),
        (spoilt(30, "t", "1e300"), "out of range", lost(30)),
        (SOUND.replace("\n0.6000", "\n0.60\n0.6000"), "wrong number of fields", [k for k in lost() if k != 29]),
        (SOUND.replace("\n0.6000", "\n\0\0\0\0\n0.6000"), "wrong number of fields", [k for k in lost() if k != 29]),
        (written([*cells()[:30], NAMES, *cells()[30:]]), "not a number", [k for k in lost() if k != 29]),
        # the same row again is no gap; another at the same time is one, since either may be the wrong one
        (written([*cells()[:31], *cells()[30:]]), "time not after that of the row before", lost()),
        (written([*cells()[:31], ["0.6000", "9", "0", "0", "0", "0"], *cells()[31:]]),
         "time not after that of the row before", [k for k in lost() if k != 30]),
        *[(SOUND[:-cut], "torn last line", lost(ROWS - 1)) for cut in (4, 7, 12, 20)],
    ],
)  # fmt: skip
def test_a_row_that_cannot_be_used_is_left_out_and_nothing_spans_it(
    imported: Imported, text: str | bytes, reason: str, kept: list[int]
) -> None:
    result, rows = imported(text)
    assert result.skipped == {reason: 1}
    assert (result.transitions, result.rows) == (len(kept), len(rows.time) + 1)
    follow = np.flatnonzero((np.diff(rows.step) == 1) & (np.diff(rows.sequence) == 0))
    assert np.rint(rows.angle[follow, 0] - 500).tolist() == kept
    np.testing.assert_allclose(rows.angle[follow + 1, 0] - rows.angle[follow, 0], 1.0)


def test_a_row_left_out_takes_its_time_where_there_is_no_column_of_it(imported: Imported) -> None:
    _, rows = imported(spoilt(30, "p1", ""), MAPPING.replace('time = "t"\n', ""))
    np.testing.assert_allclose(rows.time[28:32], [0.56, 0.58, 0.62, 0.64])
    assert np.diff(rows.step)[28:32].tolist() == [1, 3, 1, 1]


def test_a_torn_last_line_counts_for_nothing_however_short_the_recording(imported: Imported) -> None:
    result, _ = imported(written(cells()[:10])[:-9])
    assert (result.transitions, result.rows, result.skipped) == (8, 10, {"torn last line": 1})


def test_where_the_clock_begins_anew_a_sequence_does(imported: Imported) -> None:
    result, rows = imported(written([*cells(), *cells()[:40]]))
    assert (result.sequences, result.restarts, result.skipped) == (2, 1, {})
    assert (result.transitions, result.rows) == (ROWS - 1 + 39, ROWS + 40)
    assert np.flatnonzero(np.diff(rows.sequence)).tolist() == [ROWS - 1]


def test_a_stamp_that_leaps_ahead_costs_no_more_than_its_row(imported: Imported) -> None:
    result, _ = imported(spoilt(30, "t", "999"))
    assert (result.transitions, result.restarts) == (len(lost(30)), 1)


def test_too_many_rows_that_cannot_be_used_are_refused_with_their_reasons(imported: Imported) -> None:
    rows = cells()
    for k in (10, 20, 30):
        rows[k][1] = ""
    result, _ = imported(written(rows))  # one in twenty
    assert result.skipped == {"value missing": 3}
    rows[40][0] = "noon"
    expected = r"line 12: column 'q': expected a finite number, got ''; 4 of 60 rows .*value missing: 3.*a number: 1"
    with pytest.raises(UnusableInput, match=expected):
        imported(written(rows), name="s.csv")


def test_a_quote_that_is_left_open_counts_every_line_that_it_takes(imported: Imported) -> None:
    result, _ = imported(spoilt(58, "q", '"5.8'))
    assert result.skipped == {"wrong number of fields": 2}
    with pytest.raises(UnusableInput, match=r"line 32: expected 6 fields, got 2.*30 of 60 rows"):
        imported(spoilt(30, "q", '"3.0'), name="s.csv")


def test_what_was_left_out_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from pneumarm.commands.import_ import import_

    (tmp_path / "m.toml").write_text(MAPPING)
    (tmp_path / "r.csv").write_text(spoilt(30, "p1", "")[:-4])
    for json_ in (True, False):
        import_(tmp_path / "r.csv", tmp_path / f"{json_}.db", mapping=tmp_path / "m.toml", json=json_)
    object_, table = capsys.readouterr().out.split("\n", 1)
    assert json.loads(object_)["skipped"] == {"value missing": 1, "torn last line": 1}
    assert "left out, value missing" in table
    assert "left out, torn last line" in table
    assert "time went back" not in table


# ---- time


def timed(unit: float, period: float = 0.02, jitter: float = 0.0) -> str:
    """Return the sound recording with times in a ``unit`` [s]."""
    noise = np.random.default_rng(0).uniform(-jitter, jitter, ROWS)
    return written([[f"{(k * period + noise[k]) / unit:.9g}", *row[1:]] for k, row in enumerate(cells())])


@pytest.mark.parametrize(("unit", "seconds"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("ns", 1e-9)])
def test_time_is_read_in_its_unit(imported: Imported, unit: str, seconds: float) -> None:
    mapping = MAPPING.replace('time = "t"', f'time = {{ column = "t", unit = "{unit}" }}')
    assert_sound(*imported(timed(seconds), mapping))


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        (timed(1e-3), "s", r'median step .* 20 s, .* period says 0\.02 s; .* in ms: set time = .*"t", unit = "ms"'),
        (timed(1e-6), "s", 'seems to be in us: set .*unit = "us"'),
        (timed(1e-9), "s", 'seems to be in ns: set .*unit = "ns"'),
        (timed(1.0), "ms", 'seems to be in s: set .*unit = "s"'),
        (timed(1e-3, 0.026), "s", 'seems to be in ms: set .*unit = "ms"'),
        (timed(1.0, 0.026), "s", r"median step .* is 0\.026 s, .* period says 0\.02 s; set period = 0\.026"),
        (timed(1.0, 0.015), "s", r"is 0\.015 s, .* says 0\.02 s; set period = 0\.015"),
        (timed(1.0, 0.004), "s", r"is 0\.004 s, .* says 0\.02 s; set period = 0\.004"),
        (timed(1.0, 0.1), "s", r"is 0\.1 s, .* says 0\.02 s; set period = 0\.1"),
        (timed(1.0, 0.0), "s", r"is 0 s, .* says 0\.02 s; its stamps are too coarse"),
        (timed(1.0, 1.7e14), "s", "median step of the time is 1.7e.14 s"),
    ],
)
def test_a_wrong_unit_or_period_is_refused_with_what_is_likely(
    imported: Imported, text: str, unit: str, message: str
) -> None:
    with pytest.raises(UnusableInput, match=message):
        imported(text, MAPPING.replace('time = "t"', f'time = {{ column = "t", unit = "{unit}" }}'))


@pytest.mark.parametrize("text", [timed(1.0, 0.02, 0.004), timed(1.0, 0.0204), timed(1.0, 0.0192)])
def test_jitter_and_a_rate_that_is_rounded_are_normal(imported: Imported, text: str) -> None:
    result, _ = imported(text)
    assert result.transitions > 0.9 * ROWS
    assert not result.skipped


def test_a_recording_without_any_transition_is_refused(imported: Imported) -> None:
    mapping = MAPPING.replace('time = "t"\n', 'sequence = "q"\n')
    with pytest.raises(UnusableInput, match="holds no sequence of two rows"):
        imported(SOUND, mapping)
    rows = [[*row[:2], *("" if k % 2 else one for one in row[2:])] for k, row in enumerate(cells())]
    with pytest.raises(UnusableInput, match="30 of 60 rows cannot be used"):
        imported(written(rows))
    few = [["0", *cells()[0][1:]], ["0.04", *cells()[0][1:]]]
    with pytest.raises(UnusableInput, match=r"median step of the time is 0\.04 s"):
        imported(written(few))


# ---- names that repeat, and text, in Parquet


def lerobot(folder: Path, features: dict[str, tuple[list[list[float]], Any]], **columns: list[float]) -> Path:
    """Write a dataset with ``features`` of vectors and the names of their numbers, and further ``columns``."""
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    about = {name: {"dtype": "float32", "names": names} for name, (_, names) in features.items()}
    (folder / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v3.0", "features": about}))
    table = {name: arrow.array(rows, arrow.list_(arrow.float64())) for name, (rows, _) in features.items()}
    parquet.write_table(arrow.table(table | columns), folder / "data" / "chunk-000" / "file-000.parquet")
    return folder


def shared(folder: Path, inner: Any) -> Path:
    """Write the sound recording with the same ``inner`` names of state and action, as LeRobot's recorder does."""
    numbers = np.array(cells(), float)
    state = numbers[:, 1:4].tolist()
    action = np.column_stack([numbers[:, 1] + 1, numbers[:, 4:6]]).tolist()
    return lerobot(
        folder, {"observation.state": (state, inner), "action": (action, inner)}, timestamp=numbers[:, 0].tolist()
    )


def mapping_of(angle: str, pressures: Sequence[str], commands: Sequence[str]) -> str:
    names = {"q": angle, "p1": pressures[0], "p2": pressures[1], "a1": commands[0], "a2": commands[1]}
    text = MAPPING.replace('"t"', '"timestamp"')
    for short, name in names.items():
        text = text.replace(f'column = "{short}"', f'column = "{name}"')
    return text


INNER = ["elbow.pos", "m1", "m2"]
QUALIFIED = mapping_of(
    "observation.state.elbow.pos", ["observation.state.m1", "observation.state.m2"], ["action.m1", "action.m2"]
)
COUNTED = mapping_of("observation.state.0", ["observation.state.1", "observation.state.2"], ["action.1", "action.2"])


@pytest.mark.parametrize(
    ("inner", "mapping"),
    [
        (INNER, QUALIFIED),
        ({"motors": INNER}, QUALIFIED),
        (None, COUNTED),
        (["j", "j", "j"], COUNTED),
        (["too", "few"], COUNTED),
    ],
)
def test_names_that_repeat_are_told_apart_by_their_feature(tmp_path: Path, inner: Any, mapping: str) -> None:
    (tmp_path / "m.toml").write_text(mapping)
    result = import_recording(shared(tmp_path / "d", inner), tmp_path / "m.toml", tmp_path / "s.db")
    with Store.open(tmp_path / "s.db") as store:
        assert_sound(result, join_rows(store))


def test_names_that_are_ambiguous_are_refused_with_those_that_are_not(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(mapping_of("elbow.pos", ["m1", "observation.state.m2"], ["action.m1", "m2"]))
    expected = (
        r"column\(s\) elbow\.pos, m1, m2 once each; the file has observation\.state\.elbow\.pos, action\.elbow\.pos, "
        r"observation\.state\.m1, action\.m1, observation\.state\.m2, action\.m2, timestamp"
    )
    with pytest.raises(UnusableInput, match=expected):
        import_recording(shared(tmp_path / "d", INNER), tmp_path / "m.toml", tmp_path / "s.db")
    assert not (tmp_path / "s.db").exists()


def parquet_of(file: Path, **text: Sequence[str | None]) -> Path:
    arrow, parquet = (pytest.importorskip(name) for name in ("pyarrow", "pyarrow.parquet"))
    columns = {name: [float(row[k]) for row in cells()] for k, name in enumerate(NAMES)}
    parquet.write_table(arrow.table(columns | text), file)
    return file


def test_text_in_parquet_may_hold_any_character(tmp_path: Path) -> None:
    odd = ["\u2028", "\f", "\n", "\r\n", "\x1e", "\x85", "\v", '"', ",", "#", None, ""]
    notes = [None if one is None else f"a{one}b" for one in odd * (ROWS // len(odd))]
    (tmp_path / "m.toml").write_text(MAPPING)
    result = import_recording(parquet_of(tmp_path / "r.parquet", note=notes), tmp_path / "m.toml", tmp_path / "s.db")
    with Store.open(tmp_path / "s.db") as store:
        assert_sound(result, join_rows(store))


def test_a_sequence_of_text_in_parquet_may_hold_any_character(tmp_path: Path) -> None:
    names = ["a\u2028b"] * 30 + ["a\fb"] * 30
    (tmp_path / "m.toml").write_text('sequence = "run"\n' + MAPPING)
    result = import_recording(parquet_of(tmp_path / "r.parquet", run=names), tmp_path / "m.toml", tmp_path / "s.db")
    assert (result.sequences, result.transitions) == (2, 58)


# ---- further files, and what is no file


def test_a_second_file_is_added_to_the_store_of_the_same_arm(tmp_path: Path, address: Path | str) -> None:
    (tmp_path / "m.toml").write_text(MAPPING)
    (tmp_path / "a.csv").write_text(SOUND)
    (tmp_path / "b.csv").write_text(written(cells()[:40]))
    first = import_recording(tmp_path / "a.csv", tmp_path / "m.toml", address)
    second = import_recording(tmp_path / "b.csv", tmp_path / "m.toml", address)
    assert (first.transitions, second.transitions, second.sequences, second.rows) == (ROWS - 1, 39, 1, 40)
    with pytest.raises(UnusableInput, match=r"has been imported into .* already, as its run 2"):
        import_recording(tmp_path / "b.csv", tmp_path / "m.toml", address)
    with Store.open(address) as store:
        store.check()
        assert (store.sequences, store.transitions) == (2, ROWS - 1 + 39)
        assert [run["settings"]["recording"] for run in store.runs().values()] == ["a.csv", "b.csv"]


@pytest.mark.parametrize(
    ("name", "text", "mapping", "message"),
    [
        ("copy.csv", SOUND, MAPPING, "has been imported into .*s.db already, as its run 1"),
        ("b.csv", SOUND, MAPPING.replace("10.0", "11.0"), r"another arm \(counts_per_degree was 10.0, is 11.0\)"),
        ("b.csv", SOUND, MAPPING.replace('"valves"', '"continuous"'), "holds valves or pulses, not continuous"),
        ("b.csv", spoilt(3, "q", "x") * 2, MAPPING.replace('"bench"', '"another"'), "name was 'bench', is 'another'"),
        ("b.csv", written([[row[0], "x", *row[2:]] for row in cells()]), MAPPING, "60 of 60 rows"),
        ("b.csv", written(cells()[:1]), MAPPING, "no sequence of two rows"),
    ],
)
def test_what_does_not_belong_is_refused_and_the_store_stays_as_it_was(
    tmp_path: Path, name: str, text: str, mapping: str, message: str
) -> None:
    (tmp_path / "a.csv").write_text(SOUND)
    (tmp_path / "m.toml").write_text(MAPPING)
    import_recording(tmp_path / "a.csv", tmp_path / "m.toml", tmp_path / "s.db")
    (tmp_path / name).write_text(text)
    (tmp_path / "m.toml").write_text(mapping)
    with pytest.raises(UnusableInput, match=message):
        import_recording(tmp_path / name, tmp_path / "m.toml", tmp_path / "s.db")
    with Store.open(tmp_path / "s.db") as store:
        store.check()
        assert (store.sequences, store.transitions, len(store.runs())) == (1, ROWS - 1, 1)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
@pytest.mark.parametrize("name", ["r.csv", "r.parquet"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    (tmp_path / "m.toml").write_text(MAPPING)
    with pytest.raises(UnusableInput, match="this is not a file"):
        import_recording(tmp_path / name, tmp_path / "m.toml", tmp_path / "s.db")
