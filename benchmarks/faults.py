"""How soon the monitor finds faults, whether it names them rightly, and how often it cries wolf.

Every case is an arm of its own draw, a muscle and a moment drawn at random, while the arm is collecting. Times are
watched time (the arm is not watched while it is brought to a begin state): since the fault began, and for valves
since the first reading at which what was told and what was done differed in a muscle where it makes a difference.
Healthy hours are collecting from a cold morning on, and movements by a policy before, while and after it adapts.
Settings come from the environment:

PNEUMARM_FAULTS_ARMS     seeds of virtual arms, 1 to 20 by default; the judging arms are 1001 to 1010
PNEUMARM_FAULTS_CASES    cases of each fault, 40
PNEUMARM_FAULTS_HOURS    healthy hours of collecting, 10; and a fifth of that of movements
PNEUMARM_FAULTS_FOLDER   where stores, simulations and agents are kept; a temporary folder by default
"""

import os
import tempfile
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
from pneumarm.checkup.leaks import LeakTest, leak_test, leaking
from pneumarm.control import TransferSettings, transfer
from pneumarm.control.monitor import Finding, Monitor
from pneumarm.learning import train
from pneumarm.learning.begin import begin_states
from pneumarm.simulation import Simulation
from pneumarm.simulation.fit import FitSettings, fit_store
from pneumarm.transitions import CollectSettings, Store, collect
from pneumarm.transitions.collect import random_actions

TRANSITIONS = 20_000
"""Transitions that each arm's simulation is fitted to."""
HEADER = f"{'fault':27}{'found':>9}{'rightly':>9}{'since begin':>16}{'contradiction':>16}{'in 2 s':>8}{'early':>7}"
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
    """Collect for ever, as :func:`pneumarm.transitions.collect` does, and yield the turns that ``monitor`` saw."""
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
    return bool(
        (differs[..., 0] & (pressure < _MUCH_AIR)).any() or (differs[..., 1] & (pressure > _LITTLE_AIR)).any()
    )


def measure() -> Iterator[str]:
    arms = [int(one) for one in os.environ.get("PNEUMARM_FAULTS_ARMS", ",".join(map(str, range(1, 21)))).split(",")]
    cases = int(os.environ.get("PNEUMARM_FAULTS_CASES", "40"))
    hours = float(os.environ.get("PNEUMARM_FAULTS_HOURS", "10"))
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(os.environ.get("PNEUMARM_FAULTS_FOLDER", temporary))
        folder.mkdir(exist_ok=True)
        simulations = {arm: fitted(folder, arm) for arm in arms}
        for name, chosen in (("simulation", simulations), ("rules alone", dict.fromkeys(arms, None))):
            yield f"with {name}; times [s] are medians and 95 %"
            yield HEADER
            for kind in KINDS:
                yield line(
                    kind, [played(kind, arms[i % len(arms)], i, chosen[arms[i % len(arms)]]) for i in range(cases)]
                )
            false, done = healthy_collecting(arms, chosen, hours)
            yield f"{len(false)} false alarms in {done:.1f} h of healthy collecting {[str(one) for one in false]}"
        false, done = healthy_movements(folder, arms[:2], simulations, hours / 5)
        yield f"{len(false)} false alarms in {done:.1f} h of healthy movements {[str(one) for one in false]}"
    for name, factor, watch in (
        ("3 x", 3.0, 45.0),
        ("1.5 x", 1.5, 540.0),
        ("healthy", 1.0, 45.0),
        ("healthy", 1.0, 540.0),
    ):
        yield leaks_found(arms, name, factor, LeakTest(watch=watch))


def line(kind: Kind, cases: list[Case]) -> str:
    """Return a line of the table."""
    found = [one for one in cases if one.found is not None]
    rightly = sum(one.found is not None and one.found.kind in kind.found_as for one in cases)
    begin, contradiction = (
        "{:.2f} {:.2f}".format(np.median(values), np.quantile(values, 0.95, method="higher"))
        for values in ([one.since_begin for one in cases], [one.since_contradiction for one in cases])
    )
    soon = np.mean([one.since_contradiction <= 2.0 for one in cases])
    return (
        f"{kind.name:27}{f'{len(found)}/{len(cases)}':>9}{rightly:>9}{begin:>16}{contradiction:>16}{soon:>8.0%}"
        f"{sum(one.early for one in cases):>7}"
    )


def fitted(folder: Path, arm: int) -> Simulation:
    """Return the simulation of a virtual arm; collect and fit where that is not done yet."""
    file = folder / f"{arm}.sim"
    if not file.exists():
        opened = VirtualArm(draw_parameters(arm), seed=arm)
        with Store.for_arm(folder / f"{arm}.db", opened.spec) as store:
            collect(opened, store, TRANSITIONS, arm)
            fit_store(store, FitSettings(epochs=30)).simulation.save(file)
    return Simulation.load(file)


def healthy_collecting(
    arms: list[int], simulations: dict[int, Simulation | None], hours: float
) -> tuple[list[Finding], float]:
    """Return what was found wrong with healthy arms, each collecting from a cold morning on, and the hours watched.

    That an arm has changed is not a false alarm here: the monitor says it of an arm that has warmed up, too.
    """
    found, passed = [], 0.0
    for arm in arms:
        opened = VirtualArm(draw_parameters(arm), seed=1000 + arm)
        monitor = Monitor(opened.spec, simulations[arm])
        for _ in watched_steps(opened, monitor, arm):
            passed += opened.spec.period / 3600
            if opened.time >= hours * 3600 / len(arms):
                break
        found += [one for one in monitor.findings if one.spoils]
    return found, passed


def healthy_movements(
    folder: Path, arms: list[int], simulations: dict[int, Simulation], hours: float
) -> tuple[list[Finding], float]:
    """Return what was found wrong with healthy arms that a policy moves and adapts to, and the hours that took."""
    found, seconds = [], 0.0
    for arm in arms:
        simulation = simulations[arm]
        with Store.open(folder / f"{arm}.db") as store:
            begin = begin_states(store, simulation.window, simulation.scaling)
        agent = train(simulation, begin, None, 1).agent
        opened = VirtualArm(draw_parameters(arm), seed=2000 + arm)
        monitor = Monitor(opened.spec, simulation)
        episodes = max(1, round(hours * 3600 / len(arms) / 5.5))
        settings = TransferSettings(episodes=episodes // 2, test_episodes=max(1, episodes // 4))
        with tempfile.TemporaryDirectory() as place, Store.for_arm(Path(place) / "db", opened.spec) as store:
            transfer(agent, opened, store, settings, seed=arm, watch=monitor)
        found += [one for one in monitor.findings if one.spoils]
        seconds += opened.time
    return found, seconds / 3600


def leaks_found(arms: list[int], name: str, factor: float, test: LeakTest) -> str:
    """Return a line about leak tests of arms that have been tested when they were healthy."""
    right = wrong = 0
    seconds = 0.0
    for arm in arms:
        opened = VirtualArm(draw_parameters(arm), seed=arm)
        for _ in watched_steps(opened, Monitor(opened.spec), arm):
            if opened.time > 300:
                break
        healthy = leak_test(opened, LeakTest(watch=540.0))
        muscle = arm % 2
        if factor != 1.0:
            opened.faults = (Leak(muscle=muscle + 1, factor=factor, begin=opened.time),)
        now = leak_test(opened, test)
        leaks = leaking(healthy, now, test)[0]
        right, wrong, seconds = right + int(leaks[muscle]), wrong + int(leaks[1 - muscle]), now.seconds
    return f"leak test of {seconds:.0f} s, {name}: {right} of {len(arms)} found, {wrong} of the other muscle"
