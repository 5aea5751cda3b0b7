"""A small run of the whole job, made once and used by the tests of everything that comes after it."""

import signal
from pathlib import Path

import hypothesis
import pytest

import soak
from once import made_once
from pneumarm.console import peak_memory
from pneumarm.run import Run
from small import SMALL

# An example may wait for a compiler, and for another worker that compiles; no test depends on how fast it is.
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a finished small run, the same for all workers of pytest; tests must not change it."""
    return made_once(tmp_path_factory, "small_run", lambda folder: Run(folder, SMALL).do())


def pytest_configure() -> None:
    """Start children with a terminal's signals, also in a script's background and under nohup.

    There SIGINT or SIGHUP are ignored, which children inherit; what is handled they do not.
    """
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, lambda *_: None)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes minutes, or the last worker works alone on it in the end."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for line in soak.summary:
        terminalreporter.write_line(f"soak: {line}")
    terminalreporter.write_line(f"at most {peak_memory():.0f} MB of memory")
