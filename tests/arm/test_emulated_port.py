"""An emulated board behind a serial port, in real time: the command, the driver, and the whole way to movements."""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from subprocess import Popen
from time import monotonic, sleep
from typing import Any, TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray

from children import child, end, python
from pneumarm.arm import ControlCycle, GuardedArm, Reading, Step, guarded, open_arm
from pneumarm.arm.serial.emulate import serve
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control import Monitor, TransferSettings, transfer_into
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.learning import Agent
from pneumarm.run import Run
from pneumarm.transitions import CollectBegin, CollectResult, CollectSettings, Store, collect
from small import SMALL

Result = TypeVar("Result")
START = "from pneumarm.cli import main; main()"


@contextmanager
def port(link: Path, arm: str = "virtual:seed=3") -> Iterator[Popen[str]]:
    """Serve ``arm`` at ``link`` by the command; the port can be used within the block."""
    command = [sys.executable, "-c", START, "arm", "emulate", arm, "--link", str(link), "--json"]
    with child(*command) as process:
        assert process.stdout is not None
        told = process.stdout.readline()
        assert told, process.communicate()[1]
        assert json.loads(told) == {"port": str(link), "arm": f"serial:{link}"}
        yield process
        end(process, signal.SIGINT)


def test_an_arm_is_served_until_it_is_interrupted_and_leaves_nothing(tmp_path: Path) -> None:
    link = tmp_path / "arm.port"
    link.symlink_to("/dev/pts/nobody")  # of one who was killed
    with port(link) as process:
        for _ in range(2):  # who comes second finds it as the first one did
            with open_arm(f"serial:{link}") as arm:
                asked, begin, heard = monotonic(), arm.read(), monotonic()
                arm.set_valves(np.array([[1, 0]], np.int8))
                arm.wait(0.5)
                asked_again, later, heard_again = monotonic(), arm.read(), monotonic()
                tick = 0.01
                assert asked_again - heard - tick < later.time - begin.time < heard_again - asked + tick
                assert later.pressure[0, 0] > begin.pressure[0, 0] + 20
            sleep(0.05)
    assert process.returncode == 0
    assert not os.path.lexists(link)


def test_a_controller_that_does_not_come_back_is_waited_for_with_the_arm_vented(tmp_path: Path) -> None:
    def moved() -> tuple[GuardedArm, list[float], list[Step]]:
        thoughts = iter([0.0] * 10 + [1.5] + [0.0] * 10)  # s; the dead-man would have vented after a quarter
        pressures = []

        def decide(reading: Reading) -> NDArray[np.int8] | None:
            thought = next(thoughts, None)
            if thought is None:
                return None
            pressures.append(float(reading.pressure[0, 0]))
            sleep(thought)
            return np.array([[1, 0]], np.int8)

        with open_arm(f"serial:{tmp_path / 'arm.port'}") as arm:
            guard = guarded(arm)
            return guard, pressures, list(ControlCycle(guard).run(decide))

    with port(tmp_path / "arm.port"):
        guard, pressures, steps = persistent(moved)
    assert len(steps) == 22
    assert pressures[10] > 40  # it was inflated,
    assert pressures[11] < 5  # and is empty when the controller is back,
    assert pressures[-1] > 40  # and goes on
    assert guard.interventions.vented >= 1
    assert guard.link_counts()["requests"] > 30


def test_what_cannot_be_served_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(UnusableInput, match="cannot be made a link"):
        serve(VirtualArm(seed=1), pytest.fail, link=tmp_path / "mine")
    assert (tmp_path / "mine").read_text() == "mine"
    done = python("-c", START, "arm", "emulate", "emulated:virtual")
    assert done.returncode == 2
    assert "expected a virtual arm" in done.stderr


def test_collecting_and_moving_in_real_time(small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Two minutes, the least that is allowed, would be too long for a test.
    monkeypatch.setattr(sys.modules["pneumarm.transitions.collect"], "FEWEST_TRANSITIONS", 120)
    quick = CollectSettings(actions=60, begin=CollectBegin(deflate=0.3, inflate=0.3, settle=0.3))
    agent = Agent.load(small_run / "agent.safetensors")
    link = tmp_path / "arm.port"
    settings = TransferSettings(episodes=0, test_episodes=1)

    def collected() -> CollectResult:
        with open_arm(f"serial:{link}") as arm, Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
            result = collect(arm, store, 120, settings=quick, watch=watch)
            store.check()
            return result

    def moved() -> dict[str, Any]:
        with open_arm(f"serial:{link}") as arm:
            return transfer_into(tmp_path / "moved", agent, arm, settings, seed=1)

    with port(link):
        with open_arm(f"serial:{link}") as arm:
            watch = Monitor(arm.spec)
        assert persistent(collected).transitions >= 120
        assert watch.findings == []
        result = persistent(moved)
        assert [result[phase]["episodes"] for phase in ("before", "after")] == [1, 1]


def persistent(job: Callable[[], Result], tries: int = 10) -> Result:
    """Do ``job``; again where this computer was too busy for the dead-man of a quarter of a second."""
    for _ in range(tries):
        try:
            return job()
        except ArmFailure as error:
            if "too busy" not in str(error) and "has not answered" not in str(error):
                raise
    raise AssertionError(f"this computer was too busy {tries} times")


@pytest.mark.soak
def test_the_whole_job_in_real_time(tmp_path: Path) -> None:
    with port(tmp_path / "arm.port"):
        transfer = TransferSettings(episodes=12, test_episodes=6)
        settings = replace(SMALL, arm=f"serial:{tmp_path / 'arm.port'}", transitions=2_000, transfer=transfer)
        results = persistent(lambda: Run(tmp_path / "run", settings).do())
    assert results["collect"]["transitions"] >= 2_000
    assert results["transfer"]["after"]["episodes"] == 6
    assert "is no virtual arm" in results["bound"]["missing"]
    assert (tmp_path / "run" / "report.html").exists()
