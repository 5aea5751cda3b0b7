"""The later stages of a run, rehearsed on made-up data in processes beside it, so that their kernels are compiled.

On a fresh machine most of a first run is compiling. The arm's moving compiles kernels of its own meanwhile; what is
compiled here goes to the same cache on the disk (:mod:`pneumarm.kernels`), and the run takes it from there. Nothing
else comes of a rehearsal: a run without one gives the same results, later.

What learns and what moves the arm afterwards are rehearsed beside each other, once there is a simulation for both.
"""

import gc
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
from threading import Lock, Thread
from time import monotonic
from typing import Self

import msgspec
import numpy as np

from pneumarm.arm import ArmSpec, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.console import peak_memory
from pneumarm.control import Monitor, TransferSettings, transfer
from pneumarm.kernels import CACHE_FOLDER
from pneumarm.learning import ServoSettings, test, train
from pneumarm.learning.servo.training import ServoLearner
from pneumarm.leaving import leave_by_exceptions
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.planning.bound import BoundSettings, measure_bound
from pneumarm.simulation import FitSettings, Simulation, SimulationArm, fit_store
from pneumarm.task import BeginStates, begin_states
from pneumarm.transitions import Store
from pneumarm.transitions.rows import Recorded
from pneumarm.transitions.watch import warm_up

_ROWS, _SEQUENCE = 4_000, 100  # made up, and of a sequence of them
_PLANNED = 4  # movements
_NICE = 4
"""So that the run, which moves an arm in time, has one of two cores for itself with two processes beside it.

More would starve them on a computer that has other things to do, while the run waits for them."""
_OBJECTS = 200_000
"""So many new ones make Python look for garbage there: Numba keeps nearly all that it makes while it compiles, and
with the usual 700 looking took a twelfth of the time."""
_PATIENCE = 600.0
"""For so long [s] a stage may be rehearsed before it is taken to hang: eight times what the longest takes (80 s on a
machine of 2 cores)."""
_ENDING = 10.0
"""For so long [s] a process that was killed is waited for; the system keeps one that hangs in a disk."""


PARTS = {"learning": ("simulation", "training", "test"), "moving": ("transfer", "settle", "bound")}
"""The stages that a process rehearses, in their order; ``moving`` begins when ``simulation`` has been."""


_REHEARSED = CACHE_FOLDER / "rehearsed"
"""How the names of files begin that say which parts have been."""


@dataclass(frozen=True)
class Piece:
    """What is rehearsed."""

    spec: ArmSpec
    fit: FitSettings
    servo: ServoSettings
    physics: str | None
    """Name of the virtual arm whose physics will be planned with."""


class Rehearsal:
    """A rehearsal of the parts that have not been before, in a process each; ended with the block it is in.

    Processes that are silent for ``patience`` [s] are ended when they are waited for; the run compiles for itself.
    """

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._starting = Lock()
        self._ended = False
        self._said = SimpleQueue[tuple[str, str, float]]()
        self._heard = 0.0
        self._coming: set[str] = set()
        """Stages that are not rehearsed yet, but will be."""
        self.memory = 0.0
        """The most that a process has held [MB]; told when it has ended."""

    def begin(self, piece: Piece) -> None:
        """Begin, unless all of it is in the kernel cache."""
        if self._processes:
            return
        self._heard = monotonic()
        coming = [part for part in PARTS if not _marker(part).exists()]
        self._coming = {stage for part in coming for stage in PARTS[part]}
        if coming:
            self._start(coming[0], piece)

    def _start(self, part: str, piece: Piece) -> None:
        command = [sys.executable, "-P", "-m", "pneumarm.rehearsal", part]
        errors = None if os.environ.get("PNEUMARM_DEBUG") else subprocess.DEVNULL  # it is no part of the run
        with self._starting, suppress(OSError):
            if self._ended:
                return
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
            )
            self._processes[part] = process
            # Daemonic, for a pipe may stay open where its process has gone.
            Thread(target=self._listen, args=(part, piece), name=f"rehearsal, {part}", daemon=True).start()
            assert process.stdin is not None
            process.stdin.write(json.dumps(asdict(piece)))
            process.stdin.close()
            return
        for ended in PARTS:  # what is not running will not
            if ended == part or ended not in self._processes:
                self._said.put((ended, "", monotonic()))

    def _listen(self, part: str, piece: Piece) -> None:
        """Put what the process of ``part`` says, with its time, and at the end nothing, where it is waited for."""
        lines = self._processes[part].stdout
        assert lines is not None
        rest = ["moving"] if part == "learning" and not _marker("moving").exists() else []
        with lines:
            for line in lines:
                self._said.put((part, line.strip(), monotonic()))
                if rest:
                    self._start(rest.pop(), piece)
        for ended in (part, *rest):
            self._said.put((ended, "", monotonic()))

    def wait_for(self, stage: str) -> None:
        """Return when the kernels of ``stage`` are in the cache, or will not be."""
        while stage in self._coming:
            try:
                part, line, self._heard = self._said.get(timeout=max(self._heard + self._patience - monotonic(), 0.0))
            except Empty:
                for part in self._processes:
                    with suppress(OSError):
                        _marker(part).touch()  # or it would hang in every run
                self._end()
                return
            self._coming -= {line} if line else set(PARTS[part])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        with self._starting:
            self._ended = True
            self._coming.clear()
            for process in self._processes.values():
                process.kill()
            for process in self._processes.values():
                with suppress(subprocess.TimeoutExpired):
                    process.wait(_ENDING)
        if self._processes:
            self.memory = peak_memory(children=True)


def _marker(part: str) -> Path:
    return _REHEARSED.with_name(f"{_REHEARSED.name}-{part}")


def rehearse(piece: Piece, part: str, folder: Path) -> Iterator[str]:
    """Do the stages of ``part`` with as little as possible in ``folder``; name those whose kernels are compiled."""
    with Store.create(folder / "made-up.db", piece.spec) as store:
        store.append_all(_made_up(piece.spec))
        layers = piece.fit.layers or (1 if piece.spec.joints == 1 else 2)  # as a longer recording will have
        simulation = fit_store(store, replace(piece.fit, epochs=1, layers=layers)).simulation
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
        yield from (_learn if part == "learning" else _move)(piece, simulation, begin, store)
    _marker(part).touch()


def _learn(piece: Piece, simulation: Simulation, begin: BeginStates, _: Store) -> Iterator[str]:
    yield "simulation"
    settings = replace(piece.servo, agents=1, updates=1, validation_movements=8)
    ServoLearner(simulation, begin, settings, 0, 0).validate(8)  # first what those who move need, too
    agent = train(simulation, begin, settings).agent
    yield "training"
    test(agent, simulation, begin, 8)
    yield "test"


def _move(piece: Piece, simulation: Simulation, begin: BeginStates, store: Store) -> Iterator[str]:
    agent = ServoLearner(simulation, begin, replace(piece.servo, coarse=0.0), 0, 0).agent()  # it has learned nothing
    monitor = Monitor(piece.spec, simulation, mode="warn")
    warm_up(monitor, piece.spec)  # first, for what an agent needs besides is compiled by those who learn meanwhile
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
    yield "bound"


def _made_up(spec: ArmSpec) -> Iterator[Recorded]:
    """Return a recording, just long enough to be fitted, of an arm that nobody has seen."""
    random = np.random.default_rng(0)
    (low, high), n = spec.angle_range, _SEQUENCE
    for number in range(_ROWS // n):
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
    """Rehearse a part of the piece on the standard input, and write the stages that are done."""
    leave_by_exceptions()  # also when the run that it is for has ended
    gc.set_threshold(_OBJECTS)
    if hasattr(os, "nice"):
        os.nice(_NICE)
    piece = msgspec.convert(json.load(sys.stdin), Piece)
    with TemporaryDirectory() as folder:
        for stage in rehearse(piece, sys.argv[1], Path(folder)):
            print(stage, flush=True)


if __name__ == "__main__":
    main()
