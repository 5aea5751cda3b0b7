"""A small run of the whole job, made once and used by the tests of everything that comes after it."""

import os
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

HERE = Path(__file__).parent

THOROUGH = (
    "arm/test_emulated_port.py",  # an emulated board in real time
    "control/test_any_sound_arm.py",
    "control/test_hardware.py",
    "experiments/test_claims.py",
    "experiments/test_on_the_arm.py",
    "experiments/test_several_joints.py",
    "experiments/test_there_and_back.py",
    "firmware/test_driver.py",  # the firmware behind the driver, and on a second simulated chip
    "firmware/test_second_machine.py",
    "hostile/",
    "learning/test_adaptation.py",
    "learning/test_courses.py",
    "live/test_page.py",  # pages in a browser
    "live/test_server.py",
    "planning/test_refine.py",
    "report/test_beside.py",
    "report/test_page.py",
    "report/test_screens.py",
    "simulation/test_history.py",
    "simulation/test_spread.py",
    "test_angle_alone.py",  # arms with less hardware, whole jobs
    "test_cli.py",  # every command; test_run.py and test_moving_commands.py have the main ones
    "test_examples.py",
    "test_further_sensors.py",
    "test_kernels.py",  # compiles from an empty cache
    "test_leaving.py",
    "test_notebooks.py",
    "test_one_muscle.py",
    "test_progress.py",
    "test_rehearsal.py",
    "transitions/test_server.py",  # stores on PostgreSQL and MySQL
)
"""What takes three quarters of the time: ``make test`` leaves it out, ``make test-all`` does not.

Of other files single tests are marked where they are.
"""


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a finished small run, the same for all workers of pytest; tests must not change it."""
    return made_once(tmp_path_factory, "small_run", lambda folder: Run(folder, SMALL).do())


def pytest_configure() -> None:
    """Start children with a terminal's signals, also in a script's background and under nohup.

    There SIGINT or SIGHUP are ignored, which children inherit; what is handled they do not. Nor does any of them open
    a browser, wherever pytest was started.
    """
    os.environ["BROWSER"] = "true"  # a program that does nothing
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, lambda *_: None)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even import what is left out: it may need what ``make test`` does not install."""
    left_out = "not thorough" in config.option.markexpr
    return True if left_out and _is_thorough(collection_path) else None


def _is_thorough(path: Path) -> bool:
    return path.is_file() and path.relative_to(HERE).as_posix().startswith(THOROUGH)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is thorough, and begin with what takes minutes: or the last worker works alone on it in the end."""
    for item in items:
        if _is_thorough(item.path):
            item.add_marker("thorough")
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for line in soak.summary:
        terminalreporter.write_line(f"soak: {line}")
    terminalreporter.write_line(f"at most {peak_memory():.0f} MB of memory")
