"""The report of a run, begun in a process beside it: what no longer changes is drawn while the arm is moved.

That process has the library that draws; a run does without it.
"""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Self

_PATIENCE = 120.0
"""For so long [s] the process may write; it takes seconds."""
_ENDING = 10.0
"""For so long [s] a process that was killed is waited for."""
WRITE = "write"
"""What the process is told after the names of parts."""


class ReportBeside:
    """The report of the run in ``folder``, begun by a process of its own; ended with the block it is in."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[str] | None = None
        self._told: list[str] = []

    def begin(self) -> None:
        """Begin the process, which takes a while to load what it draws with; once."""
        if self._process is not None:
            return
        command = [sys.executable, "-P", "-m", "pneumarm.report.drawn", str(self._folder)]
        errors = None if os.environ.get("PNEUMARM_DEBUG") else subprocess.DEVNULL  # the run would write it itself
        with suppress(OSError):
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors, text=True
            )

    def draw(self, name: str) -> None:
        """Have a part drawn, as in :data:`~.sections.PARTS`, of which all files are there; once."""
        if name not in self._told:
            self._told.append(name)
            self._tell(name)

    def write(self) -> None:
        """Write the report; here, if the process did not begin it or fails.

        Raises:
            UnusableInput: a file is missing or is not what it should be.

        """
        if self._process is not None:
            self._tell(WRITE)
            with suppress(OSError, subprocess.TimeoutExpired):
                self._process.communicate(timeout=_PATIENCE)
                if self._process.returncode == 0:
                    return
        from pneumarm.report.run_report import write_report

        write_report(self._folder)

    def _tell(self, word: str) -> None:
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.write(f"{word}\n")
                self._process.stdin.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_ENDING)
