"""How soon the monitor finds faults, whether it names them rightly, and how often it cries wolf.

Every case is an arm of its own draw, a muscle and a moment drawn at random, while the arm is collecting. Times are
watched time (the arm is not watched while it is brought to a begin state): since the fault began, and for valves since
the first reading at which what was told and what was done differed in a muscle where it makes a difference. Healthy
hours are collecting from a cold morning on, and movements by a policy before, while and after it adapts. Settings
come from the environment:

PNEUMARM_FAULTS_ARMS     seeds of virtual arms, 1 to 20 by default; the judging arms are 1001 to 1010
PNEUMARM_FAULTS_CASES    cases of each fault, 40
PNEUMARM_FAULTS_HOURS    healthy hours of collecting, 10; and a fifth of that of movements
PNEUMARM_FAULTS_FOLDER   where stores, simulations and agents are kept; a temporary folder by default
"""

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneumarm.arm import ControlCycle, Step, guarded
from pneumarm.arm.virtual import (
    DeadPotentiometer,
    Fault,
    FrozenPotentiometer,
    Leak,
    StuckValve,
    SupplyLoss,
    SwappedMuscles,
    SwappedValves,
    VirtualArm,
    draw_parameters,
)
from pneumarm.arm.virtual.parameters import BAR
from pneumarm.control import TransferSettings, transfer
from pneumarm.control.leaks import LeakTest, leak_test
from pneumarm.control.monitor import Finding, Monitor
from pneumarm.learning import load_agent, train
from pneumarm.learning.begin import begin_states
from pneumarm.simulation import Simulation
from pneumarm.simulation.fit import FitSettings, fit_store
from pneumarm.transitions import CollectSettings, Store, collect
from pneumarm.transitions.collect import random_actions

TRANSITIONS = 20_000
"""Transitions that each arm's simulation is fitted to."""
WARM_UP = 20.0
"""Healthy watched time before a fault [s]; then up to as long again."""
PATIENCE = 60.0
"""Watched time after which a fault counts as not found [s]."""
_LITTLE_AIR, _MUCH_AIR = 0.1 * BAR, 0.7 * BAR  # an outlet makes a difference above, an inlet below


@dataclass(frozen=True)
class Kind:
    """A kind of case."""

    name: str
    make: Callable[[int, float], Fault]
    """Makes the fault of muscle 1 or 2 and a begin."""
    found_as: tuple[str, ...]
    """How it may rightly be called."""


KINDS = (
    Kind("inlet stuck closed", lambda m, t: StuckValve(muscle=m, begin=t), ("stuck-valve",)),
    Kind("inlet stuck open", lambda m, t: StuckValve(muscle=m, position="open", begin=t), ("stuck-valve",)),
    Kind("outlet stuck closed", lambda m, t: StuckValve(muscle=m, valve="outlet", begin=t), ("stuck-valve",)),
    Kind(
        "outlet stuck open",
        lambda m, t: StuckValve(muscle=m, valve="outlet", position="open", begin=t),
        ("stuck-valve",),
    ),
    Kind("inlet and outlet swapped", lambda m, t: SwappedValves(muscle=m, begin=t), ("swapped-valves",)),
    Kind("muscles swapped", lambda m, t: SwappedMuscles(muscle=m, begin=t), ("swapped-muscles",)),
    Kind("supply lost", lambda m, t: SupplyLoss(begin=t), ("low-supply",)),
    Kind("supply halved", lambda m, t: SupplyLoss(to=0.5, begin=t), ("low-supply",)),
    Kind("potentiometer dead", lambda m, t: DeadPotentiometer(begin=t), ("dead-potentiometer",)),
    Kind("potentiometer frozen", lambda m, t: FrozenPotentiometer(begin=t), ("frozen-potentiometer",)),
    Kind("torn hose (2000 x leak)", lambda m, t: Leak(muscle=m, factor=2000, begin=t), ("leak", "stuck-valve")),
)


@dataclass(frozen=True)
class Case:
    """What came of a case."""

    found: Finding | None
    """The first finding after the fault began."""
    since_begin: float
    """Watched time from the begin of the fault until it was found [s]."""
    since_contradiction: float
    """... from the first contradiction."""
    early: int
    """Findings before the fault began."""


def watched_steps(arm: VirtualArm, monitor: Monitor, seed: int) -> Iterator[Step]:
    """Collect for ever, as :func:`pneumarm.transitions.collect` does, and yield the turns after ``monitor`` saw them."""
    settings, random, guard = CollectSettings(), np.random.default_rng([seed, 7]), guarded(arm)
    while True:
        settings.begin.reach(guard, random)
        _, actor = random_actions(arm.spec.joints, settings, random)
        actor.reset(np.zeros(arm.spec.joints))
        left = iter(range(settings.actions))
        monitor.begin(at_rest=True)
        for step in ControlCycle(guard).run(
            lambda reading, left=left, actor=actor: None if next(left, None) is None else actor.act(reading)  # type: ignore[misc]
        ):
            monitor.see(step.reading, step.valves)
            yield step


def played(kind: Kind, arm_seed: int, seed: int, simulation: Simulation | None, patience: float = PATIENCE) -> Case:
    """Let the fault happen to a healthy arm, and wait until it is found."""
    random = np.random.default_rng([seed, arm_seed])
    muscle, warm = int(random.integers(1, 3)), WARM_UP * (1 + random.random())
    arm = VirtualArm(draw_parameters(arm_seed), seed=seed)
    monitor = Monitor(arm.spec, simulation)
    period = arm.spec.period
    fault: Fault | None = None
    begin = contradicted = None
    early = passed = 0.0
    for step in watched_steps(arm, monitor, seed):
        passed += period
        if fault is None:
            if passed >= warm and step.valves is not None:
                early = len(monitor.findings)
                # Between two readings, so that the first reading that can tell of it is the next one.
                fault = kind.make(muscle, arm.time + float(random.random()) * period)
                arm.faults = (fault,)
                begin = passed
            continue
        if contradicted is None and _contradicts(arm, fault, step):
            contradicted = passed
        if len(monitor.findings) > early:
            since = passed - (begin if contradicted is None else contradicted)
            return Case(monitor.findings[int(early)], passed - begin, since, int(early))
        if passed - begin > patience:
            return Case(None, float("inf"), float("inf"), int(early))
    raise AssertionError("collecting never ends")


def _contradicts(arm: VirtualArm, fault: Fault, step: Step) -> bool:
    """Whether what the valves were told and what they do differ where it makes a difference."""
    if step.valves is None:
        return False
    sides = arm.records.muscles["open"]
    pressure = arm.pressure
    told = np.stack([step.valves == 1, step.valves == -1], axis=-1)
    done = sides.astype(bool)
    differs = (told != done) & (arm.records.muscles["pending"] == 0)
    if isinstance(fault, SupplyLoss):
        return bool((done[..., 0] & (pressure < _MUCH_AIR)).any())
    return bool((differs[..., 0] & (pressure < _MUCH_AIR)).any() or (differs[..., 1] & (pressure > _LITTLE_AIR)).any())
