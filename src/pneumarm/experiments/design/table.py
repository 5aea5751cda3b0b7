"""Tables of results: trials by runs, as comma-separated values (contract: ``trial,run 1,...,run n``)."""

import csv
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_text

_EXPECTED = "expected a table with the header trial,run 1,...,run n and a row a trial"


@dataclass(frozen=True)
class ResultTable:
    """Results by trial and run."""

    results: NDArray[np.float64]
    """Shape (trials, runs), sorted by trial."""
    columns: tuple[str, ...]
    """Headings of the runs."""


def parse_table(text: str, source: str, columns: str | None = None) -> ResultTable:
    """Return the table in ``text``, which came from ``source``.

    Args:
        text: comma-separated values; the first column is the number of the trial, 1 to n in any order.
        source: named in errors.
        columns: how the headings of the columns to take begin, such as "delta run"; by default those that begin with
            "run", or all where none does.

    Raises:
        UnusableInput: it is no such table.

    """
    try:
        lines = [line for line in csv.reader(text.splitlines()) if any(cell.strip() for cell in line)]
    except csv.Error as error:
        raise UnusableInput(f"{source}: {_EXPECTED}; {error}") from error
    if len(lines) < 2 or len(lines[0]) < 2:
        first = f", the first {','.join(lines[0])!r}" if lines else ""
        raise UnusableInput(f"{source}: {_EXPECTED}, separated by commas; it has {len(lines)} lines{first}")
    header = [cell.strip() for cell in lines[0]]
    taken = [i for i, name in enumerate(header) if i and name.lower().startswith((columns or "run").lower())]
    if not taken and columns is None:
        taken = list(range(1, len(header)))
    if not taken:
        raise UnusableInput(f"{source}: no column begins with {columns!r}; there are {', '.join(header[1:])}")
    found: dict[int, list[float]] = {}
    for number, line in enumerate(lines[1:], 2):
        if len(line) != len(header):
            raise UnusableInput(
                f"{source}, line {number}: expected {len(header)} cells as in the header, got {len(line)}"
            )
        try:
            trial, values = int(line[0]), [float(line[i]) for i in taken]
        except ValueError as error:
            raise UnusableInput(f"{source}, line {number}: {_EXPECTED}; {error}") from error
        if not np.isfinite(values).all():
            raise UnusableInput(f"{source}, line {number}: results must be finite numbers, got {line}")
        if trial in found:
            raise UnusableInput(f"{source}, line {number}: trial {trial} is there twice")
        found[trial] = values
    if sorted(found) != list(range(1, len(found) + 1)):
        raise UnusableInput(f"{source}: expected the trials 1 to {len(found)}, got {sorted(found)}")
    return ResultTable(np.array([found[trial] for trial in sorted(found)]), tuple(header[i] for i in taken))


def read_table(path: Path, columns: str | None = None) -> ResultTable:
    """Return the table in the file ``path``, see :func:`parse_table`."""
    return parse_table(read_text(path, _EXPECTED.removeprefix("expected ")), str(path), columns)


def packaged_table(package: str, name: str) -> NDArray[np.float64]:
    """Return the table ``name``.csv that lies in ``package``, shape (trials, runs)."""
    file = resources.files(package) / f"{name}.csv"
    return parse_table(file.read_text(encoding="utf-8"), f"{package}/{name}.csv").results


def packaged_results(package: str, *names: str) -> dict[str, NDArray[np.float64]]:
    """Return the thesis' results in ``package``, the tables thesis_NAME.csv, by name."""
    return {name: packaged_table(package, f"thesis_{name}") for name in names}
