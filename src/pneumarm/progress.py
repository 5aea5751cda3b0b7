"""How far long work is: a bar on a terminal, plain lines elsewhere; compiling is named and timed as what it is.

Lines are records of the logger ``pneumarm``: INFO where a stage is, DEBUG every kernel that was compiled. The command
line prints them (:func:`print_lines`); a program that imports pneumarm decides with :mod:`logging`.
"""

import logging
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from time import monotonic
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column
from rich.text import Text

from pneumarm.errors import UnusableInput

Report = Callable[[float, float], None]
"""Called with what is done and the total."""
Display = Callable[[str], AbstractContextManager[Report]]
"""Shows how far a stage of this title is while the block runs: :func:`progress`, or :func:`silent`."""

LEVELS = ("debug", "info", "warning")
"""Levels of what is said about long work: every kernel that is compiled; where a stage is; nothing."""
_BEGAN = monotonic()
_EVERY = 10.0  # s between two plain lines of a stage
_TITLE = 34  # letters, so that bars stand below each other

_log = logging.getLogger("pneumarm")


def seconds_since_start() -> float:
    """Return how long ago the command line began [s]."""
    return monotonic() - _BEGAN


class Compiling:
    """How long this process has compiled, and whether it does so now; Numba tells of what is not in its cache.

    Kernels compile the kernels that they call, and threads wait for each other's: what overlaps is counted once.
    """

    def __init__(self) -> None:
        self._inside, self._since, self._spent, self._watches = 0, 0.0, 0.0, False

    def watch(self) -> None:
        """Listen from now on, if anything that compiles has been imported."""
        if self._watches or "numba" not in sys.modules:
            return
        from numba.core import event

        told = self

        class Listener(event.Listener):
            def on_start(self, event: Any) -> None:
                told.begin()

            def on_end(self, event: Any) -> None:
                told.end(event.data["dispatcher"].py_func.__qualname__)

        event.register("numba:compile", Listener())
        self._watches = True

    def begin(self) -> None:
        """Note that a kernel begins to be compiled."""
        if self._inside == 0:
            self._since = monotonic()
        self._inside += 1

    def end(self, kernel: str) -> None:
        """Note that a ``kernel`` has been compiled."""
        self._inside -= 1
        if self._inside == 0:
            seconds = monotonic() - self._since
            self._spent += seconds
            _log.debug("compiled %s in %.1f s", kernel, seconds)

    @property
    def now(self) -> bool:
        """Whether something is being compiled."""
        return self._inside > 0

    @property
    def seconds(self) -> float:
        """How long it took so far [s]."""
        return self._spent + (monotonic() - self._since if self.now else 0.0)


compiling = Compiling()
"""Compiling of this process."""


class Stage:
    """A piece of long work: how far it is and what is said of it."""

    def __init__(self, title: str) -> None:
        compiling.watch()
        self.title, self.done, self.total = title, 0.0, 0.0
        self._began, self._compiled = monotonic(), compiling.seconds

    @property
    def seconds(self) -> float:
        """How long it has taken so far [s]."""
        return monotonic() - self._began

    @property
    def compiling(self) -> float:
        """How much of that went into compiling [s]."""
        return compiling.seconds - self._compiled

    def where(self) -> str:
        """Return a line on how far it is."""
        parts = [f"{self.seconds:.0f} s"]
        if self.total > 0:
            parts.insert(0, f"{self.done:,.0f} of {self.total:,.0f}")
        if 0 < self.done < self.total:
            left = (self.seconds - self.compiling) * (self.total - self.done) / self.done
            parts.append(f"about {left:.0f} s left")
        if compiling.now:
            parts.append("compiling, once on this machine")
        return f"{self.title}: {', '.join(parts)}"

    def ended(self) -> str:
        """Return a line on how long it took."""
        spent = f", {self.compiling:.1f} s of them compiling" if self.compiling > 0.05 else ""
        return f"{self.title}: done in {self.seconds:.1f} s{spent}"


@contextmanager
def silent(title: str) -> Iterator[Report]:
    """Show no progress."""
    yield lambda done, total: None


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show a bar with the time that remains on stderr while the block runs; where that is no terminal, lines."""
    stage, console = Stage(title), Console(stderr=True, highlight=False)
    if not console.is_terminal:
        with _lines(stage) as report:
            yield report
        return
    whole = Column(no_wrap=True)  # on a narrow terminal the bar gives way
    columns = (
        _What(stage, whole),
        BarColumn(),
        MofNCompleteColumn(table_column=whole.copy()),
        TimeElapsedColumn(whole.copy()),
        _Left(table_column=whole.copy()),
    )
    with Progress(*columns, console=console, disable=not _log.isEnabledFor(logging.INFO)) as bar:
        task = bar.add_task(title, total=None)

        def report(done: float, total: float) -> None:
            bar.update(task, completed=int(done), total=int(total))

        yield report


@contextmanager
def _lines(stage: Stage) -> Iterator[Report]:
    """Say now and then where ``stage`` is, also while it reports nothing, and in the end how long it took."""
    over = threading.Event()

    def look() -> None:
        while not over.wait(_EVERY):
            _log.info(stage.where())

    def report(done: float, total: float) -> None:
        stage.done, stage.total = done, total

    looking = threading.Thread(target=look, name="progress", daemon=True)
    looking.start()
    try:
        yield report
        _log.info(stage.ended())
    finally:
        over.set()
        looking.join()


class _What(ProgressColumn):
    """What is done, and whether it is being compiled."""

    max_refresh = 0.2

    def __init__(self, stage: Stage, column: Column) -> None:
        super().__init__(column)
        self._stage = stage

    def render(self, task: Task) -> Text:
        """Return the words."""
        if compiling.now and not task.finished:
            return Text(f"{self._stage.title} (compiling once)".ljust(_TITLE))
        return Text(self._stage.title.ljust(_TITLE))


class _Left(TimeRemainingColumn):
    """The time that is left, and that it is that."""

    def render(self, task: Task) -> Text:
        """Return the words."""
        return Text("left ").append_text(super().render(task))


def checked_level(level: str | None) -> str:
    """Return ``level``, by default info.

    Raises:
        UnusableInput: it is none of :data:`LEVELS`.

    """
    if level is not None and level not in LEVELS:
        raise UnusableInput(f"--log: expected one of {', '.join(LEVELS)}, got {level!r}")
    return level or "info"


def print_lines(level: str) -> None:
    """Print what is said about long work on stderr from ``level`` on, one of :data:`LEVELS`."""
    _log.setLevel(level.upper())
    if not any(isinstance(one, _Printing) for one in _log.handlers):
        _log.addHandler(_Printing())
        _log.propagate = False


class _Printing(logging.Handler):
    """Prints records on what is stderr now."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print ``record``; a log on a disk that is full is no reason to end what an arm is doing."""
        try:
            print(record.getMessage(), file=sys.stderr, flush=True)
        except BrokenPipeError:  # who read it has gone
            raise
        except OSError:
            pass
