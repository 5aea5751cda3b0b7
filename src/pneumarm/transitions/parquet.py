"""Parquet files as lines of CSV, so that recordings kept in them are imported by the same mapping.

A folder is a dataset of LeRobot: its files one after the other. A column of vectors becomes a column for each number,
by the names that the dataset gives them.
"""

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.files import read_json, require_regular_file
from pneumarm.transitions.lerobot import INFO

_ROWS = 4096
"""Rows read at once."""


def is_parquet(path: Path) -> bool:
    """Return whether ``path`` is a Parquet file, by its name, or a dataset of LeRobot."""
    return path.suffix == ".parquet" or (path / INFO).is_file()


def lines_of(path: Path) -> Iterator[str]:
    """Give ``path`` as lines of CSV, the header first, in bounded memory.

    Raises:
        UnusableInput: it is neither, is damaged, or pyarrow is not installed.

    """
    arrow, parquet = (extra(name, "parquet", f"{path}: Parquet") for name in ("pyarrow", "pyarrow.parquet"))
    try:
        if not path.is_dir():
            require_regular_file(path, "Parquet or a dataset of LeRobot")
        names = _names(path)
        header: list[str] | None = None
        for file in sorted(path.glob("data/*/*.parquet")) if path.is_dir() else [path]:
            with parquet.ParquetFile(file) as opened:
                for batch in opened.iter_batches(_ROWS):
                    columns = dict(_flat(batch, names))
                    if header is None:
                        header = list(columns)
                        yield from _written([header])
                    yield from _written(zip(*(columns[name] for name in header), strict=True))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, arrow.ArrowException) as error:
        raise UnusableInput(f"{path}: expected Parquet or a dataset of LeRobot; {error}") from error


def _names(path: Path) -> Mapping[str, list[str]]:
    """Return the names of the numbers in columns of vectors."""
    if not path.is_dir():
        return {}
    features = read_json(path / INFO, "what a dataset of LeRobot is")["features"]
    return {name: list(one["names"]) for name, one in features.items() if isinstance(one.get("names"), list)}


def _flat(batch: Any, names: Mapping[str, list[str]]) -> Iterator[tuple[str, list[Any]]]:
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        values = column.to_pylist()
        if values and isinstance(values[0], list):
            inner = names.get(name) or [f"{name}.{i}" for i in range(len(values[0]))]
            yield from zip(inner, map(list, zip(*values, strict=True)), strict=True)
        else:
            yield name, values


def _written(rows: Any) -> Iterator[str]:
    file = io.StringIO(newline="")
    csv.writer(file).writerows(rows)
    yield from file.getvalue().splitlines(keepends=True)
