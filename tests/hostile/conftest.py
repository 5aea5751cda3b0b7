"""Sound files, made once by a small run, and the server of commands that have been used on them."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from children import python
from once import made_once
from small import exit_status
from tests.hostile.attacks import AGENT, READ, RUN, SIMULATION
from tests.hostile.commands import ARM, Commands, commands

START = "from pneumarm.cli import main; main()"


def make_sound(folder: Path) -> None:
    """Fill ``folder`` with an agent, a simulation, a store, a table, a spec and a run, all by pneumarm's commands."""
    run = folder / "run"
    assert exit_status([*RUN, "--out", str(run)]) == 0
    for name, short in (("agent.safetensors", "arm.agent"), ("simulation.safetensors", "arm.sim")):
        shutil.copy(run / name, folder / short)
    shutil.copy(run / "transitions.db", folder / "arm.db")
    assert exit_status(["export", str(folder / "arm.db"), "--out", str(folder / "arm.csv")]) == 0
    python("-c", START, "arm", "calibrate", ARM, "--out", folder / "arm.toml", input="", check=True)


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once(tmp_path_factory, "sound_files", make_sound)


@pytest.fixture(scope="session")
def on_files(sound: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    used = [
        tuple(word.replace("damaged", "arm") for word in one)
        for one in [*AGENT.values(), *SIMULATION.values(), *READ.values()]
    ]
    with commands(sound, tmp_path_factory.mktemp("hostile"), used) as found:
        yield found
