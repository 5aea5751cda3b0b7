"""A run with an error: the arm is checked, it collects, a simulation is fitted, and the monitor looks at it all.

What the pictures show is the simulation that was fitted *with* the error, on sequences that it was not fitted to, as
in the thesis, whose authors had no other. The monitor judges by the simulation of the arm *before* the error.
"""

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, Reading
from pneumarm.checkup import Checkup, CheckupSettings, diagnose, measure
from pneumarm.control.monitor import Monitor
from pneumarm.settings import PositiveInt, Settings
from pneumarm.simulation import SINGLE_STEPS, Simulation, fit_store
from pneumarm.transitions import FEWEST_TRANSITIONS, WHOLE_PERIODS, Store, collect
from pneumarm.transitions.choice import join_transitions
from pneumarm.transitions.rows import Rows

Array = NDArray[np.float64]

CLOSELY = CheckupSettings(step=0.001)
"""A check-up that looks as closely as the thesis' oscilloscope."""


@dataclass(frozen=True)
class RunsSettings(Settings):
    """How much is done for each picture."""

    transitions: Annotated[int, Meta(ge=FEWEST_TRANSITIONS)] = 10_000
    """Transitions that each run collects: six minutes on the arm."""
    epochs: PositiveInt = 20
    """Epochs of each fit at most."""


@dataclass(frozen=True)
class Case:
    """What was seen of an arm, with an error or without."""

    name: str
    """What it is called beside the other cases."""
    spec: ArmSpec
    simulation: Simulation
    """Fitted to what this run collected."""
    angle: Array
    """Angle before each transition that was kept out of the fit, shape (n, joints) [counts]."""
    observed: Array
    """Change in each (thesis eq. 3.4), shape (n, joints, 4) [sensor units]."""
    simulated: Array
    """Change that the simulation says (thesis eq. 3.3), shape (n, joints, 4) [sensor units]."""
    monitor: tuple[str, ...]
    """What the monitor found, in words; by rules where no simulation was there before."""
    checkup: Checkup | None = None
    """None where none was made."""

    @property
    def residue(self) -> Array:
        """What the simulation says too much (thesis eq. 3.2), shape (n, joints, 4) [sensor units]."""
        return self.simulated - self.observed

    @property
    def complaints(self) -> tuple[str, ...]:
        """What the check-up finds wrong, in words."""
        return () if self.checkup is None else tuple(str(finding) for finding in diagnose(self.checkup))


def run(
    name: str,
    arm: Arm,
    settings: RunsSettings,
    *,
    seed: int,
    before: Simulation | None = None,
    checked: bool = True,
) -> Case:
    """Check ``arm``, let it collect, fit, and have the monitor look at what was recorded.

    Args:
        name: of the case.
        arm: with its error, if any.
        settings: how much is done.
        seed: of the actions and of the fit.
        before: the simulation of the arm before the error, for the monitor.
        checked: whether a check-up is made.

    """
    checkup = measure(arm, CLOSELY) if checked else None
    with tempfile.TemporaryDirectory() as folder, Store.for_arm(Path(folder) / "db", arm.spec) as store:
        collect(arm, store, settings.transitions, seed, settings=WHOLE_PERIODS)
        fitted = fit_store(store, replace(SINGLE_STEPS, epochs=settings.epochs, seed=seed))
        apart = join_transitions(list(fitted.filtered.stream("held-out")))
        found = findings(store.blocks(), Monitor(arm.spec, before))
    shape = (-1, arm.spec.joints, 4)
    now = apart.observation.reshape(shape).astype(np.float64)
    return Case(
        name=name,
        spec=arm.spec,
        simulation=fitted.simulation,
        angle=now[..., 0],
        observed=apart.target.reshape(shape) - now,
        simulated=fitted.simulation.predict(apart.inputs).reshape(shape) - now,
        monitor=found,
        checkup=checkup,
    )


def findings(blocks: Iterable[Rows], monitor: Monitor) -> tuple[str, ...]:
    """Show ``monitor`` the recorded ``blocks``, and return what it says: each thing once, when it was found first."""
    for rows in blocks:
        for k in range(len(rows)):
            if k == 0 or rows.sequence[k] != rows.sequence[k - 1]:
                monitor.begin(at_rest=bool(rows.at_rest[k]))
            ended = np.isnan(rows.command[k]).any()
            valves = None if ended else rows.command[k].astype(np.int8)
            monitor.see(Reading(float(rows.time[k]), rows.angle[k], rows.pressure[k]), valves)
    first: dict[tuple[str, int | None, int | None], str] = {}
    for one in monitor.findings:
        first.setdefault((one.kind, one.joint, one.muscle), f"{replace(one, until=None)}.")
    return tuple(first.values())
