"""A store becomes what LeRobot, Minari and Rerun read, and a dataset of LeRobot is imported again."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneumarm.errors import UnusableInput
from pneumarm.transitions import Store, import_recording
from pneumarm.transitions.episodes import action_names, episodes, observation_names
from pneumarm.transitions.export import export_recording
from pneumarm.transitions.rows import join_rows

TOO_LARGE = """
import resource, sys
from pneumarm.cli import main
from pneumarm.commands import export_  # with all that it needs compiled
resource.setrlimit(resource.RLIMIT_FSIZE, (36_000, 36_000))
main(["export", sys.argv[1], "--out", sys.argv[2]])
"""
"""Exports onto a disk that is full after 36 kB."""

DEFAULT_FEATURES = {
    "timestamp": "float32",
    **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64"),
}
"""What the format says every dataset has."""


def test_a_dataset_of_lerobot_has_the_published_layout(exportable: Path, tmp_path: Path) -> None:
    """What LeRobot reads first: versions, paths, types, where each episode lies, and that times are on the grid."""
    parquet = pytest.importorskip("pyarrow.parquet")
    folder = tmp_path / "arm.lerobot"
    with Store.open(exportable) as store:
        exported = export_recording(store, folder)
        expected, names, actions = list(episodes(store)), observation_names(store), action_names(store)
        sequences = store.sequences
    assert len(expected) == sequences + 1  # the marked rows have cut one in two
    info = json.loads((folder / "meta" / "info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert info["total_episodes"] == exported.sequences == len(expected)
    assert info["splits"] == {"train": f"0:{len(expected)}"}
    assert {name: info["features"][name]["dtype"] for name in DEFAULT_FEATURES} == DEFAULT_FEATURES
    assert info["features"]["observation.state"] == {"dtype": "float32", "shape": [len(names)], "names": names}
    assert info["features"]["action"] == {"dtype": "float32", "shape": [len(actions)], "names": actions}
    data = parquet.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    assert data.column_names == list(info["features"])
    assert data.num_rows == info["total_frames"] == exported.rows
    np.testing.assert_array_equal(data["index"].to_numpy(), np.arange(data.num_rows))
    on_grid = data["frame_index"].to_numpy() / info["fps"]
    np.testing.assert_allclose(data["timestamp"].to_numpy(), on_grid, atol=1e-4)
    rows = parquet.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    state, action = (np.array(data[name].to_pylist()) for name in ("observation.state", "action"))
    for number, (row, one) in enumerate(zip(rows, expected, strict=True)):
        part = slice(row["dataset_from_index"], row["dataset_to_index"])
        assert row["episode_index"] == number
        assert row["length"] == part.stop - part.start == len(one.action)
        assert (row["data/chunk_index"], row["data/file_index"]) == (0, 0)
        np.testing.assert_allclose(state[part], one.observation[:-1], rtol=1e-6)
        np.testing.assert_allclose(action[part], one.action, rtol=1e-6)
        np.testing.assert_allclose(row["stats/action/mean"], one.action.mean(axis=0), atol=1e-6)
    statistics = json.loads((folder / "meta" / "stats.json").read_text())
    assert statistics.keys() == info["features"].keys()
    for what in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(statistics["action"][what], getattr(action, what)(axis=0), atol=1e-6)
    assert statistics["action"]["count"] == [data.num_rows]
    assert parquet.read_table(folder / "meta" / "tasks.parquet")["task_index"].to_pylist() == [0]


def test_its_tasks_are_read_by_pandas_as_lerobot_reads_them(exportable: Path, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    with Store.open(exportable) as store:
        export_recording(store, tmp_path / "arm.lerobot")
        task = f"recording of {store.spec.name}"
    tasks = pandas.read_parquet(tmp_path / "arm.lerobot" / "meta" / "tasks.parquet")
    assert tasks.loc[task].task_index == 0
    assert tasks.iloc[0].name == task


@pytest.mark.parametrize(("name", "needs"), [("arm.lerobot", "pyarrow"), ("arm.minari", "minari")])
def test_a_dataset_is_made_where_one_stands(
    exportable: Path, tmp_path: Path, name: str, needs: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip(needs)
    monkeypatch.chdir(tmp_path)
    with Store.open(exportable) as store:
        exported = export_recording(store, Path(name))
        assert exported.sequences == store.sequences + 1
        with pytest.raises(UnusableInput, match="exists already"):
            export_recording(store, Path(name))
    assert [one.name for one in tmp_path.iterdir()] == [name]


def test_of_a_dataset_that_cannot_be_written_nothing_is_left(exportable: Path, tmp_path: Path, python: Any) -> None:
    pytest.importorskip("pyarrow")
    failed = python(TOO_LARGE, exportable, tmp_path / "arm.lerobot")
    assert failed.returncode == 1, failed.stderr
    assert "arm.lerobot: cannot be written" in failed.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["arm.parquet", "arm.lerobot"])
def test_what_is_in_parquet_is_imported_again(exportable: Path, tmp_path: Path, name: str) -> None:
    pytest.importorskip("pyarrow")
    with Store.open(exportable) as store:
        exported = export_recording(store, tmp_path / name)
        before, spec, ends = join_rows(store.blocks()), store.spec, [len(one.action) for one in episodes(store)]
    import_recording(tmp_path / name, str(exported.mapping), tmp_path / "again.db")
    with Store.open(tmp_path / "again.db") as store:
        after = join_rows(store.blocks())
        assert store.spec == spec
    kept = np.ones(len(before), bool)
    if (
        name == "arm.lerobot"
    ):  # a frame is an observation with its action: the last observations of episodes have none
        kept[np.cumsum([n + 1 for n in ends]) - 1] = False
    np.testing.assert_array_equal(after.time, before.time[kept])
    np.testing.assert_allclose(after.angle, before.angle[kept], rtol=1e-6)
    np.testing.assert_allclose(after.pressure, before.pressure[kept], rtol=1e-6)


def test_a_dataset_of_minari_is_opened_by_minari(exportable: Path, tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    minari = pytest.importorskip("minari")
    with Store.open(exportable) as store:
        exported = export_recording(store, tmp_path / "arm.minari")
        expected = list(episodes(store))
    dataset = minari.MinariDataset(tmp_path / "arm.minari")
    assert (dataset.total_episodes, dataset.total_steps) == (exported.sequences, exported.rows)
    for found, one in zip(dataset.iterate_episodes(), expected, strict=True):
        np.testing.assert_array_equal(found.observations, one.observation)
        np.testing.assert_array_equal(found.actions, one.action)
        assert found.truncations[-1]
        assert not found.terminations.any()
        assert dataset.observation_space.contains(found.observations[0])
        assert dataset.action_space.contains(found.actions[0])


def test_the_viewer_of_rerun_reads_it_in_degrees_and_bar(exportable: Path, tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk", reason="rerun is not installed: pip install --editable '.[rerun]'")
    with Store.open(exportable) as store:
        exported = export_recording(store, tmp_path / "arm.rrd")
        rows, spec = join_rows(store.blocks()), store.spec
    assert (exported.rows, exported.mapping) == (len(rows), None)
    reader = chunk.RrdReader(tmp_path / "arm.rrd")
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    series = dict[str, list[Any]]()
    for one in reader.stream().to_chunks():
        if not one.is_static:
            batch = one.to_record_batch()
            values = batch.column(batch.schema.names.index("Scalars:scalars")).to_pylist()
            series.setdefault(one.entity_path, []).extend(values)
    assert {f"/{name}" for name in rows.measured} <= set(series)
    np.testing.assert_allclose(np.ravel(series["/joint_1/angle"]), spec.degrees(rows.angle)[:, 0])
    np.testing.assert_allclose(series["/joint_1/pressure"], spec.bar(rows.pressure)[:, 0])
    np.testing.assert_array_equal(series["/joint_1/valves"], rows.command[:, 0])


@pytest.mark.parametrize(("name", "needs"), [("arm.lerobot", "pyarrow"), ("arm.minari", "h5py")])
def test_what_is_there_is_not_overwritten(exportable: Path, tmp_path: Path, name: str, needs: str) -> None:
    pytest.importorskip(needs)
    (tmp_path / name).mkdir()
    with Store.open(exportable) as store, pytest.raises(UnusableInput, match="exists already"):
        export_recording(store, tmp_path / name)


def test_what_is_missing_is_named(exportable: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Store.open(exportable) as store:
        missing = {"b.parquet": "pyarrow", "b.lerobot": "pyarrow", "b.minari": "h5py", "b.rerun": "rerun"}
        for name, library in missing.items():
            monkeypatch.setitem(sys.modules, library, None)
            file = tmp_path / name.replace(".rerun", ".rrd")
            with pytest.raises(UnusableInput, match=rf"needs {library}: pip install 'pneumarm\[{name[2:]}\]'"):
                export_recording(store, file)
            assert not file.exists()
