"""A store as a dataset of LeRobot, format v3.0: a folder of Parquet files with JSON beside them.

Written by its published layout (huggingface.co/docs/lerobot/lerobot-dataset-v3), without LeRobot: many episodes in a
file of ``data/``, where each lies in ``meta/episodes/``, and statistics of every feature in ``meta/``. A frame is an
observation and the action that followed it. ``timestamp`` is on the grid of control periods, as LeRobot wants it;
``observation.time`` is what the arm's clock said.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.files import folder_written_whole
from pneumarm.transitions.episodes import EpisodeRows, action_names, episodes, observation_names
from pneumarm.transitions.store import Store

VERSION = "v3.0"
INFO = "meta/info.json"
MAPPING = "pneumarm.toml"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_TASKS = "meta/tasks.parquet"
_STATISTICS = "meta/stats.json"
_FILES_A_CHUNK = 1000
_LARGEST_FILE = 100  # MB, of which a frame takes some hundred bytes:
_FRAMES_A_FILE = 500_000
_INDICES = ("frame_index", "episode_index", "index", "task_index")
Statistics = dict[str, NDArray[Any]]


def export_lerobot(store: Store, folder: Path, mapping: str) -> dict[str, int]:
    """Write the rows of ``store`` into ``folder``, which is made, whole or not at all; return what was written.

    The text of the ``mapping`` by which it is imported again lies beside them, as :data:`MAPPING`.

    Raises:
        UnusableInput: ``folder`` exists, pyarrow is not installed, there is nothing to write, or the arm's control
            rate is no whole number, which LeRobot cannot say.

    """
    arrow, parquet = (extra(name, "lerobot", "a dataset of LeRobot") for name in ("pyarrow", "pyarrow.parquet"))
    rate = round(1 / store.spec.period)
    if abs(rate * store.spec.period - 1) > 1e-6:
        raise UnusableInput(
            f"{store.address}: LeRobot knows whole numbers of frames a second only, this arm has "
            f"{1 / store.spec.period:g}; export .parquet"
        )
    with folder_written_whole(folder) as temporary:
        counts = _Writer(arrow, parquet, temporary, store, rate).write()
        (temporary / MAPPING).write_text(mapping, encoding="utf-8")
    return counts


class _Writer:
    """Writes episode after episode; what it remembers of each is a row of ``meta/episodes``."""

    def __init__(self, arrow: Any, parquet: Any, folder: Path, store: Store, rate: int) -> None:
        self._arrow, self._parquet, self._folder, self._store, self._rate = arrow, parquet, folder, store, rate
        self._task = f"recording of {store.spec.name}"
        self._features = {
            "observation.state": _feature("float32", observation_names(store)),
            "action": _feature("float32", action_names(store)),
            "observation.time": _feature("float64"),
            "timestamp": _feature("float32"),
            **{name: _feature("int64") for name in _INDICES},
        }
        fields = [arrow.field(name, self._kind(feature)) for name, feature in self._features.items()]
        self._schema = arrow.schema(fields)
        self._file = -1
        self._frames_in_file = _FRAMES_A_FILE
        self._data: Any = None

    def write(self) -> dict[str, int]:
        """Write all; return how many frames and episodes there are."""
        frames, rows, total = 0, list[dict[str, Any]](), dict[str, Statistics]()
        try:
            for number, episode in enumerate(episodes(self._store)):
                columns = self._columns(episode, number, frames)
                place = self._write_frames(columns)
                statistics = {name: _statistics(values) for name, values in columns.items()}
                total = statistics if not total else {n: _together(total[n], statistics[n]) for n in total}
                rows.append(self._row(number, frames, len(episode.action), place, statistics))
                frames += len(episode.action)
        finally:
            if self._data is not None:
                self._data.close()
        if not rows:
            raise UnusableInput(f"{self._store.address}: holds nothing that could be exported")
        self._write_meta(rows, frames, total)
        return {"rows": frames, "sequences": len(rows)}

    def _columns(self, episode: EpisodeRows, number: int, first: int) -> dict[str, NDArray[Any]]:
        n = len(episode.action)
        frame = np.arange(n)
        return {
            "observation.state": episode.observation[:-1].astype(np.float32),
            "action": episode.action.astype(np.float32),
            "observation.time": episode.time[:-1],
            "timestamp": (frame / self._rate).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.full(n, number),
            "index": first + frame,
            "task_index": np.zeros(n, np.int64),
        }

    def _write_frames(self, columns: dict[str, NDArray[Any]]) -> tuple[int, int]:
        """Write an episode, one group of rows; return the chunk and the file that it lies in."""
        if self._frames_in_file >= _FRAMES_A_FILE:
            if self._data is not None:
                self._data.close()
            self._file, self._frames_in_file = self._file + 1, 0
            path = self._path(DATA, *divmod(self._file, _FILES_A_CHUNK))
            self._data = self._parquet.ParquetWriter(path, self._schema)
        arrays = [
            self._array(values, field.type) for values, field in zip(columns.values(), self._schema, strict=True)
        ]
        self._data.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        self._frames_in_file += len(columns["index"])
        return divmod(self._file, _FILES_A_CHUNK)

    def _row(
        self, number: int, first: int, length: int, place: tuple[int, int], statistics: dict[str, Statistics]
    ) -> dict[str, Any]:
        of_features = {
            f"stats/{name}/{what}": values.tolist()
            for name, found in statistics.items()
            for what, values in found.items()
        }
        return {
            "episode_index": number,
            "tasks": [self._task],
            "length": length,
            "data/chunk_index": place[0],
            "data/file_index": place[1],
            "dataset_from_index": first,
            "dataset_to_index": first + length,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            **of_features,
        }

    def _write_meta(self, rows: list[dict[str, Any]], frames: int, total: Mapping[str, Statistics]) -> None:
        self._parquet.write_table(self._arrow.Table.from_pylist(rows), self._path(_EPISODES, 0, 0))
        self._parquet.write_table(self._tasks(), self._path(_TASKS))
        statistics = {name: {what: one.tolist() for what, one in found.items()} for name, found in total.items()}
        self._path(_STATISTICS).write_text(json.dumps(statistics, indent=4), encoding="utf-8")
        info = {
            "codebase_version": VERSION,
            "robot_type": self._store.spec.name,
            "total_episodes": len(rows),
            "total_frames": frames,
            "total_tasks": 1,
            "chunks_size": _FILES_A_CHUNK,
            "data_files_size_in_mb": _LARGEST_FILE,
            "video_files_size_in_mb": 2 * _LARGEST_FILE,
            "fps": self._rate,
            "splits": {"train": f"0:{len(rows)}"},
            "data_path": DATA,
            "video_path": None,
            "features": self._features,
        }
        self._path(INFO).write_text(json.dumps(info, indent=4), encoding="utf-8")

    def _tasks(self) -> Any:
        """Return the table of tasks; LeRobot reads it with pandas and expects the task as its index."""
        table = self._arrow.table({"task_index": self._arrow.array([0]), "task": self._arrow.array([self._task])})
        column = {"metadata": None, "field_name": "task_index", "name": "task_index"}
        about = {
            "index_columns": ["task"],
            "column_indexes": [],
            "columns": [
                {**column, "pandas_type": "int64", "numpy_type": "int64"},
                {**column, "field_name": "task", "name": "task", "pandas_type": "unicode", "numpy_type": "object"},
            ],
            "pandas_version": "2.0.0",
        }
        return table.replace_schema_metadata({"pandas": json.dumps(about)})

    def _path(self, place: str, chunk: int = 0, file: int = 0) -> Path:
        path = self._folder / place.format(chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _kind(self, feature: dict[str, Any]) -> Any:
        number = {"float32": self._arrow.float32(), "float64": self._arrow.float64(), "int64": self._arrow.int64()}
        kind = number[feature["dtype"]]
        return kind if feature["names"] is None else self._arrow.list_(kind, feature["shape"][0])

    def _array(self, values: NDArray[Any], kind: Any) -> Any:
        if values.ndim == 1:
            return self._arrow.array(values, kind)
        flat = self._arrow.array(np.ascontiguousarray(values).ravel())
        return self._arrow.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _feature(kind: str, names: list[str] | None = None) -> dict[str, Any]:
    return {"dtype": kind, "shape": [1 if names is None else len(names)], "names": names}


def _statistics(values: NDArray[Any]) -> Statistics:
    """Return what LeRobot keeps of a feature (frames,) or (frames, n) of an episode, each (n,)."""
    table = values.reshape(len(values), -1).astype(np.float64)
    return {
        "min": table.min(axis=0),
        "max": table.max(axis=0),
        "mean": table.mean(axis=0),
        "std": table.std(axis=0),
        "count": np.array([len(table)]),
    }


def _together(one: Statistics, other: Statistics) -> Statistics:
    """Return the statistics of all frames of two parts."""
    counts = one["count"] + other["count"]
    share = other["count"] / counts
    away = other["mean"] - one["mean"]
    variance = (1 - share) * one["std"] ** 2 + share * other["std"] ** 2 + share * (1 - share) * away**2
    return {
        "min": np.minimum(one["min"], other["min"]),
        "max": np.maximum(one["max"], other["max"]),
        "mean": one["mean"] + share * away,
        "std": np.sqrt(variance),
        "count": counts,
    }
