"""Tables that other programs wrote, as rows of text, in bounded memory: CSV as it is met with, and Parquet.

CSV is separated by commas, semicolons, tabs, bars or spaces, whatever its header is. The header is the first line
that has all the columns asked for, below a title or other lines and behind a ``#`` if need be.
"""

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import Any, NamedTuple

from pneumarm.errors import UnusableInput
from pneumarm.transitions.parquet import Name, batches_of, files_of, is_parquet

_LONGEST_LINE = 64 << 10  # characters
_PREAMBLE = 100  # lines in which a header is looked for: more than any logger writes above it
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}


class Row(NamedTuple):
    """A row of a table."""

    line: int
    """Line that it begins in, from 1; in Parquet the number of the row."""
    fields: list[str]
    lines: int = 1
    """Lines that it takes: several where a quoted field holds ends of lines."""
    torn: bool = False
    """Whether the file ends in it, without an end of the line."""


class Table(NamedTuple):
    """A table of which the header is read."""

    places: list[int]
    """Where in a row the columns are that were asked for."""
    width: int
    """Fields of a row; a row may have empty ones behind them."""
    separator: str
    """What stands between fields: one character."""
    rows: Iterator[Row]
    """What comes below the header; can be iterated over once."""

    @property
    def separators(self) -> str:
        """What its fields are separated by, in words."""
        return _SEPARATORS[self.separator]


def read_table(path: Path, wanted: Sequence[str]) -> Table:
    """Return the table in the file or dataset ``path``, and where in its rows the columns ``wanted`` are.

    Raises:
        UnusableInput: it cannot be read, or has not each of the columns once; while its rows are iterated over too.

    """
    if not is_parquet(path):
        return _csv(path, wanted)
    batches = batches_of(path)
    names, first = next(batches, ([], iter(())))
    places = _places(names, wanted)
    if places is None:
        raise UnusableInput(f"{path}: {_lacks(names, wanted)}")

    def rows() -> Iterator[list[str]]:
        yield from first
        for others, batch in batches:
            if others != names:
                raise UnusableInput(f"{path}: its parts have different columns: {names} and {others}"[:600])
            yield from batch

    return Table(places, len(names), ",", (Row(number, row) for number, row in enumerate(rows(), start=1)))


def _csv(path: Path, wanted: Sequence[str]) -> Table:
    files_of(path)
    lines = _lines(path)
    head = list(islice(lines, _PREAMBLE))
    tried: list[tuple[list[Name], int]] = []  # by every separator the first line that might have been the header
    for separator in _SEPARATORS:
        reader, first = _reader(map(_uncommented, head), separator), None
        try:
            for fields in reader:
                names, begin = _names(fields), reader.line_num
                places = _places(names, wanted)
                if places is not None:
                    rows = _rows(path, chain(head[begin:], lines), separator, begin)
                    return Table(places, len(names), separator, rows)
                if first is None and names and not head[begin - 1].startswith("#"):
                    first = names, begin
        except csv.Error:
            pass
        tried += [first] if first else []
    names, line = max(tried, key=lambda one: len(one[0]), default=([], 1))
    raise UnusableInput(f"{path}: line {line}: {_lacks(names, wanted)}")


def _uncommented(line: str) -> str:
    return re.sub(r"^#+ *", "", line)


def _reader(lines: Iterable[str], separator: str) -> Any:
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


def _names(fields: list[str]) -> list[Name]:
    """Return the names in a header, without those that are empty at its end."""
    names = [Name(field.strip(), field.strip()) for field in fields]
    while names and not names[-1].full:
        names.pop()
    return names


def _places(names: list[Name], wanted: Sequence[str]) -> list[int] | None:
    """Return where the columns ``wanted`` are, by their full names or by short ones; None where one is not once."""
    found = [_candidates(names, one) for one in wanted]
    return [one[0] for one in found] if all(len(one) == 1 for one in found) else None


def _candidates(names: list[Name], wanted: str) -> list[int]:
    full = [place for place, name in enumerate(names) if name.full.strip() == wanted.strip()]
    return full or [place for place, name in enumerate(names) if name.short.strip() == wanted.strip()]


def _lacks(names: list[Name], wanted: Sequence[str]) -> str:
    """Return what is wrong with ``names``, and those there are; of what is ambiguous first what it could be."""
    found = {one: _candidates(names, one) for one in wanted}
    wrong = sorted(one for one, places in found.items() if len(places) != 1)
    first = dict.fromkeys(place for one in wrong for place in found[one])
    offered = [names[place].full for place in (first | dict.fromkeys(range(len(names))))]
    return (
        f"the mapping needs the column(s) {', '.join(wrong)} once each; "
        f"the file has {', '.join(offered)[:600] or 'none'}"
    )


def _lines(path: Path) -> Iterator[str]:
    number = 0
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            while line := file.readline(_LONGEST_LINE + 1):
                number += 1
                if len(line) > _LONGEST_LINE:
                    raise UnusableInput(
                        f"{path}: line {number}: longer than {_LONGEST_LINE} characters: this is not CSV"
                    )
                yield line
    except OSError as error:
        raise UnusableInput(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise UnusableInput(f"{path}: expected CSV in UTF-8, this is something else ({error})") from error


def _rows(path: Path, lines: Iterator[str], separator: str, begin: int) -> Iterator[Row]:
    """Give the rows in ``lines``, which come after the first ``begin`` of the file."""
    last = ""

    def noted() -> Iterator[str]:
        nonlocal last
        for last in lines:  # noqa: UP028 - the reader does not tell how a line ended
            yield last

    reader, before = _reader(noted(), separator), 0
    try:
        for fields in reader:
            if fields and fields != [""]:
                torn = not last.endswith(("\n", "\r"))
                yield Row(begin + before + 1, fields, reader.line_num - before, torn)
            before = reader.line_num
    except csv.Error as error:
        raise UnusableInput(f"{path}: line {begin + reader.line_num}: not CSV ({error})") from error
