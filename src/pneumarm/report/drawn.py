"""The process that draws a report beside its run: ``python -m pneumarm.report.drawn FOLDER``."""

import os
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from pneumarm.leaving import signals_as_exceptions
from pneumarm.report.beside import WRITE
from pneumarm.report.page import Section
from pneumarm.report.run_report import read_run, write_report
from pneumarm.report.sections import PARTS
from pneumarm.report.style import svg

_NICE = 4
"""So that the run, which moves an arm in time, comes first."""


def as_text(section: Section) -> Section:
    """Return ``section`` with its figures drawn."""
    return replace(
        section,
        figures=tuple(
            one if isinstance(one.figure, str) else replace(one, drawn=svg(one.figure)) for one in section.figures
        ),
    )


def draw(folder: Path, wanted: Iterable[str]) -> None:
    """Draw the parts of the report of the run in ``folder`` that are ``wanted``, and write it once that is."""
    drawn: dict[str, list[Section]] = {}
    for name in wanted:
        if name == WRITE:
            write_report(folder, drawn)
        else:
            drawn[name] = [as_text(section) for section in PARTS[name](read_run(folder))]


if __name__ == "__main__":
    signals_as_exceptions()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    draw(Path(sys.argv[1]), (line.strip() for line in sys.stdin))
