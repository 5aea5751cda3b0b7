"""Processes that tests start, signal and wait for: none is waited for without limit, none outlives its test.

They get a terminal's signals whatever pytest was started with, see conftest.py.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from signal import Signals
from time import monotonic, sleep
from typing import Any

LIMIT = 300.0
"""What has not happened after so long [s] never will; a machine with much else to do takes a minute."""


def python(*arguments: object, check: bool = False, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run Python with ``arguments`` and return what came of it; with ``check`` anything but 0 fails the test."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False, **options)
    assert not check or done.returncode == 0, done.stderr
    return done


@contextmanager
def child(*command: object, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start ``command``, with pipes for output and errors; it is killed where it still runs at the end."""
    with subprocess.Popen(
        [*map(str, command)], **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | options
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def end(process: subprocess.Popen[str], number: Signals) -> tuple[str, str]:
    """Send a signal and wait; return what the process wrote to output and errors."""
    process.send_signal(number)
    output, errors = process.communicate(timeout=LIMIT)
    return output, errors


def wait_until(what: str, is_so: Callable[[], bool], process: subprocess.Popen[str] | None = None) -> None:
    """Wait until ``is_so``; the test fails where that takes too long, or ``process`` ends before."""
    deadline = monotonic() + LIMIT
    while not is_so():
        if process is not None and process.poll() is not None:
            raise AssertionError(f"{what}: the process ended before, {process.communicate()}")
        assert monotonic() < deadline, f"{what}: not within {LIMIT:.0f} s"
        sleep(0.02)
