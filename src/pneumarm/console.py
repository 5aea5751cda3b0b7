"""What the command line shows: lines and tables for people, and one JSON object for programs."""

import io
import json
import math
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rich.console import Console
from rich.table import Table

from pneumarm.address import masked
from pneumarm.errors import shortened

_LONGEST_LINE = 480  # characters of an error
_NARROWEST = 20  # columns in which tables and helps can be laid out; terminals that cannot tell say 0
_columns = os.environ.get("COLUMNS", "")
if not re.fullmatch("[0-9]{2,6}", _columns) or int(_columns) < _NARROWEST:
    os.environ.pop("COLUMNS", None)
ERRORS = Console(stderr=True, highlight=False)
"""Prints for people on stderr."""


def say(text: str) -> None:
    """Print a line for people on stderr."""
    ERRORS.print(text, markup=False, soft_wrap=True)


def complain(error: BaseException | str) -> None:
    """Print an error as one line on stderr, without the passwords of addresses that were given.

    Nothing in it is too long for a screen or moves the cursor there, whatever it repeats of what was given.
    """
    line = masked(" ".join(str(error).split()))
    shown = (one if one.isprintable() else one.encode("unicode_escape").decode() for one in line)
    print(f"pneumarm: {shortened(''.join(shown), _LONGEST_LINE)}", file=sys.stderr)


def open_closed_streams() -> None:
    """Open what of stdin, stdout and stderr the caller has closed, so that no file of ours gets their numbers.

    On stdin any bytes can be read as text.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # which takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115 - as long as the program runs
    if isinstance(sys.stdin, io.TextIOWrapper):
        with suppress(io.UnsupportedOperation):  # it has been read from
            sys.stdin.reconfigure(errors="replace")  # what is no text is told of like any other wrong line


def show(result: Mapping[str, Any], as_json: bool, table: Callable[[], Sequence[Table | str]]) -> None:
    """Print ``result``: one JSON line on stdout, or else the tables for people."""
    if as_json:
        print(json.dumps(jsonable(result), allow_nan=False))
        return
    out = Console(highlight=False, markup=False)  # "[bar]" is a unit, not a colour
    for part in table():
        out.print(part, soft_wrap=isinstance(part, str))


def table(header: Sequence[str], rows: Sequence[Sequence[Any]], title: str = "") -> Table:
    """Return a table for people; numbers are rounded to four digits, None is a dash."""
    built = Table(*header, title=title or None, title_justify="left")
    for row in rows:
        built.add_row(*[_short(value) for value in row])
    return built


def percent(share: Any) -> str:
    """Return a ``share`` for people, or one a joint: ``10.5 %``; a dash where it is not known."""
    if isinstance(share, list | tuple):
        return ", ".join(map(percent, share))
    return "-" if share is None or not math.isfinite(share) else f"{100 * share:.3g} %"


def peak_memory(children: bool = False) -> float:
    """Return the most memory that this process has held, or the largest of its ``children`` that have ended [MB].

    Of children Windows does not tell: 0.
    """
    try:
        import resource
    except ImportError:  # Windows
        from psutil import Process

        now = Process().memory_info()
        return 0.0 if children else round(getattr(now, "peak_wset", now.rss) / 1e6, 1)
    most = resource.getrusage(resource.RUSAGE_CHILDREN if children else resource.RUSAGE_SELF).ru_maxrss
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
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:z.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_short, value)) or "none"
    return str(value)
