"""How soon the monitor finds faults, whether it names them rightly, and how often it cries wolf.

Every case is an arm of its own draw, a muscle and a moment drawn at random, while the arm is collecting, or while a
policy moves it. The same arm without the fault is given the same commands beside it: the *contradiction* is the first
reading that differs by more than noise does from what that one reads (CONTRADICTS). Times are watched time (the arm
is not watched while it is brought to a begin state), from the begin of the fault and from the contradiction.
*Unmarked* are readings from the contradiction on that are not marked, and so may be learned from.
Healthy hours are collecting from a cold morning on, and movements by a policy before, while and after it adapts.
Settings come from the environment:

PNEUMARM_FAULTS_ARMS     seeds of virtual arms, 1 to 20 by default; the held-out arms are 1001 to 1010
PNEUMARM_FAULTS_CASES    cases of each fault, 40
PNEUMARM_FAULTS_HOURS    healthy hours of collecting, 10; and a fifth of that of movements
PNEUMARM_FAULTS_FOLDER   where stores, simulations and agents are kept; a temporary folder by default
"""

import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks import _environment as environment
from pneumarm.arm import Arm, ArmSpec, ControlCycle, Reading, Step, guarded
from pneumarm.arm.virtual import (
    ArmParameters,
    DeadPotentiometer,
    Fault,
    FrozenPotentiometer,
    Leak,
    LogarithmicPotentiometer,
    SensorNoise,
    StuckValve,
    SupplyLoss,
    SwappedMuscles,
    SwappedValves,
    VirtualArm,
    WornPotentiometer,
    draw_parameters,
)
from pneumarm.checkup.leaks import LeakTest, leak_test, leaking
from pneumarm.control import AgentController, TransferSettings, transfer
from pneumarm.control.monitor import Finding, Monitor, marks_of
from pneumarm.control.movement import BEGIN, draw_movement, move
from pneumarm.learning import AnyAgent, load_agent, train
from pneumarm.simulation import Simulation
from pneumarm.simulation.fit import FitSettings, fit_store
from pneumarm.statistics import wilson
from pneumarm.task.begin import begin_states
from pneumarm.transitions import WHOLE_PERIODS, CollectBegin, CollectSettings, Store, collect
from pneumarm.transitions.collect import random_actions
from pneumarm.transitions.rows import Mark, Recorded
from pneumarm.transitions.watch import Watch

TRANSITIONS = 20_000
"""Transitions that each arm's simulation is fitted to."""
WARM_UP = 20.0
"""Healthy watched time before a fault [s]; then up to as long again."""
PATIENCE = 60.0
"""Watched time after which a fault counts as not found [s]."""
AFTERWARDS = 20.0
"""Watched time after a contradiction in which the monitor may go on to say more [s]."""
LATER = 10.0
"""A fault that is not found in time may be found within this of its contradiction [s]."""
CONTRADICTS = (0.5, 0.02)
"""A reading contradicts that differs by more than this from that of a sound arm [degrees], [bar]."""


@dataclass(frozen=True)
class Kind:
    """A kind of case."""

    name: str
    make: Callable[[int, float], Fault]
    """Makes the fault of muscle 1 or 2 and a begin."""
    found_as: tuple[str, ...]
    """How it may rightly be called."""
    within: float = 2.0
    """Time from the contradiction in which it is to be found [s]."""


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
    Kind("supply lost", lambda m, t: SupplyLoss(begin=t), ("low-supply",), 0.5),
    Kind("supply halved", lambda m, t: SupplyLoss(to=0.5, begin=t), ("low-supply",)),
    Kind("potentiometer dead", lambda m, t: DeadPotentiometer(begin=t), ("dead-potentiometer",), 0.067),
    Kind("potentiometer frozen", lambda m, t: FrozenPotentiometer(begin=t), ("frozen-potentiometer",), 0.5),
    Kind("potentiometer logarithmic", lambda m, t: LogarithmicPotentiometer(begin=t), ("changed",), 60.0),
    Kind(
        "potentiometer worn",
        lambda m, t: WornPotentiometer(angle=5, height=15, contact=8, begin=t),
        ("worn-potentiometer",),
        60.0,
    ),
    Kind("noise", lambda m, t: SensorNoise(angle=6, pressure=6, begin=t), ("sensor-noise",), 60.0),
    Kind("torn hose (2000 x leak)", lambda m, t: Leak(muscle=m, factor=2000, begin=t), ("leak",), 60.0),
)


class Turn(NamedTuple):
    """What a monitor is shown."""

    reading: Reading
    valves: NDArray[np.int8] | None
    first: bool
    """Whether a sequence begins with it."""


@dataclass(frozen=True)
class Played:
    """A healthy arm to which a fault happened, as a monitor sees it."""

    spec: ArmSpec
    turns: list[Turn]
    begin: int
    """The first turn that can tell of the fault."""
    contradiction: int | None
    """The turn that contradicts; None where none does."""


@dataclass(frozen=True)
class Case:
    """What a monitor made of a fault."""

    kinds: tuple[str, ...]
    """Of the findings after the fault began, in the order of being found."""
    since_begin: float
    """Watched time from the begin of the fault until the first one [s]."""
    since_contradiction: float
    """... from the contradiction."""
    unmarked: int
    """Readings from the contradiction until then that are not marked."""
    early: int
    """Findings before the fault began."""


class Twins(Arm):
    """A virtual arm, and beside it the same arm without faults under the same commands."""

    def __init__(self, arm: VirtualArm, seed: int) -> None:
        self.arm, self.spec, self._seed = arm, arm.spec, seed
        self.sound: VirtualArm | None = None
        """The other one, once there is a fault."""
        self.differs = False
        """Whether their last readings differed by more than noise does."""
        degrees, bar = CONTRADICTS
        self._far = np.array([degrees * self.spec.counts_per_degree, bar * self.spec.counts_per_bar])

    def fail(self, fault: Fault) -> None:
        """Let ``fault`` happen."""
        self.sound = VirtualArm(self.arm.parameters, seed=self._seed)
        self.sound.set_state(self.arm.get_state())
        self.arm.faults = (fault,)

    def level(self) -> None:
        """Give the sound arm, at rest with closed valves, the air and the angle of the other one."""
        if self.sound is not None:
            muscles, joints = self.sound.body.muscles, self.sound.body.joints
            muscles[...], joints[...] = self.arm.body.muscles, self.arm.body.joints
            muscles["open"] = muscles["pending"] = 0

    def read(self) -> Reading:
        reading = self.arm.read()
        if self.sound is not None:
            sound = self.sound.read()
            angle, pressure = abs(reading.angle - sound.angle), abs(reading.pressure - sound.pressure)
            self.differs = bool((angle > self._far[0]).any() or (pressure > self._far[1]).any())
        return reading

    def set_valves(self, valves: ArrayLike) -> None:
        for arm in filter(None, (self.arm, self.sound)):
            arm.set_valves(valves)

    def wait(self, seconds: float) -> None:
        for arm in filter(None, (self.arm, self.sound)):
            arm.wait(seconds)

    def wait_until(self, time: float) -> None:
        for arm in filter(None, (self.arm, self.sound)):
            arm.wait_until(time)

    def close(self) -> None:
        self.arm.close()


class Stage:
    """Lets a fault happen to an arm and keeps what a monitor would see: a ``Watch`` that watches nothing."""

    def __init__(self, twins: Twins, make: Callable[[float], Fault], random: np.random.Generator, watch: float):
        self.turns: list[Turn] = []
        self.broke: int | None = None
        self.contradiction: int | None = None
        self._twins, self._make, self._random, self._first = twins, make, random, True
        self._warm = WARM_UP * (1 + random.random()) / twins.spec.period
        self._watch, self._patience = watch / twins.spec.period, PATIENCE / twins.spec.period

    @property
    def over(self) -> bool:
        """Whether enough has been seen."""
        if self.broke is None:
            return False
        after = len(self.turns) - self.broke if self.contradiction is None else len(self.turns) - self.contradiction
        return after > (self._patience if self.contradiction is None else self._watch)

    def begin(self, *, at_rest: bool) -> None:
        self._first = True
        if self.contradiction is None:
            self._twins.level()

    def see(self, reading: Reading, valves: NDArray[np.int8] | None) -> None:
        if self.contradiction is None and self._twins.differs and not self._first:
            self.contradiction = len(self.turns)
        self.turns.append(Turn(reading, valves, self._first))
        self._first = False
        if self.broke is None and len(self.turns) >= self._warm and valves is not None:
            # Between two readings, so that the first reading that can tell of it is the next one.
            period = self._twins.spec.period
            self._twins.fail(self._make(self._twins.arm.time + float(self._random.random()) * period))
            self.broke = len(self.turns)

    def marks(self, recorded: Recorded) -> tuple[Mark, ...]:
        return ()

    def spoiled_since(self) -> None:
        return None

    def reasons(self) -> str:
        return ""

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None:
        pass


def watched_steps(arm: Arm, monitor: Watch, seed: int, settings: CollectSettings = WHOLE_PERIODS) -> Iterator[Step]:
    """Collect for ever, as :func:`pneumarm.transitions.collect` does, and yield the turns that ``monitor`` saw."""
    settings = settings.for_period(arm.spec.period)
    random, guard = np.random.default_rng([seed, 7]), guarded(arm)
    while True:
        (settings.begin or CollectBegin()).reach(guard, random)
        _, actor = random_actions(arm.spec, settings, random)
        actor.reset(np.zeros(arm.spec.joints))
        left = iter(range(settings.actions or 0))
        monitor.begin(at_rest=True)
        for step in ControlCycle(guard).run(
            lambda reading, left=left, actor=actor: None if next(left, None) is None else actor.act(reading)  # type: ignore[misc]
        ):
            monitor.see(step.reading, step.valves)
            yield step


def play(
    kind: Kind,
    arm_seed: int,
    seed: int,
    agent: AnyAgent | None = None,
    draw: Callable[[int], ArmParameters] = draw_parameters,
) -> Played:
    """Let a fault happen to a healthy arm, one of those of ``draw``, that collects or that ``agent`` moves."""
    random = np.random.default_rng([seed, arm_seed])
    muscle = int(random.integers(1, 3))
    twins = Twins(VirtualArm(draw(arm_seed), seed=seed), seed)
    stage = Stage(twins, lambda time: kind.make(muscle, time), random, max(AFTERWARDS, kind.within))
    if agent is None:
        for _ in watched_steps(twins, stage, seed):
            if stage.over:
                break
    else:
        cycle, controller, number = ControlCycle(guarded(twins)), AgentController(agent), 0
        while not stage.over:
            drawn = draw_movement(agent.goal_range, seed, True, number)
            BEGIN.reach(cycle.arm, drawn.random)
            move(cycle, controller, drawn.goal, agent.settings, stage)
            number += 1
    assert stage.broke is not None
    return Played(twins.spec, stage.turns, stage.broke, stage.contradiction)


def judged(played: Played, simulation: Simulation | None) -> Case:
    """Return what a monitor makes of what was played."""
    monitor, period = Monitor(played.spec, simulation), played.spec.period
    early, found = 0, math.inf
    for number, turn in enumerate(played.turns):
        if turn.first:
            monitor.begin(at_rest=True)
        if number == played.begin:
            early = len(monitor.findings)
        monitor.see(turn.reading, turn.valves)
        if number >= played.begin and len(monitor.findings) > early and found == math.inf:
            found = number
    contradiction = math.inf if played.contradiction is None else played.contradiction
    kinds = tuple(dict.fromkeys(one.kind for one in monitor.findings[early:]))
    unmarked = 0
    if played.contradiction is not None and found < math.inf:
        time = np.array([turn.reading.time for turn in played.turns[played.contradiction : int(found) + 1]])
        marks = marks_of(monitor.findings[early:], time, np.arange(len(time)))
        unmarked = len(time) - sum(mark.last - mark.first + 1 for mark in marks)
    since = 0.0 if found < contradiction else (found - contradiction) * period
    return Case(kinds, (found - played.begin + 1) * period, since, unmarked, early)


def measure() -> Iterator[str]:
    arms = environment.seeds("PNEUMARM_FAULTS_ARMS", "1-20")
    cases = environment.whole("PNEUMARM_FAULTS_CASES", 40)
    hours = environment.number("PNEUMARM_FAULTS_HOURS", 10.0)
    with environment.kept_folder("PNEUMARM_FAULTS_FOLDER") as folder:
        simulations = {arm: fitted(folder, arm) for arm in arms}
        agents = {arm: trained(folder, arm, simulations[arm]) for arm in arms}
        lines: dict[str, list[str]] = {"collecting, with simulation": [], "collecting, rules alone": [], "moving": []}
        for kind in KINDS:
            collecting, alone, moving = [], [], []
            for i in range(cases):
                arm = arms[i % len(arms)]
                played = play(kind, arm, i)
                collecting.append(judged(played, simulations[arm]))
                alone.append(judged(played, None))
                moving.append(judged(play(kind, arm, i, agents[arm]), simulations[arm]))
            for name, judgements in zip(lines, (collecting, alone, moving), strict=True):
                lines[name].append(line(kind, judgements))
        for name, table in lines.items():
            yield f"{name}; times [s] are medians and 95 %"
            yield HEADER
            yield from table
        for name, chosen in (("simulation", simulations), ("rules alone", dict.fromkeys(arms, None))):
            yield false_alarms(f"collecting, {name}", *healthy_collecting(arms, chosen, hours))
        yield false_alarms("movements", *healthy_movements(arms[:2], simulations, agents, hours / 5))
    for name, factor, watch in (
        ("3 x", 3.0, 45.0),
        ("1.5 x", 1.5, 540.0),
        ("healthy", 1.0, 45.0),
        ("healthy", 1.0, 540.0),
    ):
        yield leaks_found(arms, name, factor, LeakTest(watch=watch))


def false_alarms(what: str, found: list[Finding], hours: float) -> str:
    """Return a line about what was ``found`` in ``hours`` watched of healthy arms."""
    spoiling = sum(one.spoils for one in found)
    return (
        f"{spoiling} false alarms and {len(found) - spoiling} changes in {hours:.1f} h of healthy {what} "
        f"{list(map(str, found))}"
    )


HEADER = (
    f"{'fault':27}{'found':>9}{'since begin':>13}{'contradiction':>16}{'in time':>26}{'in 10 s':>9}{'unmarked':>10}"
    f"{'early':>6}  as"
)


def line(kind: Kind, cases: Sequence[Case]) -> str:
    """Return a line of the table."""
    begin, contradiction, unmarked = (
        "{:.2f} {:.2f}".format(np.median(values), np.quantile(values, 0.95, method="higher"))
        for values in zip(*((one.since_begin, one.since_contradiction, one.unmarked) for one in cases), strict=True)
    )
    soon = [one.since_contradiction < kind.within + 1e-9 for one in cases]
    low, high = wilson(sum(soon), len(soon))
    names = Counter(" then ".join(one.kinds) or "nothing" for one in cases)
    return (
        f"{kind.name:27}{f'{sum(bool(one.kinds) for one in cases)}/{len(cases)}':>9}{begin:>13}{contradiction:>16}"
        f"{f'{np.mean(soon):.0%} ({low:.0%}-{high:.0%}) in {kind.within:.2g} s':>26}"
        f"{np.mean([one.since_contradiction <= LATER for one in cases]):>9.0%}{unmarked:>10}"
        f"{sum(one.early for one in cases):>6}  "
        + ", ".join(f"{name} {count}" for name, count in names.most_common())
    )


def trained(folder: Path, arm: int, simulation: Simulation) -> AnyAgent:
    """Return an agent trained in ``simulation``."""
    file = folder / f"{arm}.agent"
    if not file.exists():
        with Store.open(folder / f"{arm}.db") as store:
            begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
        train(simulation, begin, None, 1).agent.save(file)
    return load_agent(file)


def fitted(folder: Path, arm: int) -> Simulation:
    """Return the simulation of a virtual arm; collect and fit where that is not done yet."""
    file = folder / f"{arm}.sim"
    if not file.exists():
        opened = VirtualArm(draw_parameters(arm), seed=arm)
        with Store.for_arm(folder / f"{arm}.db", opened.spec) as store:
            collect(opened, store, TRANSITIONS, arm, settings=WHOLE_PERIODS)
            fit_store(store, FitSettings(epochs=30)).simulation.save(file)
    return Simulation.load(file)


def healthy_collecting(
    arms: list[int], simulations: Mapping[int, Simulation | None], hours: float
) -> tuple[list[Finding], float]:
    """Return what was found wrong with healthy arms that collect from a cold morning on, and the hours watched."""
    found: list[Finding] = []
    passed = 0.0
    for arm in arms:
        opened = VirtualArm(draw_parameters(arm), seed=1000 + arm)
        monitor = Monitor(opened.spec, simulations[arm])
        for _ in watched_steps(opened, monitor, arm):
            passed += opened.spec.period / 3600
            if opened.time >= hours * 3600 / len(arms):
                break
        found += monitor.findings
    return found, passed


def healthy_movements(
    arms: list[int], simulations: dict[int, Simulation], agents: dict[int, AnyAgent], hours: float
) -> tuple[list[Finding], float]:
    """Return what was found wrong with healthy arms that a policy moves and adapts to, and the hours that took."""
    found: list[Finding] = []
    seconds = 0.0
    for arm in arms:
        opened = VirtualArm(draw_parameters(arm), seed=2000 + arm)
        monitor = Monitor(opened.spec, simulations[arm])
        episodes = max(1, round(hours * 3600 / len(arms) / 5.5))
        settings = TransferSettings(episodes=episodes // 2, test_episodes=max(1, episodes // 4))
        with tempfile.TemporaryDirectory() as place, Store.for_arm(Path(place) / "db", opened.spec) as store:
            transfer(agents[arm], opened, store, settings, seed=arm, watch=monitor)
        found += monitor.findings
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
