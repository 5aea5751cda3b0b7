"""Parquet files as rows of text, so that recordings kept in them are imported by the same mapping as CSV.

A folder is a dataset of LeRobot: its files one after the other. A column of vectors becomes a column for each number,
by the names that the dataset gives them; numbers without a name of their own are counted from 0.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.files import read_json, require_regular_file
from pneumarm.transitions.lerobot import INFO

_ROWS = 4096
"""Rows read at once."""
Name = tuple[str, str]
"""What a column is called: with the feature that it is of, such as ``action.elbow.pos``, and without."""


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
        require_regular_file(file, "a recording (CSV, Parquet, or a dataset of LeRobot)")
    return files


def batches_of(path: Path) -> Iterator[tuple[list[Name], list[tuple[str, ...]]]]:
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
                    columns = list(_flat(batch, names))
                    yield [name for name, _ in columns], list(zip(*(texts for _, texts in columns), strict=True))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError, arrow.ArrowException) as why:
        reason = str(why).partition("\n")[0][:300]
        raise UnusableInput(f"{path}: expected Parquet or a dataset of LeRobot; {reason}") from why


def _names(path: Path) -> Mapping[str, list[str]]:
    """Return the names of the numbers in columns of vectors."""
    if not path.is_dir():
        return {}
    features = read_json(path / INFO, "what a dataset of LeRobot is")["features"]
    given = {name: one.get("names") for name, one in features.items()}
    # Datasets before version 3 have a dictionary around the list, such as {"motors": [...]}.
    lists = {name: next(iter(one.values()), None) if isinstance(one, dict) else one for name, one in given.items()}
    return {name: list(map(str, one)) for name, one in lists.items() if isinstance(one, list)}


def _flat(batch: Any, names: Mapping[str, list[str]]) -> Iterator[tuple[Name, list[str]]]:
    """Give each column, of vectors each of their numbers, with its name and as text; what is missing is empty."""
    for feature, column in zip(batch.schema.names, batch.columns, strict=True):
        values = column.to_pylist()
        size = next((len(one) for one in values if isinstance(one, list)), None)
        if size is None:
            yield (feature, feature), ["" if value is None else str(value) for value in values]
            continue
        if any(one is not None and len(one) != size for one in values):
            raise ValueError(f"the vectors of {feature} differ in length")
        inner = names.get(feature, [])
        inner = inner if len(inner) == size else [""] * size
        for i, named in enumerate(inner):
            own = named and inner.count(named) == 1
            texts = ["" if one is None or one[i] is None else str(one[i]) for one in values]
            yield (f"{feature}.{named if own else i}", named if own else f"{feature}.{i}"), texts
