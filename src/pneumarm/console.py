"""What the command line shows: progress with an estimate, tables, and one JSON object for programs."""

import json
import math
import resource
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

Report = Callable[[float, float], None]
"""Called with what is done and the total."""

_errors = Console(stderr=True, highlight=False)


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show a bar with the time that remains on stderr while the block runs; nothing where stderr is no terminal."""
    columns = (
        TextColumn("{task.description:<28}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=_errors, disable=not _errors.is_terminal) as bar:
        task = bar.add_task(title, total=None)

        def report(done: float, total: float) -> None:
            bar.update(task, completed=int(done), total=int(total))

        yield report


def say(text: str) -> None:
    """Print a line for people on stderr."""
    _errors.print(text, markup=False, soft_wrap=True)


def complain(error: BaseException | str) -> None:
    """Print an error as one line on stderr."""
    print(f"pneumarm: {' '.join(str(error).split())}", file=sys.stderr)


def show(result: Mapping[str, Any], as_json: bool, table: Callable[[], Sequence[Table | str]]) -> None:
    """Print ``result``: one JSON line on stdout, or else the tables for people."""
    if as_json:
        print(json.dumps(jsonable(result), allow_nan=False))
        return
    out = Console(highlight=False, markup=False)  # "[bar]" is a unit, not a colour
    for part in table():
        out.print(part)


def table(header: Sequence[str], rows: Sequence[Sequence[Any]], title: str = "") -> Table:
    """Return a table for people; numbers are rounded to four digits."""
    built = Table(*header, title=title or None, title_justify="left")
    for row in rows:
        built.add_row(*[_short(value) for value in row])
    return built


def peak_memory() -> float:
    """Return the most memory that this process has held so far [MB]."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(most / (1e6 if sys.platform == "darwin" else 1e3), 1)


def jsonable(value: Any) -> Any:
    """Return ``value`` with NumPy numbers as plain ones and numbers that are not finite as null."""
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    if hasattr(value, "tolist"):
        return jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)
