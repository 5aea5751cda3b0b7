"""The later stages of a run, rehearsed on made-up data in processes beside it, so that their kernels are compiled.

On a fresh machine most of a first run is compiling. The arm's moving compiles kernels of its own meanwhile; what is
compiled here goes to the same cache on the disk (:mod:`pneumarm.kernels`), and the run takes it from there. Nothing
else comes of a rehearsal: a run without one gives the same results, later.

What learns and what moves the arm afterwards are rehearsed beside each other. The second begins with plans in the
true physics of a virtual arm, which need no simulation, and goes on once the fit that both need is compiled.
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
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Self

import msgspec
import numpy as np

from pneumarm.arm import ArmSpec, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.bound.reaching import BoundSettings, measure_bound
from pneumarm.console import peak_memory
from pneumarm.control import Monitor, TransferSettings, transfer
from pneumarm.kernels import CACHE_FOLDER
from pneumarm.learning import ServoSettings, test, train
from pneumarm.learning.servo.agent import ServoLearner
from pneumarm.leaving import signals_as_exceptions
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.simulation import FitSettings, SimulationArm, fit_store
from pneumarm.task import begin_states
from pneumarm.transitions import Store
from pneumarm.transitions.rows import Recorded
from pneumarm.transitions.watch import warm_up_watch

_ROWS, _SEQUENCE = 4_000, 100  # made up, and of a sequence of them
_PLANNED = 4  # movements
_NICE = 4
"""So that the run, which moves an arm in time, comes first. More would starve the rehearsal on a computer that has
other things to do, while the run waits for it."""
_OBJECTS = 200_000
"""So many new ones make Python look for garbage there: Numba keeps nearly all that it makes while it compiles, and
with the usual 700 looking took a twelfth of the time."""
_PATIENCE = 600.0
"""For so long [s] a stage is waited for before its rehearsal is taken to hang: eight times what the longest takes (80
s on a machine of 2 cores)."""
_LOOK = 0.1
"""Every so often [s] the run looks whether the stage that it waits for has been rehearsed."""
_ENDING = 10.0
"""For so long [s] a process that was killed is waited for; the system keeps one that hangs in a disk."""

PARTS = {"learning": ("simulation", "training", "test"), "moving": ("bound", "transfer", "settle")}
"""The stages that a process rehearses, in their order."""


_MARKER = CACHE_FOLDER / "rehearsed"
"""The file that names the stages whose kernels are in the cache."""


@dataclass(frozen=True)
class WarmUpJob:
    """What is rehearsed."""

    spec: ArmSpec
    fit: FitSettings
    servo: ServoSettings
    physics: str | None
    """Name of the virtual arm whose physics will be planned with."""


class Rehearsal:
    """A rehearsal of the parts that have not been before, each in a process; ended with the block it is in.

    It is ended when a stage is waited for in vain for ``patience`` [s]; the run compiles for itself then.
    """

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self.memory = 0.0
        """The most that a process has held [MB]; told when it has ended."""

    def begin(self, job: WarmUpJob) -> None:
        """Begin with the parts that are not in the kernel cache."""
        nothing = subprocess.DEVNULL
        errors = None if os.environ.get("PNEUMARM_DEBUG") else nothing  # it is no part of the run
        for part, stages in PARTS.items():
            if part not in self._processes and not _rehearsed() >= {*stages}:
                command = [sys.executable, "-P", "-m", "pneumarm.rehearsal", part, json.dumps(asdict(job))]
                with suppress(OSError):
                    self._processes[part] = subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=errors)

    def wait_for(self, stage: str) -> None:
        """Return when the kernels of ``stage`` are in the cache, or will not be."""
        deadline = monotonic() + self._patience
        process = next((self._processes.get(part) for part, stages in PARTS.items() if stage in stages), None)
        while process is not None and process.poll() is None and stage not in _rehearsed():
            if monotonic() > deadline:
                with suppress(OSError):
                    _note(*PARTS["learning"], *PARTS["moving"])  # or it would hang in every run
                self._end()
            else:
                sleep(_LOOK)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        for process in self._processes.values():
            process.kill()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_ENDING)
        if self._processes:
            self.memory = peak_memory(children=True)


def _rehearsed() -> set[str]:
    """Return the stages whose kernels are in the cache."""
    try:
        return {*_MARKER.read_text().split()}
    except OSError:
        return set()


def _note(*stages: str) -> None:
    with open(_MARKER, "a") as marker:
        marker.writelines(f"{stage}\n" for stage in stages)


def warm_up_stages(job: WarmUpJob, part: str, folder: Path) -> Iterator[str]:
    """Do the stages of ``part`` with as little as possible in ``folder``; name those whose kernels are compiled."""
    if part == "moving":
        if job.physics is not None:
            _plan(job.physics)
        yield "bound"
        deadline = monotonic() + _PATIENCE
        while "simulation" not in _rehearsed() and monotonic() < deadline:
            sleep(_LOOK)
    with Store.create(folder / "made-up.db", job.spec) as store:
        store.append_all(_made_up(job.spec))
        layers = job.fit.layers or (1 if job.spec.joints == 1 else 2)  # as a longer recording will have
        simulation = fit_store(store, replace(job.fit, epochs=1, layers=layers)).simulation
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
        if part == "learning":
            yield "simulation"
            agent = train(simulation, begin, replace(job.servo, agents=1, updates=1, validation_movements=8)).agent
            yield "training"
            test(agent, simulation, begin, 8)
            yield "test"
            return
        agent = ServoLearner(simulation, begin, replace(job.servo, coarse=0.0), 0, 0).agent()  # which learned nothing
        monitor = Monitor(job.spec, simulation, mode="warn")
        warm_up_watch(monitor, job.spec)
        with SimulationArm(simulation) as arm:
            transfer(agent, arm, store, TransferSettings(episodes=1, test_episodes=1), watch=monitor)
            yield "transfer"
            moves = MoveTrialSettings(goals=1, hold=0.2, frequencies=(1.0,), seconds=0.5)
            try_moving(arm, agent.controller(), simulation.goal_range, moves)
            yield "settle"


def _plan(arm: str) -> None:
    """Plan some movements of a virtual ``arm``, near its middle, for to goals out of reach no plan is sought."""
    with open_arm(arm) as physics:
        assert isinstance(physics, VirtualArm)
        low, high = physics.spec.angle_range
        middle = np.tile([0.55 * low + 0.45 * high, 0.45 * low + 0.55 * high], (physics.spec.joints, 1))
        measure_bound(physics, middle, BoundSettings(episodes=_PLANNED))


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
    """Rehearse a part of the job in the arguments, and note the stages that are done."""
    signals_as_exceptions()  # also when the run that it is for has ended
    gc.set_threshold(_OBJECTS)
    if hasattr(os, "nice"):
        os.nice(_NICE)
    part, job = sys.argv[1], msgspec.json.decode(sys.argv[2], type=WarmUpJob)
    with TemporaryDirectory() as folder:
        for stage in warm_up_stages(job, part, Path(folder)):
            _note(stage)


if __name__ == "__main__":
    main()
