"""Valves left as they are or closed while computing, and a muscle inflated each way."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import guarded
from pneumarm.control import BEGIN
from pneumarm.experiments.experiment import Axis, Experiment, Figures, LaboratorySettings, run_seed
from pneumarm.experiments.there_and_back import (
    DECISIVE,
    TRAINING,
    Prepared,
    open_arm_at,
    prepared,
    train_and_move,
    usual_recipe,
)
from pneumarm.experiments.words import words_of
from pneumarm.progress import Report

OPEN, CLOSED = 1, 2
_PERIODS = 3
_EVERY = 0.001  # s
_REPEATS = 10
_PAUSE = 0.005  # s, of arms that need none: as imagined in figure 2.8


def inflation(
    arm: str, seed: int, pause: float, close: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Inflate the first muscle of ``arm`` from rest for some control periods, and watch it.

    Args:
        arm: its name.
        seed: of the begin state and the sensors' noise.
        pause: time at the end of each period in which the valves are closed if ``close`` [s].
        close: whether they are.

    Returns:
        Time [s], change of the angle of the first joint and of the pressure of the muscle [counts], each (n,).

    """
    with open_arm_at(arm, seed) as found:
        guard, period = guarded(found), found.spec.period
        BEGIN.reach(guard, np.random.default_rng(seed))
        closed = np.zeros((found.spec.joints, 2), np.int8)
        inlet = closed.copy()
        inlet[0, 0] = 1
        first = guard.read()
        time, angle, pressure = [0.0], [first.angle[0]], [first.pressure[0, 0]]
        for number in range(round(_PERIODS * period / _EVERY)):
            within = (number * _EVERY) % period
            guard.set_valves(closed if close and within >= period - pause else inlet)
            found.wait(_EVERY)
            reading = guard.read()
            time.append(reading.time - first.time)
            angle.append(reading.angle[0])
            pressure.append(reading.pressure[0, 0])
    return np.array(time), np.array(angle) - first.angle[0], np.array(pressure) - first.pressure[0, 0]


@dataclass(frozen=True)
class ValvesClosed(Experiment):
    """The whole job with valves left open and closed while computing."""

    name = "valves-closed"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """The two ways."""
        return {OPEN: "left as they are", CLOSED: "closed while computing"}

    @property
    def axis(self) -> Axis:
        """The two ways."""
        return Axis("valves while computing", (0.0, 1.0), ("left", "closed"))

    def settings(self) -> Any:
        """Return the training, and the transitions and movements that a row rests on."""
        return DECISIVE

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> list[Prepared]:
        """Return a simulation of each way."""
        recipes = [usual_recipe(settings, close_while_computing=closed) for closed in (False, True)]
        return [prepared(arm, folder, recipe, settings, progress) for recipe in recipes]

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent and move the arm with it; inflate a muscle and watch it."""
        chosen = material[trial - 1]
        goals = material[0].simulation.goal_range
        found = train_and_move(chosen, TRAINING, run, settings, goals)
        spec = chosen.simulation.spec
        seed = run_seed(settings, run) % 2**31
        pause = spec.latency or _PAUSE
        made = [inflation(chosen.arm, seed + i, pause, trial == CLOSED) for i in range(_REPEATS)]
        time, angle, pressure = np.mean(made, axis=0)
        watched = {
            f"after {1e3 * t:.0f} ms {name}": value
            for name, values in (("angle", angle), ("pressure", pressure))
            for t, value in zip(time, values, strict=True)
        }
        pauses = {"period": spec.period, "pause": pause}
        return {**chosen.figures, **found, **watched, **pauses}
