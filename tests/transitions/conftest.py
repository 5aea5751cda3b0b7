"""Sequences to store, and processes that are watched, limited or killed."""

import os
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # for the stand-ins, here and in processes of their own

from stand_ins import make_recorded  # noqa: E402

import children  # noqa: E402


@pytest.fixture
def recorded():
    return make_recorded


@pytest.fixture
def python():
    """Run a script in a process of its own; returns the completed process."""

    def run(script, *arguments):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), *sys.path])}
        return children.python("-c", script, *arguments, env=environment)

    return run
