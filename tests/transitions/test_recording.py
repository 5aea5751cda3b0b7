"""Recordings made elsewhere: units, sequences, gaps, and mistakes told by file, line and column."""

from pathlib import Path

import numpy as np
import pytest

from pneumarm.errors import UnusableInput
from pneumarm.transitions import Store, import_recording
from pneumarm.transitions.recording import read_mapping
from pneumarm.transitions.rows import join_rows

EXAMPLE = Path(__file__).parents[2] / "examples" / "recordings" / "mpi_pam.toml"

MAPPING = """
sequence = "run"
time = "t"
commands = "valves"
[arm]
name = "elsewhere"
period = 0.1
counts_per_degree = 10.0
counts_per_bar = 100.0
angle_range = [0, 1000]
[[joint]]
angle = {column = "angle", unit = "deg"}
pressure_1 = {column = "p1", unit = "bar"}
pressure_2 = {column = "p2", unit = "normalised", full_scale = 0.5}
command_1 = {column = "v1"}
command_2 = {column = "v2"}
"""
HEADER = "run,t,extra,angle,p1,p2,v1,v2\n"


@pytest.fixture
def imported(tmp_path):
    """Import a CSV text by a mapping text; returns the outcome and all rows."""

    def run(text, mapping=MAPPING, header=HEADER):
        (tmp_path / "r.csv").write_text(header + text, encoding="utf-8")
        (tmp_path / "m.toml").write_text(mapping, encoding="utf-8")
        result = import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "s.db")
        with Store.open(tmp_path / "s.db") as store:
            store.check()
            rows = vars(join_rows(store))
            return result, store.spec, rows | rows.pop("measured")

    return run


def lines(*rows):
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


GOOD = [
    ("a", 0.0, "x", 0.0, 0.5, 1.0, 1, -1),
    ("a", 0.1, "x", 9.0, 0.6, 0.0, 0, 1),
    ("a", 0.2, "x", -50.0, 0.7, 0.0, 0, 1),
    ("b", 7.0, "x", 50.0, 0.0, 0.0, -1, 0),
    ("b", 7.3, "x", 1.0, 0.0, 0.0, -1, 0),
    ("b", 7.4, "x", 1.0, 0.0, 0.0, -1, 0),
    ("c", 0.0, "x", 1.0, 0.0, 0.0, -1, 0),
]


def test_units_sequences_and_gaps_by_hand(imported):
    result, spec, rows = imported(lines(*GOOD))
    assert (result.transitions, result.sequences, result.rows, result.single) == (3, 2, 7, 1)
    assert (spec.name, spec.joints, spec.period) == ("elsewhere", 1, 0.1)
    np.testing.assert_allclose(rows["angle"][:, 0], [500, 590, 0, 1000, 510, 510])
    np.testing.assert_allclose(rows["pressure"][:, 0, 0], [50, 60, 70, 0, 0, 0])
    np.testing.assert_allclose(rows["pressure"][:, 0, 1], [50, 0, 0, 0, 0, 0])
    assert rows["step"].tolist() == [0, 1, 2, 0, 3, 4]
    np.testing.assert_array_equal(rows["command"][:2, 0], [[1, -1], [0, 1]])
    assert np.isnan(rows["command"][[2, 5]]).all()
    assert not rows["at_rest"].any()
    # spec and rows together give the recording back
    np.testing.assert_allclose(spec.degrees(rows["angle"][:, 0])[:4], [0, 9, -50, 50])
    np.testing.assert_allclose(spec.bar(rows["pressure"][:, 0, 0])[:3], [0.5, 0.6, 0.7])


def test_radians_counts_two_joints_without_time_or_sequence(imported):
    joint = """
[[joint]]
angle = {column = "ANGLE", unit = "UNIT"}
pressure_1 = {column = "p1", unit = "counts"}
pressure_2 = {column = "p2", unit = "counts"}
command_1 = {column = "v1"}
command_2 = {column = "v2", range = [-2, 2]}
"""
    mapping = 'commands = "continuous"\n[arm]\nperiod = 0.1\nangle_range = [0, 1000]\n'
    mapping += joint.replace("ANGLE", "angle").replace("UNIT", "rad") + joint.replace("ANGLE", "t").replace(
        "UNIT", "counts"
    )
    result, spec, rows = imported(
        "".join(f"a,{i},x,{np.deg2rad(i)},1.5,2.5,{0.1 * i},-0.5\n" for i in range(5)), mapping
    )
    assert (result.transitions, spec.joints) == (4, 2)
    np.testing.assert_allclose(rows["angle"][:, 0], 500 + 11.378 * np.arange(5))
    np.testing.assert_allclose(rows["angle"][:, 1], np.arange(5))
    np.testing.assert_allclose(rows["time"], 0.1 * np.arange(5))
    np.testing.assert_allclose(rows["command"][:4, :, 0], 0.1 * np.arange(4)[:, None] * [1, 1])


def test_a_long_sequence_is_stored_in_parts(imported):
    count = 20_005
    text = "".join(f"a,{i / 10},x,{i % 50},0,0,1,0\n" for i in range(count))
    result, _, rows = imported(text)
    assert (result.sequences, result.rows, result.transitions) == (3, count, count - 3)
    assert rows["sequence"].tolist() == [1] * 10_000 + [2] * 10_000 + [3] * 5


def changed(row, column, value):
    """Return good lines with one field changed; the header is line 1."""
    table = [list(one) for one in GOOD]
    table[row - 2][HEADER.strip().split(",").index(column)] = value
    return lines(*table)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (changed(3, "angle", "nan"), "line 3: column 'angle': expected a finite number, got 'nan'"),
        (changed(4, "p1", "inf"), "line 4: column 'p1': expected a finite number, got 'inf'"),
        (changed(4, "p1", "-1e999"), "line 4: column 'p1': expected a finite number"),
        (changed(2, "p2", ""), "line 2: column 'p2': expected a finite number, got ''"),
        (changed(2, "v1", "open"), "line 2: column 'v1': expected a finite number, got 'open'"),
        (changed(3, "v2", 0.5), "line 3: column 'v2': expected -1, 0 or 1, got 0.5"),
        (changed(3, "v2", 2), "line 3: column 'v2': expected -1, 0 or 1, got 2"),
        (changed(3, "angle", 51), "line 3: column 'angle': expected -50 to 50, got 51; is the unit right"),
        (changed(3, "p1", 5), "line 3: column 'p1': expected -0.21 to 1.26, got 5; is the unit right"),
        (changed(4, "t", 0.1), "line 4: column 't': 0.1 s is less than half a period of 0.1 s after 0.1 s"),
        (changed(4, "t", 0.0), "line 4: column 't': 0 s is less than half a period"),
        (lines(*GOOD, ("d", 1)), "line 9: expected 8 fields, got 2"),
        ("", "no sequence of two rows or more"),
        (lines(GOOD[0]), "no sequence of two rows or more"),
    ],
)
def test_mistakes_in_the_recording_are_told_by_place_and_leave_nothing(imported, tmp_path, text, message):
    with pytest.raises(UnusableInput) as failure:
        imported(text)
    assert message in str(failure.value)
    assert str(tmp_path / "r.csv") in str(failure.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.toml", "r.csv"]


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("", "needs the column(s) angle, p1, p2, run, t, v1, v2 once each; the file has none"),
        ("run,t,angle,p1\n", "needs the column(s) p2, v1, v2 once each; the file has run, t, angle, p1"),
        (HEADER.replace("extra", "angle"), "needs the column(s) angle once each"),
    ],
)
def test_missing_columns_are_told(imported, header, message):
    with pytest.raises(UnusableInput) as failure:
        imported("", header=header)
    assert message in str(failure.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "deg"', 'unit = "gon"', "gon"),
        ('commands = "valves"', "", "missing required field `commands`"),
        ('commands = "valves"', 'commands = "hydraulic"', "hydraulic"),
        ("period = 0.1", "", "needs the period"),
        ("period = 0.1", "period = -1", r"> 0.0 - at `\$.period`"),
        ("period = 0.1", 'period = "fast"', "fast|float"),
        ("counts_per_bar", "count_per_bar", "has no count_per_bar; it has angle_limits"),
        ("period = 0.1", "period = 0.1\njoints = 2", "has no joints"),
        ("full_scale = 0.5", "full_scale = nan", "full_scale of 'p2' must be over 0"),
        ("full_scale = 0.5", "half_scale = 0.5", "unknown field `half_scale`"),
        ('column = "v1"', "column = 1", "Expected `str`"),
        ("[[joint]]", "[joint]", "Expected `array`"),
        ("sequence =", "sequence", "m.toml"),
    ],
)
def test_mistakes_in_the_mapping_are_told(imported, tmp_path, old, new, message):
    assert old in MAPPING
    with pytest.raises(UnusableInput, match=message):
        imported(lines(*GOOD), MAPPING.replace(old, new))
    assert not (tmp_path / "s.db").exists()


def test_places_that_are_taken_or_missing_are_told(imported, tmp_path):
    imported(lines(*GOOD))
    with pytest.raises(UnusableInput, match="expected a store"):
        import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "m.toml")
    with pytest.raises(UnusableInput, match="does not exist; create it first"):
        import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "none" / "s.db")
    with pytest.raises(UnusableInput, match="no such file"):
        import_recording(tmp_path / "none.csv", tmp_path / "m.toml", tmp_path / "t.db")
    with pytest.raises(UnusableInput, match="no such file"):
        import_recording(tmp_path / "r.csv", tmp_path / "none.toml", tmp_path / "t.db")


def test_the_example_maps_a_recording_of_its_kind(imported):
    header = "episode,t_s,angle_rad,velocity_rad_s,p1_norm,p2_norm,a1,a2\n"
    mapping = EXAMPLE.read_text(encoding="utf-8")
    text = "0,0.00,-1.70885,0.0,-0.09923,1.16415,-4.3086,3.8828\n0,0.01,0.80063,-14.1,1.01185,-0.1,0.1,0.2\n"
    result, spec, rows = imported(text, mapping, header)
    assert result.transitions == 1
    np.testing.assert_allclose(np.deg2rad(spec.degrees(rows["angle"][:, 0])), [-1.70885, 0.80063], rtol=1e-12)
    np.testing.assert_allclose(spec.bar(rows["pressure"][:, 0]), [[-0.09923, 1.16415], [1.01185, -0.1]], rtol=1e-12)
    np.testing.assert_array_equal(rows["command"][0, 0], [-4.3086, 3.8828])
    assert read_mapping(EXAMPLE)[1] == spec


def test_pulses_are_imported_where_the_mapping_says_so(imported):
    text = lines(*GOOD).replace("1,-1\n", "0.25,-1\n", 1)
    _, _, rows = imported(text, MAPPING.replace('"valves"', '"pulses"'))
    np.testing.assert_array_equal(rows["command"][0, 0], [0.25, -1.0])


def test_pulses_longer_than_a_period_are_none(imported):
    text = lines(*GOOD).replace("1,-1\n", "1.25,-1\n", 1)
    with pytest.raises(UnusableInput, match=r"expected -1 to 1, got 1\.25"):
        imported(text, MAPPING.replace('"valves"', '"pulses"'))
