"""An arm behind a microcontroller: as good as the arm itself, and how well the loop keeps its time.

python -m benchmarks serial

First `pneumarm run` on virtual arms behind an emulated board, in lock-step, beside the same runs on the arms
themselves. Then the control loop in real time over a pseudo-terminal: to the emulated board, and to the real firmware
in its simulated microcontroller where that can be built. Settings come from the environment:

PNEUMARM_SERIAL_SEEDS        of virtual arms and of runs, "1,2,3,4,5"
PNEUMARM_SERIAL_TRANSITIONS  of each run, 20000
PNEUMARM_SERIAL_MOVEMENTS    of each test on the arm, 100
PNEUMARM_SERIAL_SECONDS      of each loop in real time, 10
PNEUMARM_SERIAL_FOLDER       where the runs are kept; a call with the same folder goes on where another ended.
                             runs/serial by default

The interval is Student's, over the seeds, of the difference of rewards; that of success is Wilson's.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from tests.firmware.build import missing
from tests.firmware.figures import pseudo_terminal

from benchmarks import _environment as environment
from benchmarks.minutes import half_width
from pneumarm.arm import ControlCycle, guarded, open_arm
from pneumarm.control import TransferSettings
from pneumarm.errors import ArmFailure
from pneumarm.run import Run, RunSettings
from pneumarm.statistics import rate_estimate

RATES = (30, 100)
"""Of the control loop [Hz]."""


def measure() -> Iterator[str]:
    yield from loops(environment.number("PNEUMARM_SERIAL_SECONDS", 10.0))
    seeds = environment.seeds("PNEUMARM_SERIAL_SEEDS", "1,2,3,4,5")
    transitions = environment.whole("PNEUMARM_SERIAL_TRANSITIONS", 20_000)
    movements = environment.whole("PNEUMARM_SERIAL_MOVEMENTS", 100)
    folder = environment.folder("PNEUMARM_SERIAL_FOLDER", "runs/serial")
    rewards: dict[str, list[float]] = {"virtual": [], "emulated:virtual": []}
    successes = dict.fromkeys(rewards, 0)
    for seed in seeds:
        for kind in rewards:
            place = folder / f"{kind.replace(':', '-')}-{seed}-{transitions}-{movements}"
            began = perf_counter()
            found = Run(place, wanted(kind, seed, transitions, movements)).do()
            before = found["transfer"]["before"]
            rewards[kind].append(before["reward"])
            successes[kind] += round(before["success_rate"] * movements)
            yield (
                f"{kind}:seed={seed}: reward {before['reward']:.2f}, success {before['success_rate']:.3f}, "
                f"missed deadlines {found['collect']['missed_deadlines']}, {perf_counter() - began:.0f} s"
            )
    for kind, reward in rewards.items():
        rate = rate_estimate(np.arange(len(seeds) * movements) < successes[kind])
        yield (
            f"{kind}: reward {np.mean(reward):.2f} ({min(reward):.2f} to {max(reward):.2f} over seeds), "
            f"success {rate.mean:.4f} ({rate.low:.4f} to {rate.high:.4f})"
        )
    difference = np.subtract(rewards["emulated:virtual"], rewards["virtual"])
    yield f"behind the board less without: {difference.mean():+.2f} ± {half_width(difference):.2f}"


def wanted(kind: str, seed: int, transitions: int, movements: int) -> RunSettings:
    """Return the settings of a run whose agent is tested on the arm and does not adapt."""
    transfer = TransferSettings(episodes=0, test_episodes=movements)
    return RunSettings(
        arm=f"{kind}:seed={seed}", seed=seed, transitions=transitions, test_episodes=500, bound_episodes=0,
        transfer=transfer,
    )  # fmt: skip


def loops(seconds: float) -> Iterator[str]:
    """Yield how the loop keeps its time over pseudo-terminals."""
    with emulated_port() as path:
        for rate in RATES:
            yield f"emulated board, {looped(path, rate, seconds)}"
    if lacks := missing():
        yield f"the real firmware is left out: {lacks}"
        return
    with pseudo_terminal("virtual:seed=1") as path:
        for rate in RATES:
            yield f"real firmware, {looped(path, rate, seconds)}"


@contextmanager
def emulated_port() -> Iterator[str]:
    """Give the path of the port of an emulated board, in a process of its own and in real time."""
    start = "from pneumarm.cli import main; main()"
    with TemporaryDirectory() as folder:
        path = str(Path(folder) / "port")
        command = [sys.executable, "-c", start, "arm", "emulate", "virtual:seed=1", "--link", path]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            try:
                assert process.stdout is not None
                process.stdout.readline()
                yield path
            finally:
                process.terminate()


def looped(path: str, rate: int, seconds: float) -> str:
    """Return what a loop of so many turns a second measures, with other valves in every turn."""
    random = np.random.default_rng(0)
    round_trips, began, read_at, missed = [], [], [], 0
    with open_arm(f"serial:{path}") as arm:
        arm.spec = replace(arm.spec, period=1 / rate)
        cycle, turns = ControlCycle(guarded(arm)), iter(range(round(rate * seconds)))

        def decide(reading: Any) -> Any:
            if next(turns, None) is None:
                return None
            began.append(perf_counter())
            arm.read()
            round_trips.append(1e3 * (perf_counter() - began[-1]))
            return random.integers(-1, 2, (1, 2))

        ended = ""
        try:
            for step in cycle.run(decide):
                read_at.append(step.reading.time)
                missed = cycle.missed_deadlines
        except ArmFailure as error:  # the dead-man, where this computer has other things to do
            ended = f"; ended after {len(began)} turns: {error}"
        counts = arm.link.counts  # type: ignore[attr-defined]
    if len(read_at) < rate:
        return f"{rate} Hz: given up in its first second; load {os.getloadavg()[0]:.1f}{ended}"
    late = np.abs(1e3 * (np.diff(began) - 1 / rate))
    middle, last = np.quantile(late, [0.5, 0.99])
    median, p99 = np.quantile(round_trips, [0.5, 0.99])
    at = np.array(read_at) - read_at[0]
    early, later = (1e3 * np.median(half) for half in np.array_split(at - np.rint(at * rate) / rate, 2))
    ticks = missed + len(at)
    return (
        f"{rate} Hz for {seconds:g} s: {(ticks - 1) / at[-1]:.2f} ticks/s, drift {later - early:+.2f} ms, "
        f"missed deadlines {missed}, period off by {middle:.2f} ms at "
        f"p50, {last:.2f} at p99; round trip {median:.2f} ms at p50, {p99:.2f} at p99; "
        f"{counts.retries} of {counts.requests} requests sent again; load {os.getloadavg()[0]:.1f}{ended}"
    )
