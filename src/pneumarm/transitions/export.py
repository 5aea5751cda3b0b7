"""Export a store for other programs: CSV, Parquet, a dataset of LeRobot or of Minari, a recording for Rerun.

A row is a reading and the command that followed it, all in sensor units as they are stored: counts, counts/ms,
m/s2, Celsius; only for Rerun, which is looked at, in degrees and bar. Marked rows are left out, which leaves a gap in
the times. Beside the file, or in the dataset of LeRobot, lies the mapping with which ``pneumarm import`` reads it;
whether a sequence began at rest is not in it.
"""

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.files import as_toml, read_beginning, require_folder, require_output, write_text, written_whole
from pneumarm.transitions.lerobot import export_lerobot
from pneumarm.transitions.minari import export_minari
from pneumarm.transitions.recording import mapping_beside
from pneumarm.transitions.rerun import export_rerun
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.store import Store

_ANYTHING = (-1e9, 1e9)
"""Range in the mapping: what was recorded has been checked."""
_HEAD = "# How pneumarm import reads what was exported."
"""The first line of a mapping, by which one that may be replaced is known."""


class Exported(NamedTuple):
    """What was exported."""

    rows: int
    sequences: int
    mapping: str | None
    """The file by which ``pneumarm import`` reads it again; None where it cannot."""


class Format(NamedTuple):
    """A format of recordings."""

    write: Callable[[Store, Path], Exported]
    """Writes a store whole or not at all, in bounded memory."""
    words: str
    """What it is, for the command's help."""
    is_folder: bool = False


def export_recording(store: Store, path: Path) -> Exported:
    """Write the rows of ``store`` to ``path``, whole or not at all, in bounded memory.

    Raises:
        UnusableInput: the format is unknown or needs what is not installed, ``path`` cannot be written, or something
            else has the name of the mapping beside it.

    """
    if path.suffix not in FORMATS:
        raise UnusableInput(f"{path}: a store is exported to a name that ends in {' or '.join(FORMATS)}")
    format_ = FORMATS[path.suffix]
    (require_output if format_.is_folder else require_folder)(path)
    return format_.write(store, path)


def _lerobot(store: Store, path: Path) -> Exported:
    counts = export_lerobot(store, path, _mapping(store, "episode_index", "observation.time"))
    return Exported(**counts, mapping=str(mapping_beside(path)))


def _as_table(
    write: Callable[[Path, list[str], Iterator[NDArray[np.float64]]], int], store: Store, path: Path
) -> Exported:
    """Have ``write`` make one table of the store, and put the mapping beside it."""
    mapping = mapping_beside(path)
    if mapping.exists() and not _is_ours(mapping):
        raise UnusableInput(f"{mapping}: is no mapping of an export and is left alone; export under another name")
    sequences = set[int]()

    def tables() -> Iterator[NDArray[np.float64]]:
        for rows in store.blocks():
            sequences.update(np.unique(rows.sequence).tolist())
            yield _table(rows, store.further)

    written = write(path, _names(store), tables())
    write_text(mapping, _mapping(store, "sequence", "time"))
    return Exported(written, len(sequences), str(mapping))


def _is_ours(file: Path) -> bool:
    try:
        return read_beginning(file, "a mapping", len(_HEAD)) == _HEAD.encode()
    except UnusableInput:
        return False


def _names(store: Store) -> list[str]:
    joints = [
        f"joint_{joint}_{what}"
        for joint in range(1, store.joints + 1)
        for what in ("angle", "pressure_1", "pressure_2", "command_1", "command_2")
    ]
    return ["sequence", "time", *joints, *store.further]


def _table(rows: Rows, further: Sequence[str]) -> NDArray[np.float64]:
    """Return ``rows`` as a table with the columns of :func:`_names`; the last command of a sequence is 0."""
    joints = np.concatenate([rows.angle[..., None], rows.pressure, np.nan_to_num(rows.command)], axis=2)
    measured = [rows.measured[name] for name in further]
    return np.column_stack([rows.sequence, rows.time, joints.reshape(len(rows), -1), *measured])


def _write_csv(path: Path, names: list[str], tables: Iterator[NDArray[np.float64]]) -> int:
    count = 0
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for table in tables:
            writer.writerows([int(row[0]), *map(_number, row[1:])] for row in table.tolist())
            count += len(table)
    return count


def _number(value: float) -> str:
    """Return the shortest text of ``value`` that gives all of it back."""
    return repr(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def _write_parquet(path: Path, names: list[str], tables: Iterator[NDArray[np.float64]]) -> int:
    pyarrow, parquet = (extra(name, "parquet", f"{path}: Parquet") for name in ("pyarrow", "pyarrow.parquet"))
    types = [pyarrow.int64() if name == "sequence" else pyarrow.float64() for name in names]
    schema = pyarrow.schema(list(zip(names, types, strict=True)))
    count = 0
    with written_whole(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        for table in tables:
            columns = [pyarrow.array(column, kind) for column, kind in zip(_typed(table), types, strict=True)]
            writer.write_table(pyarrow.Table.from_arrays(columns, schema=schema))
            count += len(table)
    return count


def _typed(table: NDArray[np.float64]) -> list[NDArray[Any]]:
    return [table[:, 0].astype(np.int64), *np.ascontiguousarray(table[:, 1:].T)]


def _mapping(store: Store, sequence: str, time: str) -> str:
    """Return the mapping file by which ``pneumarm import`` reads what was exported of ``store``."""
    spec = asdict(store.spec)
    arm = {name: value for name, value in spec.items() if name not in ("joints", "velocity_sensor", "sensors")}
    lines = [_HEAD, f'sequence = "{sequence}"', f'time = "{time}"']
    lines += [f'commands = "{"pulses" if store.valves else "continuous"}"', "", "[arm]"]
    lines += [f"{name} = {as_toml(value)}" for name, value in arm.items() if value is not None]
    for joint in range(1, store.joints + 1):
        lines += ["", "[[joint]]"]
        for what, unit in (("angle", "counts"), ("pressure_1", "counts"), ("pressure_2", "counts")):
            lines.append(_column(what, {"column": f"joint_{joint}_{what}", "unit": unit, "range": _ANYTHING}))
        for what in ("command_1", "command_2"):
            lines.append(_column(what, {"column": f"joint_{joint}_{what}"}))
        for name in store.further:
            what = name.removeprefix(f"joint_{joint}_")
            if what != name:
                told = {"column": name} | ({"unit": "counts/ms"} if what == "velocity" else {})
                lines.append(_column(what, told))
    return "\n".join(lines) + "\n"


def _column(what: str, told: dict[str, Any]) -> str:
    return f"{what} = {as_toml(told)}"


_TABLE = "a table, imported again by the .toml beside it"
FORMATS = {
    ".csv": Format(partial(_as_table, _write_csv), _TABLE),
    ".parquet": Format(partial(_as_table, _write_parquet), _TABLE),
    ".lerobot": Format(_lerobot, "a folder, LeRobot's format v3.0", is_folder=True),
    ".minari": Format(
        lambda store, path: Exported(**export_minari(store, path), mapping=None), "a folder", is_folder=True
    ),
    ".rrd": Format(
        lambda store, path: Exported(**export_rerun(store, path), mapping=None), "to be looked at with Rerun"
    ),
}
"""What a store can be exported as, by the end of the file's name."""
