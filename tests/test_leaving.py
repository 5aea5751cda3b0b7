"""Whatever ends a command that moves an arm: its valves are closed, and nothing acknowledged is lost."""

import os
import signal
import sys
from collections.abc import Collection
from contextlib import AbstractContextManager
from importlib import import_module
from inspect import signature
from pathlib import Path
from subprocess import Popen
from time import sleep

import pytest
from llvmlite.binding.executionengine import ExecutionEngine

from children import child, end, python, wait_until
from pneumarm import cli, leaving
from pneumarm.transitions import Store

TESTS = Path(__file__).parent
COMMANDS = ("collect", "transfer", "run")
ARM = "python:logged_arm:logged"
PNEUMARM = (sys.executable, "-m", "pneumarm.cli")


def arguments(command: str, small_run: Path, out: Path) -> list[str]:
    """Return a command line that would take minutes, so that it is always in the middle when the signal comes."""
    return {
        "collect": ["collect", ARM, str(out), "--transitions", "1000000"],
        "transfer": [
            "transfer", str(small_run / "agent.safetensors"), "--arm", ARM, "--out", str(out),
            "--test-episodes", "100000", "--episodes", "0",
        ],
        "run": ["run", "--arm", ARM, "--out", str(out), "--transitions", "1000000"],
    }[command]  # fmt: skip


def store_of(command: str, out: Path) -> Path:
    return out if command == "collect" else out / "transitions.db"


def acknowledged(store: Path) -> int:
    """Return how many transitions are in ``store``; none before there is a store."""
    if not store.exists():
        return 0
    with Store.open(store) as opened:
        return opened.transitions


def wait_for_moves(log: Path, process: Popen[str], lines: int) -> None:
    """Wait until so many valve settings are logged."""
    wait_until("moving", lambda: log.exists() and log.read_text().count("\n") >= lines, process)


def started(log: Path, *command: str) -> AbstractContextManager[Popen[str]]:
    return child(*command, cwd=TESTS, env=os.environ | {"PNEUMARM_TEST_LOG": str(log)})


def check_closed(log: Path) -> None:
    *_, last_set, end = log.read_text().splitlines()
    assert end == "close"
    assert last_set.endswith("[0, 0]")
    assert "others" not in log.read_text()  # whoever moved the arm did so through the guard


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_signal_closes_the_valves_and_loses_nothing(
    command: str, number: signal.Signals, small_run: Path, tmp_path: Path
) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    with started(log, *PNEUMARM, *arguments(command, small_run, out)) as process:
        wait_until("a movement on disk", lambda: acknowledged(store_of(command, out)) > 0, process)
        before = acknowledged(store_of(command, out))
        process.send_signal(number)
        sleep(0.05)
        _, told = end(process, number)  # an impatient person
    assert process.returncode == 128 + number
    assert told.count("\n") == 1
    assert told == f"pneumarm: interrupted ({number.name}); the arm is closed. Call {command} again to continue\n"
    check_closed(log)
    assert acknowledged(store_of(command, out)) >= before


INTERRUPTED = """
import os, signal, sys
import pneumarm.commands.{file} as command
command.{doing} = lambda *_, **__: os.kill(os.getpid(), signal.SIGINT)
from pneumarm.cli import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize(
    ("file", "doing", "words"),
    [
        ("fit_", "fit_store", "fit {run}/transitions.db --out {out}"),
        ("train_", "train", "train {run}/simulation.safetensors {run}/transitions.db --out {out}"),
        ("test_", "test_agent", "test {run}/agent.safetensors {run}/simulation.safetensors {run}/transitions.db"),
        ("bound_", "measure_bound", "bound --arm virtual --sim {run}/simulation.safetensors"),
    ],
)
def test_without_an_arm_none_is_said_to_be_closed(
    file: str, doing: str, words: str, small_run: Path, tmp_path: Path
) -> None:
    script = INTERRUPTED.format(file=file, doing=doing)
    done = python("-c", script, *words.format(run=small_run, out=tmp_path / "out").split(), "--log", "warning")
    assert done.stderr == "pneumarm: interrupted (SIGINT)\n"
    assert done.returncode == 128 + signal.SIGINT


COMPILING = """
import ctypes, signal, time
from pneumarm.leaving import Interrupted, signals_as_exceptions
signals_as_exceptions()
def _raw_object_cache_notify():
    signal.raise_signal(signal.SIGINT)
try:
    ctypes.CFUNCTYPE(None)(_raw_object_cache_notify)()
    time.sleep(10_000)
except Interrupted as error:
    print(error)
"""


def test_a_signal_that_comes_while_llvm_compiles_is_not_lost() -> None:
    done = python("-c", COMPILING, check=True)
    assert (done.stdout, done.stderr) == ("SIGINT\n", "")
    assert all(callable(getattr(ExecutionEngine, name)) for name in leaving._CALLBACKS)


def test_every_command_that_opens_anybodys_arm_says_that_it_is_closed() -> None:
    told = {name: cli._interrupted([*name.split(), "word"], "") for name in cli.COMMANDS}
    arms = {name for name in cli.COMMANDS if "arm" in parameters(name) or name == "run"}
    virtual = {"bound", "arm emulate"}
    assert {name for name, said in told.items() if "the arm is closed" in said} == arms - virtual
    assert told["experiment"] == "interrupted. Call experiment again to continue"


def parameters(command: str) -> Collection[str]:
    file, _, part = command.partition(" ")
    module = import_module(f"pneumarm.commands.{file}_")
    return signature(getattr(module, f"{part or file}_")).parameters


PARENT = """
import subprocess, sys, time
child = subprocess.Popen(sys.argv[1:], stderr=open("/dev/null", "w"))
print(child.pid, flush=True)
time.sleep(100)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells of the end of a parent")
def test_the_end_of_the_parent_closes_the_valves(small_run: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    command = [*PNEUMARM, *arguments("collect", small_run, tmp_path / "out")]
    with started(log, sys.executable, "-c", PARENT, *command) as parent:
        wait_for_moves(log, parent, 300)
        parent.kill()
        wait_until("the end of the parent's child", lambda: log.read_text().endswith("close\n"))
    check_closed(log)


def test_nohup_is_left_alone(small_run: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with started(log, "nohup", *PNEUMARM, *arguments("collect", small_run, tmp_path / "out")) as process:
        wait_for_moves(log, process, 300)
        process.send_signal(signal.SIGHUP)
        wait_for_moves(log, process, log.read_text().count("\n") + 500)
        end(process, signal.SIGTERM)
    assert process.returncode == 128 + signal.SIGTERM
    check_closed(log)
