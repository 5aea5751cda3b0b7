"""Rows that no sound sensor gives are marked, imported or recorded; no row of a sound arm is."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import ArmSpec, Reading
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.cli import main
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.transitions import Store, collect, import_recording

N = 200
SPEC = ArmSpec()
MAPPING = """
time = "t"
commands = "{commands}"
[arm]
period = 0.02
angle_range = [0, 1000]
[[joint]]
angle = {{ column = "q", unit = "counts", range = [-500, 1500] }}
pressure_1 = {{ column = "p1", unit = "counts", range = [-1000, 1000] }}
pressure_2 = {{ column = "p2", unit = "counts" }}
command_1 = {{ column = "a1" }}
command_2 = {{ column = "a2" }}
"""


def sound(recorded):
    """Return a sequence of an arm that moves in the middle of its ranges, its valves acting all the time."""
    k = np.arange(N)
    angle = 500 + 300 * np.sin(k / 9)[:, None]
    pressure = np.stack([80 + 50 * np.sin(k / 9), 80 - 50 * np.sin(k / 9)], axis=1)[:, None]
    return recorded(n=N, angle=angle, pressure=pressure)


def spoiled(one, what, places, value):
    """Return ``one`` with ``value`` in the ``places`` of what a sensor read, ``what`` is angle or pressure 1."""
    values = getattr(one, what.split()[0]).copy()
    values[(places, 0, *([0] if "pressure" in what else []))] = value
    return replace(one, **{what.split()[0]: values})


def marked(one, tmp_path, spec=SPEC, valves=True):
    """Return the marked steps by reason, as a store has them."""
    with Store.create(tmp_path / "store.db", spec, valves) as store:
        store.append(one)
        rows: dict[str, list[int]] = {}
        for mark in store.marks().get(1, []):
            rows.setdefault(mark.reason, []).extend(range(mark.first, mark.last + 1))
        assert {reason: len(steps) for reason, steps in rows.items()} == store.marked_rows()
        store.check()
    return rows


OUTSIDE = "the angle reads outside the range of the sensor, or leaps across it"


@pytest.mark.parametrize(
    ("what", "places", "value", "reason", "steps"),
    [
        ("pressure", slice(None), 77.0, "pressure 1 reads one constant while valves act", list(range(N))),
        ("angle", slice(60, 160), 512.0, "the angle reads one constant while valves act", list(range(60, 160))),
        ("angle", 90, 1400.0, OUTSIDE, [90]),
        ("angle", 90, -3.0, OUTSIDE, [90]),
        ("pressure", 90, -300.0, "pressure 1 reads outside the range of the sensor", [90]),
    ],
)
def test_what_is_constant_or_out_of_range_is_marked(recorded, tmp_path, what, places, value, reason, steps):
    whole = sound(recorded)
    assert marked(whole, tmp_path) == {}
    (tmp_path / "store.db").unlink()
    assert marked(spoiled(whole, what, places, value), tmp_path) == {reason: steps}


def test_a_pressure_far_over_the_limit_is_marked_unless_the_inlet_is_open(recorded, tmp_path):
    one = sound(recorded)
    command = one.command.copy()
    command[89, 0, 0] = 0.0
    spike = spoiled(replace(one, command=command), "pressure", 90, 800.0)
    assert list(marked(spike, tmp_path).values()) == [[90]]
    command = command.copy()
    command[89, 0, 0] = 1.0
    (tmp_path / "store.db").unlink()
    assert marked(replace(spike, command=command), tmp_path) == {}


def test_an_encoder_that_wraps_is_marked_where_it_does(recorded, tmp_path):
    wrapped = np.mod(900 + 10.0 * np.arange(N), 1024)[:, None]
    assert marked(replace(sound(recorded), angle=wrapped), tmp_path) != {}
    with Store.open(tmp_path / "store.db") as store:
        (rows,) = store.blocks()
        assert (np.abs(np.diff(rows.angle[:, 0]))[np.diff(rows.step) == 1] < 100).all()


@pytest.mark.parametrize("commanded", [0.0, -1.0])
def test_a_muscle_that_stays_empty_is_not_marked(recorded, tmp_path, commanded):
    command = np.full((N, 1, 2), commanded)
    command[-1] = np.nan
    assert marked(spoiled(replace(sound(recorded), command=command), "pressure", slice(None), 0.0), tmp_path) == {}


def test_a_joint_held_against_its_end_stop_is_not_marked(recorded, tmp_path):
    one = sound(recorded)
    pressure = one.pressure + np.array([[[80.0, -20.0]]])
    assert marked(replace(spoiled(one, "angle", slice(None), 900.0), pressure=pressure), tmp_path) == {}


def imported(tmp_path, commands, constant):
    """Import 400 rows, the first ``constant`` of which have one pressure, and one an angle out of range."""
    random, k = np.random.default_rng(0), np.arange(400)
    table = np.stack(
        [
            0.02 * k,
            500 + 300 * np.sin(k / 9),
            np.where(k < constant, 66, 100 + 60 * np.sin(k / 7)),
            80 + 50 * np.sin(k / 9),
            *random.integers(-1, 2, (2, 400)),
        ]
    ).T
    table[30, 1] = 1200
    np.savetxt(tmp_path / "r.csv", table, "%.6g", ",", header="t,q,p1,p2,a1,a2", comments="")
    (tmp_path / "m.toml").write_text(MAPPING.format(commands=commands), encoding="utf-8")
    return import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "s.db").transitions


CONSTANT = "pressure 1 reads one constant while valves act"


@pytest.mark.parametrize("commands", ["valves", "continuous"])
def test_imported_rows_are_marked(tmp_path, commands):
    assert 0 < imported(tmp_path, commands, 300) < 100
    with Store.open(tmp_path / "s.db") as store:
        assert store.marked_rows() == {OUTSIDE: 1, CONSTANT: 300}


def test_a_recording_that_is_all_marked_is_refused_with_what_is_wrong(tmp_path):
    with pytest.raises(UnusableInput, match=f"no transition to learn from: .*400 x {CONSTANT}"):
        imported(tmp_path, "valves", 400)
    assert not (tmp_path / "s.db").exists()


class Frozen(ArmWrapper):
    """An arm of which the first pressure sensor reads one constant."""

    def read(self) -> Reading:
        reading = self.arm.read()
        return replace(reading, pressure=np.stack([np.full(1, 40.0), reading.pressure[:, 1]], axis=1))


def test_collecting_on_a_sensor_that_reads_one_constant_ends_and_names_it(tmp_path):
    arm = Frozen(VirtualArm(draw_parameters(3), seed=1))
    with (
        Store.create(tmp_path / "store.db", arm.spec) as store,
        pytest.raises(ArmFailure, match=r"pressure 1 reads one constant while valves act, in 5 sequences in a row"),
    ):
        collect(arm, store, 4000)
    with Store.open(tmp_path / "store.db") as store:
        assert (store.sequences, store.transitions) == (5, 0)


@pytest.mark.parametrize("seed", [7, 8])
def test_no_row_of_a_sound_arm_is_marked(tmp_path, seed):
    arm = VirtualArm(draw_parameters(seed), seed=seed)
    with Store.create(tmp_path / "store.db", arm.spec) as store:
        assert collect(arm, store, 2000).marked == {}
        assert store.marks() == {}


def test_marks_are_told_by_the_commands(recorded, tmp_path, capsys):
    path = tmp_path / "store.db"
    with Store.create(path, SPEC) as store:
        store.append_all(spoiled(sound(recorded), "pressure", slice(None), 77.0) for _ in range(3))
        store.append_all([sound(recorded)] * 2)
    said = "600 rows marked: pressure 1 reads one constant while valves act"
    with pytest.raises(SystemExit, match="0"):
        main(["coverage", str(path), "--json"])
    shown = capsys.readouterr()
    assert said in shown.err
    assert json.loads(shown.out)["marked"] == {"pressure 1 reads one constant while valves act": 600}
    with pytest.raises(SystemExit, match="2"):
        main(["fit", str(path), "--out", str(tmp_path / "sim")])
    assert "600 rows are marked: pressure 1" in capsys.readouterr().err
