"""Whatever ends a command that moves an arm: its valves are closed, and nothing acknowledged is lost."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

from pneumarm.transitions import Store

TESTS = Path(__file__).parent
COMMANDS = ("collect", "transfer", "run")
ARM = "python:logged_arm:logged"


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


def moving(log: Path, process: subprocess.Popen[str], lines: int) -> None:
    """Wait until so many valve settings are logged."""
    deadline = monotonic() + 60
    while not log.exists() or log.read_text().count("\n") < lines:
        assert process.poll() is None, process.communicate()
        assert monotonic() < deadline, "the arm never moved"
        sleep(0.02)


def environment(log: Path) -> dict[str, str]:
    return os.environ | {"PNEUMARM_TEST_LOG": str(log)}


def started(command: list[str], log: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pneumarm.cli", *command],
        cwd=TESTS, env=environment(log), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip


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
    process = started(arguments(command, small_run, out), log)
    moving(log, process, 700)
    with Store.open(store_of(command, out)) as store:
        acknowledged = store.transitions
    process.send_signal(number)
    sleep(0.05)
    if process.poll() is None:
        process.send_signal(number)  # an impatient person
    _, told = process.communicate(timeout=20)
    assert process.returncode == 128 + number
    assert told.count("\n") == 1
    assert f"interrupted ({number.name}); the arm is closed" in told
    check_closed(log)
    with Store.open(store_of(command, out)) as store:
        assert store.transitions >= acknowledged > 0


PARENT = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-m", "pneumarm.cli", *sys.argv[1:]], stderr=open("/dev/null", "w"))
print(child.pid, flush=True)
time.sleep(100)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells of the end of a parent")
def test_the_end_of_the_parent_closes_the_valves(small_run: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, *arguments("collect", small_run, tmp_path / "out")],
        cwd=TESTS, env=environment(log), stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    moving(log, parent, 300)
    parent.kill()
    parent.communicate()
    deadline = monotonic() + 20
    while not log.read_text().endswith("close\n"):
        assert monotonic() < deadline, "the child goes on without its parent"
        sleep(0.02)
    check_closed(log)


def test_nohup_is_left_alone(small_run: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    process = subprocess.Popen(
        ["nohup", sys.executable, "-m", "pneumarm.cli", *arguments("collect", small_run, tmp_path / "out")],
        cwd=TESTS, env=environment(log), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    moving(log, process, 300)
    process.send_signal(signal.SIGHUP)
    moving(log, process, log.read_text().count("\n") + 500)
    process.terminate()
    process.communicate(timeout=20)
    assert process.returncode == 128 + signal.SIGTERM
    check_closed(log)
