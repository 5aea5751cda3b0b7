"""A servo in C, compiled for this machine, beside the one in Python: for tests of both."""

import ctypes
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_c import as_c
from pneumarm.learning.servo.quantised import Quantised

Floats = NDArray[np.float64]
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-ffp-contract=off", "-shared", "-fPIC")
CHECKED = ("-fsanitize=undefined", "-fsanitize-undefined-trap-on-error")


class Turn(NamedTuple):
    """What a controller is given in a control step: a reading and what is asked for [counts]."""

    begins: bool
    angle: Floats
    pressure: Floats
    path: Floats


class InC:
    """A servo of C, in single precision or in double."""

    def __init__(
        self,
        agent: ServoAgent,
        folder: Path,
        quantised: Quantised | None = None,
        compiler: str = "cc",
        flags: tuple[str, ...] = (),
        single: bool = False,
    ) -> None:
        source, library = folder / "agent.c", folder / f"agent-{compiler}-{single}-{quantised is not None}.so"
        source.write_text(as_c(agent, quantised))
        kind = ("-DSERVO_REAL=float",) if single else ()
        subprocess.run([compiler, *STRICT, *flags, *kind, str(source), "-o", str(library)], check=True, timeout=120)
        self._library, self._kind = ctypes.CDLL(str(library)), np.float32 if single else np.float64
        pointer = np.ctypeslib.ndpointer(self._kind, flags="C_CONTIGUOUS")
        self._library.servo_act.argtypes = [pointer, pointer, pointer, ctypes.c_bool, pointer]
        self._joints = agent.spec.joints

    def next(self, begins: bool, angle: Floats, pressure: Floats, path: Floats, follows: bool = False) -> Floats:
        """Return the command (joints, 2) after a reading, the first of a movement that ``begins``."""
        if begins:
            self._library.servo_begin()
        command = np.zeros((self._joints, 2), self._kind)
        given = (one.astype(self._kind) for one in (angle, pressure, path))
        self._library.servo_act(*given, follows, command)
        return command.astype(np.float64)

    def command(self, turns: list[Turn], follows: bool) -> Floats:
        """Return the commands (n, joints, 2) of a new movement for each of the ``turns`` that begins one."""
        return np.array([self.next(*turn, follows=follows) for turn in turns])


def turns_of(
    random: np.random.Generator, spec: ArmSpec, range_: Floats, path: int, movements: int, steps: int, follows: bool
) -> list[Turn]:
    """Return readings of joints that swing into goals and stay there, or that follow swings, so many at random."""
    turns, low, span = [], range_[:, 0], range_[:, 1] - range_[:, 0]
    degree, joints = spec.counts_per_degree, spec.joints
    for _ in range(movements):
        goal, begin = low + span * random.random((2, joints))
        turning = 2 * np.pi * random.uniform(0.2, 2.0) * spec.period
        far, left, noise = (
            random.uniform(-1, 1, joints),
            random.uniform(-2, 2, joints),
            random.choice([0.0, 0.05, 0.5]),
        )
        pressure = spec.max_pressure_counts * random.random((joints, 2))
        time = np.arange(-1, steps + path)[:, None]
        asked = goal + (0.2 * span * np.sin(turning * time) if follows else 0.0 * time)
        for step in range(steps):
            swing = (begin - goal) * np.exp(-step / 6.0) * np.cos(step / 3.0) + degree * (left + far * np.sin(step))
            angle = np.round(
                asked[step + 1] + swing * random.choice([0.0, 0.3, 1.0]) + degree * noise * random.normal(size=joints)
            )
            pressure = np.clip(pressure + random.normal(0.0, 3.0, (joints, 2)), 0.0, 1.1 * spec.max_pressure_counts)
            turns.append(Turn(step == 0, angle, np.round(pressure), asked[step : step + path]))
    return turns
