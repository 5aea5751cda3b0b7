"""A controller for the arm that the live page shows in tests, and its parts."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from live.serving import ARM, served
from pneumarm.arm import open_arm
from pneumarm.classical import TuneSettings, tune
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.server import LiveServer
from pneumarm.run import RunSettings


@pytest.fixture(scope="session")
def pid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a controller that was calibrated on the arm in barely enough time."""
    file = tmp_path_factory.mktemp("live") / f"arm-{os.getpid()}.pid"
    with open_arm(ARM) as arm:
        tune("pid", arm, TuneSettings(seconds=120)).save(file)
    return file


@pytest.fixture
def server(pid: Path) -> Iterator[LiveServer]:
    """Return a server of the arm with its controller."""
    with served(LiveArm(RunSettings(arm=ARM), [str(pid)], None)) as server:
        yield server
