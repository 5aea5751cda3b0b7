"""Sequences to store, and processes that are watched, limited or killed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # for the stand-ins, here and in processes of their own

from stand_ins import make_recorded  # noqa: E402


@pytest.fixture
def recorded():
    return make_recorded


@pytest.fixture
def python():
    """Run a script in a process of its own; returns the completed process."""

    def run(script, *arguments, **options):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), *sys.path])}
        return subprocess.run(
            [sys.executable, "-c", script, *map(str, arguments)],
            capture_output=True,
            text=True,
            env=environment,
            timeout=120,
            **options,
        )

    return run


@pytest.fixture
def python_started():
    """Start a script in a process of its own; those still running at the end of the test are killed."""
    started = []

    def start(script, *arguments):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), *sys.path])}
        process = subprocess.Popen(
            [sys.executable, "-c", script, *map(str, arguments)], stdout=subprocess.PIPE, text=True, env=environment
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()
