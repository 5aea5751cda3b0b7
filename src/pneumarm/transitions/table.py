"""Tables that other programs wrote, as rows of text, in bounded memory: CSV as it is met with, and Parquet.

CSV is separated by commas, semicolons, tabs, bars or spaces, whatever its header is. The header is the first line
that has all the columns asked for, below a title or other lines and behind a ``#`` if need be.
"""

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, count, islice
from pathlib import Path
from typing import Any, NamedTuple

from pneumarm.errors import UnusableInput
from pneumarm.transitions.parquet import Name, batches_of, files_of, is_parquet

_LONGEST_LINE = 64 << 10  # characters
_PREAMBLE = 100  # lines in which a header is looked for: more than any logger writes above it
_SEPARATORS = ",;\t| "


class TableRow(NamedTuple):
    """A row of a table."""

    line: int
    """Line that it begins in, from 1; in Parquet the number of the row."""
    fields: Sequence[str]
    lines: int = 1
    """Lines that it takes: several where a quoted field holds ends of lines."""
    torn: bool = False
    """Whether the file ends in it, without an end of the line."""


class OpenTable(NamedTuple):
    """A table whose header was read: where the columns asked for are, and what comes below it, once."""

    places: list[int]
    width: int
    """Fields of a row; a row may have empty ones behind them."""
    separator: str
    rows: Iterator[TableRow]


def open_table(path: Path, wanted: Sequence[str | None]) -> OpenTable:
    """Return the table in the file or dataset ``path``, and where in its rows the columns ``wanted`` are.

    A column that is None is not wanted; its place is -1.

    Raises:
        UnusableInput: it cannot be read, or has not each of the columns once; while its rows are iterated over too.

    """
    if not is_parquet(path):
        files_of(path)
        return _csv(path, wanted)
    batches = batches_of(path)
    names, first = next(batches, ([], []))
    places, wrong = _places(names, wanted)
    if wrong:
        raise UnusableInput(f"{path}: {wrong}")

    def rows() -> Iterator[Sequence[str]]:
        for others, batch in chain([(names, first)], batches):
            if others != names:
                raise UnusableInput(f"{path}: the columns of its parts differ")
            yield from batch

    return OpenTable(places, len(names), ",", (TableRow(number, row) for number, row in enumerate(rows(), start=1)))


def _csv(path: Path, wanted: Sequence[str | None]) -> OpenTable:
    lines = _lines(path)
    head = list(islice(lines, _PREAMBLE))
    best, nearest = (0, 0), f"line 1: {_places([], wanted)[1]}"  # what is wrong with what is most like the header
    for separator in _SEPARATORS:
        reader = _reader((line.lstrip("#") for line in head), separator)
        try:
            for fields in reader:
                names, begin = [(name.strip(), name.strip()) for name in fields], reader.line_num
                while names and not names[-1][0]:
                    names.pop()
                places, wrong = _places(names, wanted)
                if not wrong:
                    rows = _rows(path, chain(head[begin:], lines), separator, begin)
                    return OpenTable(places, len(names), separator, rows)
                if (len(places), len(names)) > best and not head[begin - 1].startswith("#"):
                    best, nearest = (len(places), len(names)), f"line {begin}: {wrong}"
        except csv.Error:
            continue
    if any("\ufffd" in line for line in head):
        nearest += "; expected CSV in UTF-8, this is something else"
    raise UnusableInput(f"{path}: {nearest}")


def _reader(lines: Iterable[str], separator: str) -> Any:
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


def _places(names: list[Name], wanted: Sequence[str | None]) -> tuple[list[int], str]:
    """Return where the columns ``wanted`` are, by whole names or else short ones, and what is wrong with others."""
    whole, short = defaultdict[str, list[int]](list), defaultdict[str, list[int]](list)
    for place, name in enumerate(names):
        whole[name[0].strip()].append(place)
        short[name[1].strip()].append(place)
    found = {one: whole.get(one.strip()) or short.get(one.strip(), []) for one in wanted if one is not None}
    wrong = sorted(one for one, places in found.items() if len(places) != 1)
    places = [-1 if one is None else found[one][0] for one in wanted if one not in wrong]
    if not wrong:
        return places, ""
    first = [place for one in wrong for place in found[one]]  # what is ambiguous comes with all that it may be
    shown = (names[place][0][:100] for place in dict.fromkeys([*first, *range(len(names))]))
    offered = "".join(one if one.isprintable() else "?" for one in ", ".join(shown)[:600])
    return (
        places,
        f"the mapping needs the column(s) {', '.join(wrong)} once each; the file has {offered or 'none'}",
    )


def _lines(path: Path) -> Iterator[str]:
    try:
        with open(path, encoding="utf-8-sig", errors="replace", newline="") as file:
            for number in count(1):
                line = file.readline(_LONGEST_LINE + 1)
                if len(line) > _LONGEST_LINE:
                    wrong = f"longer than {_LONGEST_LINE} characters: this is not CSV"
                    raise UnusableInput(f"{path}: line {number}: {wrong}")
                if not line:
                    return
                yield line
    except OSError as error:
        raise UnusableInput(f"{path}: cannot be read ({error.strerror})") from error


def _rows(path: Path, lines: Iterator[str], separator: str, begin: int) -> Iterator[TableRow]:
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
                yield TableRow(begin + before + 1, fields, reader.line_num - before, not last.endswith(("\n", "\r")))
            before = reader.line_num
    except csv.Error as error:
        raise UnusableInput(f"{path}: line {begin + reader.line_num}: not CSV ({error})") from error
