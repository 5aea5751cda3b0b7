"""The later stages of a run, rehearsed on made-up data in a process beside it, so that their kernels are compiled.

On a fresh machine most of a first run is compiling. The arm's moving compiles kernels of its own meanwhile; what is
compiled here goes to the same cache on the disk (:mod:`pneumarm.kernels`), and the run takes it from there. Nothing
else comes of a rehearsal: a run without one gives the same results, later.
"""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic
from typing import IO, Self

import msgspec
import numpy as np

from pneumarm.arm import ArmSpec, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.console import peak_memory
from pneumarm.control import Monitor, TransferSettings, transfer
from pneumarm.kernels import CACHE_FOLDER
from pneumarm.learning import ServoSettings, test, train
from pneumarm.leaving import leave_by_exceptions
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.planning.bound import BoundSettings, measure_bound
from pneumarm.simulation import FitSettings, SimulationArm, fit_store
from pneumarm.task import begin_states
from pneumarm.transitions import FEWEST_TRANSITIONS, Store
from pneumarm.transitions.rows import Recorded

_SEQUENCE = 100  # rows of a made-up sequence
_PLANNED = 4  # movements
_PATIENCE = 600.0
"""For so long [s] a stage may be rehearsed before it is taken to hang: eight times what the longest takes (80 s on a
machine of 2 cores)."""
_ENDING = 10.0
"""For so long [s] a process that was killed is waited for; the system keeps one that hangs in a disk."""


def installed(package: Path) -> str:
    """Return a name for the sources below ``package`` where they lie and as old as they are.

    Numba knows a source by its place and its time, so the same sources in another folder are compiled again.
    """
    newest = max(path.stat().st_mtime_ns for path in package.rglob("*.py"))
    return hashlib.sha256(f"{package.resolve()} {newest}".encode()).hexdigest()[:16]


_REHEARSED = CACHE_FOLDER / f"rehearsed-{installed(Path(__file__).parent)}"


@dataclass(frozen=True)
class Piece:
    """What is rehearsed."""

    spec: ArmSpec
    fit: FitSettings
    servo: ServoSettings
    physics: str | None
    """Name of the virtual arm whose physics will be planned with."""


class Rehearsal:
    """A rehearsal in a process of its own, where none has been before; ended with the block it is in.

    A process that is silent for ``patience`` [s] is ended when it is waited for, and the run compiles for itself.
    """

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._process: subprocess.Popen[str] | None = None
        self._said = SimpleQueue[tuple[str, float]]()
        self._heard = 0.0
        self._done: set[str] = set()
        self.memory = 0.0
        """The most that the process has held [MB]; told when it has ended."""

    def begin(self, piece: Piece) -> None:
        """Begin, unless all of it is in the kernel cache."""
        if _REHEARSED.exists() or self._process is not None:
            return
        command = [sys.executable, "-m", "pneumarm.rehearsal"]
        errors = None if os.environ.get("PNEUMARM_DEBUG") else subprocess.DEVNULL  # it is no part of the run
        with suppress(OSError):
            self._process = process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
            )
            assert process.stdin is not None
            assert process.stdout is not None
            self._heard = monotonic()
            # Daemonic, for a pipe may stay open where its process has gone.
            Thread(target=_listen, args=(process.stdout, self._said), name="rehearsal", daemon=True).start()
            process.stdin.write(json.dumps(asdict(piece)))
            process.stdin.close()

    def wait_for(self, stage: str) -> None:
        """Return when the kernels of ``stage`` are in the cache, or will not be."""
        while self._process is not None and stage not in self._done:
            try:
                line, self._heard = self._said.get(timeout=max(self._heard + self._patience - monotonic(), 0.0))
            except Empty:
                with suppress(OSError):
                    _REHEARSED.touch()  # or it would hang in every run
                line = ""
            if not line:
                self._end()
            self._done.add(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_ENDING)
            self.memory = peak_memory(children=True)


def _listen(lines: IO[str], said: SimpleQueue[tuple[str, float]]) -> None:
    """Put each of ``lines`` with its time, and at their end an empty one, into ``said``."""
    with lines:
        for line in lines:
            said.put((line.strip(), monotonic()))
    said.put(("", monotonic()))


def rehearse(piece: Piece, folder: Path) -> Iterator[str]:
    """Do each stage with as little as possible in ``folder``, and name those whose kernels are compiled."""
    with Store.create(folder / "made-up.db", piece.spec) as store:
        store.append_all(_made_up(piece.spec))
        simulation = fit_store(store, replace(piece.fit, epochs=1)).simulation
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
        yield "simulation"
        agent = train(simulation, begin, replace(piece.servo, agents=1, updates=1, validation_movements=8)).agent
        yield "training"
        test(agent, simulation, begin, 8)
        yield "test"
        monitor = Monitor(piece.spec, simulation, mode="warn")
        with SimulationArm(simulation) as arm:
            transfer(agent, arm, store, TransferSettings(episodes=1, test_episodes=1), watch=monitor)
            yield "transfer"
            moves = MoveTrialSettings(goals=1, hold=0.2, frequencies=(1.0,), seconds=0.5)
            try_moving(arm, agent.controller(), simulation.goal_range, moves)
            yield "settle"
    if piece.physics is not None:
        with open_arm(piece.physics) as arm:
            assert isinstance(arm, VirtualArm)
            low, high = simulation.goal_range.T
            # To a goal that cannot be reached no plan is sought.
            middle = np.stack([0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high], axis=1)
            measure_bound(arm, middle, BoundSettings(episodes=_PLANNED))
    _REHEARSED.touch()
    yield "bound"


def _made_up(spec: ArmSpec) -> Iterator[Recorded]:
    """Return a recording, just long enough to be fitted, of an arm that nobody has seen."""
    random = np.random.default_rng(0)
    (low, high), n = spec.angle_range, _SEQUENCE
    for number in range(2 * FEWEST_TRANSITIONS // n):
        command = random.integers(-1, 2, (n, spec.joints, 2)).astype(np.float64)
        command[-1] = np.nan
        yield Recorded(
            time=(number * 2.0 * n + np.arange(n, dtype=np.float64)) * spec.period,
            angle=random.uniform(low, high, (n, spec.joints)),
            pressure=random.uniform(0, spec.max_pressure_counts, (n, spec.joints, 2)),
            command=command,
            step=np.arange(n),
            kind="pulses",
            at_rest=True,
            measured={name: random.uniform(-1, 1, n) for name in spec.further},
        )


def main() -> None:
    """Rehearse the piece on the standard input, and write the stages that are done."""
    leave_by_exceptions()  # also when the run that it is for has ended
    piece = msgspec.convert(json.load(sys.stdin), Piece)
    with TemporaryDirectory() as folder:
        for stage in rehearse(piece, Path(folder)):
            print(stage, flush=True)


if __name__ == "__main__":
    main()
