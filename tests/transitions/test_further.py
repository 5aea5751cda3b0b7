"""Further sensors on their way through the store, the window, and the import of recordings."""

import json
import sqlite3
from dataclasses import replace

import numpy as np
import pytest
from stand_ins import make_recorded

from pneumarm.arm import ArmSpec, Sensor
from pneumarm.errors import UnusableInput
from pneumarm.transitions import Store, Window, filter_transitions, import_recording, transitions
from pneumarm.transitions.rows import Mark, join_rows, rows_of
from pneumarm.transitions.window import observations


def spec_of(joints=1):
    sensors = [Sensor("acceleration", j) for j in range(1, joints + 1)]
    return ArmSpec(joints=joints, velocity_sensor=True, sensors=(*sensors, Sensor("temperature", joints, 2)))


def with_sensors(number, joints=1, **given):
    one = make_recorded(number, joints=joints, **given)
    random = np.random.default_rng([number, 1])
    return replace(one, measured={name: random.normal(size=len(one)) for name in spec_of(joints).further})


@pytest.mark.parametrize("joints", [1, 2])
def test_a_store_gives_back_what_they_said(tmp_path, joints):
    sequences = [with_sensors(i, joints, n=8 + i) for i in range(4)]
    with Store.create(tmp_path / "db", spec_of(joints)) as store:
        store.append_all(sequences)
        store.mark(2, [Mark(3, 5, "not these")])
        store.check()
    with Store.open(tmp_path / "db") as store:
        assert store.further == spec_of(joints).further
        whole = join_rows(store.blocks(rows=9, marked=True))
        kept = join_rows(store)
    for name in spec_of(joints).further:
        np.testing.assert_array_equal(whole.measured[name], np.concatenate([s.measured[name] for s in sequences]))
        assert len(kept.measured[name]) == len(kept) == len(whole) - 3
    assert not np.isin(whole.measured[name][(whole.sequence == 2) & (whole.step == 4)], kept.measured[name]).any()


def test_a_store_wants_a_finite_reading_of_every_sensor_in_every_row(tmp_path):
    one = with_sensors(0)
    name = spec_of().further[1]
    spoiled = {**one.measured, name: np.where(np.arange(len(one)) == 3, np.nan, 0.0)}
    missing = {key: values for key, values in one.measured.items() if key != name}
    with Store.create(tmp_path / "db", spec_of()) as store:
        for measured in (spoiled, missing, {**one.measured, name: np.zeros(3)}):
            with pytest.raises(UnusableInput, match=f"finite readings of its sensor {name}"):
                store.append(replace(one, measured=measured))
        assert store.sequences == 0


def test_the_store_of_an_arm_without_any_is_as_it_was(tmp_path):
    """Its tables are those of version 2, which earlier programs read."""
    with Store.create(tmp_path / "db", ArmSpec()) as store:
        store.append(make_recorded(1))
    connection = sqlite3.connect(tmp_path / "db")
    assert connection.execute("PRAGMA user_version").fetchone() == (2,)
    columns = [row[1] for row in connection.execute("PRAGMA table_info(rows)")]
    connection.close()
    of_joint = ["angle", "pressure_1", "pressure_2", "command_1", "command_2"]
    assert columns == ["sequence", "step", "time", *(f"joint_1_{name}" for name in of_joint)]


def test_an_older_store_of_an_arm_that_measured_its_velocity_is_read_and_gone_on_with(tmp_path):
    """Such stores have the sensor in their spec and its readings nowhere."""
    path, spec = tmp_path / "db", ArmSpec(velocity_sensor=True)
    with Store.create(path, ArmSpec()) as store:
        store.append(make_recorded(1))
    connection = sqlite3.connect(path, isolation_level=None)
    (text,) = connection.execute("SELECT value FROM store WHERE name = 'spec'").fetchone()
    old = {**json.loads(text), "velocity_sensor": True}
    del old["sensors"]
    connection.execute("UPDATE store SET value = ? WHERE name = 'spec'", (json.dumps(old),))
    connection.close()
    with Store.append_to(path) as store:
        assert (store.spec, store.further) == (spec, ())
        store.append(replace(make_recorded(2), measured={"joint_1_velocity": np.zeros(21)}))
        assert join_rows(store).measured == {}
        with pytest.raises(UnusableInput, match="lacks joint_1_velocity"):
            transitions(join_rows(store), Window.of(spec, 3, ["velocity"]))
        store.check()


@pytest.mark.parametrize("joints", [1, 2])
def test_the_window_has_them_where_its_names_say(joints):
    spec, rows = spec_of(joints), rows_of(with_sensors(3, joints))
    window = Window.of(spec, 3, ["temperature", "velocity", "acceleration"])
    assert (window.velocity, window.needs) == ("measured", spec.further)
    assert window.observation_size == 4 * joints + len(spec.sensors)
    found, names = transitions(rows, window), window.input_names()
    assert found.inputs.shape[1] == window.input_size == len(names)
    k = found.step
    for lag in range(3):
        before = np.maximum(k - lag, 0)
        for sensor in spec.sensors:
            column = found.inputs[:, names.index(f"{sensor.name}[k{f'-{lag}' * (lag > 0)}]")]
            np.testing.assert_array_equal(column, rows.measured[sensor.name][before].astype(np.float32))
    for joint in range(joints):
        values = rows.measured[f"joint_{joint + 1}_velocity"]
        np.testing.assert_array_equal(found.target[:, 4 * joint + 1], values[k + 1].astype(np.float32))
        np.testing.assert_array_equal(found.target[:, 4 * joint], rows.angle[k + 1, joint].astype(np.float32))


def test_a_window_that_asks_for_none_is_as_without_them():
    spec, recorded = spec_of(), with_sensors(4)
    assert Window.of(spec, 3) == Window(1, 3)
    plain = rows_of(replace(recorded, measured={}))
    np.testing.assert_array_equal(observations(rows_of(recorded), Window()), observations(plain, Window()))
    assert Window().spec(spec) == ArmSpec()


def test_only_what_the_window_needs_stays_in_the_spec():
    kept = Window.of(spec_of(2), 3, ["temperature"]).spec(spec_of(2))
    assert kept.further == ("joint_2_temperature_2",)
    with pytest.raises(UnusableInput, match="has no sensor of acceleration or velocity; it has temperature"):
        Window.of(kept, 3, ["velocity", "acceleration"])


def test_the_filter_keeps_by_angle_velocity_pressures_and_action_alone(tmp_path):
    """One more sensor does not multiply the cells."""
    with Store.create(tmp_path / "db", spec_of()) as store:
        store.append_all(with_sensors(i, n=80) for i in range(20))
        plain = filter_transitions(store, Window(1, 3), seed=1)
        window = Window.of(store.spec, 3, ["temperature", "acceleration"])
        found = filter_transitions(store, window, seed=1)
    assert found.coverage == plain.coverage
    np.testing.assert_array_equal(found.transitions.step, plain.transitions.step)
    np.testing.assert_array_equal(window.of_joints(found.transitions.target).reshape(-1, 4), plain.transitions.target)


MAPPING = """
commands = "valves"
[arm]
period = 0.1
counts_per_degree = 10.0
[[joint]]
angle = {column = "angle", unit = "counts"}
pressure_1 = {column = "p", unit = "counts"}
pressure_2 = {column = "p", unit = "counts"}
command_1 = {column = "v"}
command_2 = {column = "v"}
velocity = {column = "w", unit = "deg/s"}
acceleration = {column = "a"}
temperature_2 = {column = "t", range = [0, 60]}
"""


def test_a_recording_with_further_sensors_is_imported(tmp_path):
    (tmp_path / "m.toml").write_text(MAPPING)
    (tmp_path / "r.csv").write_text("angle,p,v,w,a,t\n" + "".join(f"5{i},9,1,{i}00,-{i},2{i}\n" for i in range(4)))
    import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "db")
    with Store.open(tmp_path / "db") as store:
        assert store.spec.sensors == (Sensor("acceleration"), Sensor("temperature", 1, 2))
        measured = join_rows(store).measured
    np.testing.assert_allclose(measured["joint_1_velocity"], [0, 1, 2, 3])  # 100 deg/s of 10 counts a degree
    np.testing.assert_allclose(measured["joint_1_acceleration"], [0, -1, -2, -3])
    np.testing.assert_allclose(measured["joint_1_temperature_2"], [20, 21, 22, 23])


def test_a_mapping_needs_the_velocity_of_all_joints_or_of_none(tmp_path):
    second = MAPPING[MAPPING.index("[[joint]]") : MAPPING.index("velocity =")]
    (tmp_path / "m.toml").write_text(MAPPING + second)
    (tmp_path / "r.csv").write_text("angle\n")
    with pytest.raises(UnusableInput, match="the velocity of every"):
        import_recording(tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "db")
