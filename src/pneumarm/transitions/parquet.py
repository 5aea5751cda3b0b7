"""Parquet files as rows of text, so that recordings kept in them are imported by the same mapping as CSV.

A folder is a dataset of LeRobot: its files one after the other. A column of vectors becomes a column for each number,
by the names that the dataset gives them; numbers without a name of their own are counted from 0.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.transitions.lerobot import INFO

_ROWS = 4096
"""Rows read at once."""


class Name(NamedTuple):
    """What a column is called."""

    full: str
    """With the feature that it is of, such as ``action.elbow.pos``; no two columns should share it."""
    short: str
    """Without."""


def is_parquet(path: Path) -> bool:
    """Return whether ``path`` is a Parquet file, by its name, or a dataset of LeRobot."""
    return path.suffix == ".parquet" or (path / INFO).is_file()


def files_of(path: Path) -> list[Path]:
    """Return the files that hold the rows of a recording: ``path`` itself, or those of a dataset of LeRobot.

    Raises:
        UnusableInput: one of them is no regular file.

    """
    files = sorted(path.glob("data/*/*.parquet")) if (path / INFO).is_file() else [path]
    for file in files:
        if not file.is_file():  # to open a pipe would wait for ever
            there = "this is not a file" if file.exists() else "there is no such file"
            raise UnusableInput(f"{file}: expected a recording (CSV, Parquet, or a dataset of LeRobot), {there}")
    return files


def batches_of(path: Path) -> Iterator[tuple[list[Name], Iterator[list[str]]]]:
    """Give the names of the columns and some rows at a time, in bounded memory.

    Raises:
        UnusableInput: it is neither Parquet nor a dataset, is damaged, or pyarrow is not installed.

    """
    arrow, parquet = (extra(name, "parquet", f"{path}: Parquet") for name in ("pyarrow", "pyarrow.parquet"))
    files = files_of(path)
    try:
        names = _names(path)
        for file in files:
            with parquet.ParquetFile(file) as opened:
                for batch in opened.iter_batches(_ROWS):
                    columns = dict(_flat(batch, names, arrow.types))
                    yield [name for _, name in columns], map(list, zip(*columns.values(), strict=True))
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
        arrow.ArrowException,
    ) as error:
        reason = str(error).partition("\n")[0][:300]
        raise UnusableInput(f"{path}: expected Parquet or a dataset of LeRobot; {reason}") from error


def _names(path: Path) -> Mapping[str, list[str]]:
    """Return the names of the numbers in columns of vectors."""
    if not path.is_dir():
        return {}
    features = json.loads((path / INFO).read_text(encoding="utf-8"))["features"]
    given = {name: one.get("names") for name, one in features.items()}
    # Datasets before version 3 have a dictionary around the list, such as {"motors": [...]}.
    lists = {name: next(iter(one.values()), None) if isinstance(one, dict) else one for name, one in given.items()}
    return {name: list(map(str, one)) for name, one in lists.items() if isinstance(one, list)}


def _flat(batch: Any, names: Mapping[str, list[str]], types: Any) -> Iterator[tuple[tuple[int, Name], list[str]]]:
    """Give each column of numbers or text, by its place and name, as text; what is missing is empty."""
    place = 0
    for feature, column in zip(batch.schema.names, batch.columns, strict=True):
        values = column.to_pylist()
        if any(is_kind(column.type) for is_kind in (types.is_list, types.is_large_list, types.is_fixed_size_list)):
            size = max((len(one) for one in values if one is not None), default=0)
            inner = names.get(feature, [])
            for i in range(size):
                named = inner[i] if len(inner) == size and inner.count(inner[i]) == 1 else str(i)
                full = f"{feature}.{named}"
                short = full if named == str(i) else named
                yield (place, Name(full, short)), [_text(None if one is None else one[i]) for one in values]
                place += 1
        else:
            yield (place, Name(feature, feature)), list(map(_text, values))
            place += 1


def _text(value: Any) -> str:
    return "" if value is None else str(value)
