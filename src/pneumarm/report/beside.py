"""The report of a run, begun in a process beside it: what the arm's moving does not change is drawn meanwhile."""

import os
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Self

from pneumarm.leaving import leave_by_exceptions
from pneumarm.report.page import Section
from pneumarm.report.run_report import read_run, write_report
from pneumarm.report.sections import learned
from pneumarm.report.style import svg

_NICE = 4
"""So that the run, which moves an arm in time, comes first."""
_PATIENCE = 120.0
"""For so long [s] the process may write; it takes seconds."""
_ENDING = 10.0
"""For so long [s] a process that was killed is waited for."""
_WRITE = "write\n"


class ReportBeside:
    """The report of the run in ``folder``, begun by a process of its own; ended with the block it is in."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[str] | None = None

    def begin(self) -> None:
        """Begin, once the files of all that comes before the arm is moved by an agent are there."""
        if self._process is not None:
            return
        command = [sys.executable, "-m", "pneumarm.report.beside", str(self._folder)]
        errors = None if os.environ.get("PNEUMARM_DEBUG") else subprocess.DEVNULL  # the run would write it itself
        with suppress(OSError):
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors, text=True
            )

    def write(self) -> None:
        """Write the report; here, if the process did not begin it or fails.

        Raises:
            UnusableInput: a file is missing or is not what it should be.

        """
        if self._process is not None:
            with suppress(OSError, subprocess.TimeoutExpired):
                self._process.communicate(_WRITE, timeout=_PATIENCE)
                if self._process.returncode == 0:
                    return
        write_report(self._folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_ENDING)


def as_text(section: Section) -> Section:
    """Return ``section`` with its figures drawn."""
    return replace(
        section,
        figures=tuple(
            one if isinstance(one.figure, str) else replace(one, figure=svg(one.figure)) for one in section.figures
        ),
    )


def main() -> None:
    """Draw what there is of the run in the folder that is given; write the report when that is asked for."""
    leave_by_exceptions()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    folder = Path(sys.argv[1])
    drawn = [as_text(section) for section in learned(read_run(folder))]
    if sys.stdin.readline() == _WRITE:
        write_report(folder, drawn)


if __name__ == "__main__":
    main()
