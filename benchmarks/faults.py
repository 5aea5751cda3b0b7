"""How soon the monitor finds faults, whether it names them rightly, and how often it cries wolf.

Every case is an arm of its own draw, a muscle and a moment drawn at random: early in a first recording, when the
monitor hardly knows the arm, when it has watched it for a while, in a later recording, which it judges by a
simulation, or while a policy moves the arm. Arms are recorded, fitted and trained for as in a default run. The same
arm without the fault is given the same commands beside it: the *contradiction* is the first reading that differs by
more than noise does from what that one reads (CONTRADICTS). Times are watched time (the arm is not watched while it
is brought to a begin state), medians and 95 %, from the begin of the fault and from the contradiction. *Unmarked* are
readings from the contradiction on that are not marked, and so may be learned from.
Healthy hours are collecting from a cold morning on, movements by a policy before, while and after it adapts, and
goals that it holds for five minutes each.
Settings come from the environment:

PNEUMARM_FAULTS_DRAW     standard, arms like the thesis' (virtual:seed=N), by default, or wide (virtual:wide,seed=N)
PNEUMARM_FAULTS_ARMS     seeds of them, 1 to 20 by default; held out are 1001 to 1010, and 5000 to 5299 of the wide
PNEUMARM_FAULTS_COLLECT  usual, as a default run collects, by default, or thesis, for whole periods alone
PNEUMARM_FAULTS_WHILE    early,watched,later,moving,holding by default: when; no fault begins while a goal is held
PNEUMARM_FAULTS_CASES    cases of each fault, 40
PNEUMARM_FAULTS_HOURS    healthy hours of each recording, 10, and a fifth of that of moving and of holding; 0 for none
PNEUMARM_FAULTS_LEAKS    1 to try leak tests, too; 0 by default
PNEUMARM_FAULTS_FOLDER   where all that was made is kept, so that an interrupted benchmark goes on; by default a
                         temporary folder
"""

import math
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks import _environment as environment
from benchmarks._trials import Rows, recorded
from pneumarm.arm import Arm, ArmSpec, ControlCycle, Reading, Step, guarded, open_arm
from pneumarm.arm.virtual import (
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
)
from pneumarm.arm.virtual.parameters import BAR
from pneumarm.checkup.leaks import LeakTest, leak_test, leaking
from pneumarm.control import AgentController, TransferSettings, transfer
from pneumarm.control.monitor import Finding, Monitor, marks_of
from pneumarm.control.monitor.hypotheses import DRAINS
from pneumarm.control.movement import BEGIN, draw_movement, move
from pneumarm.errors import UnusableInput
from pneumarm.learning import AnyAgent, goals_of, load_agent, train
from pneumarm.moving.movement import MoveSettings
from pneumarm.moving.movement import move as move_and_hold
from pneumarm.simulation import Simulation
from pneumarm.simulation.fit import FitSettings, fit_store
from pneumarm.statistics import wilson
from pneumarm.task.begin import begin_states
from pneumarm.transitions import WHOLE_PERIODS, CollectSettings, Store
from pneumarm.transitions.collect import random_actions
from pneumarm.transitions.fill_times import find_fill_times
from pneumarm.transitions.rows import Mark, Recorded
from pneumarm.transitions.watch import Watch

DRAWS = {"standard": "virtual:seed={}", "wide": "virtual:wide,seed={}"}
"""Names of the arms of a draw by their seeds."""
COLLECT = {"usual": CollectSettings(), "thesis": WHOLE_PERIODS}
WARM_UP = {"early": 20.0, "watched": 150.0, "later": 20.0, "moving": 20.0}
"""Healthy watched time before a fault [s], then up to MOMENT longer."""
HELD = 300.0
"""For how long a sound arm is held at a goal [s]."""
MOMENT = 20.0
FIRST = "early", "watched"
"""Of a first recording: slow changes and noise are judged by a simulation alone."""
SOON = 2.0
"""A fault is one of the others if it is to be found in so long [s]."""
PATIENCE = 60.0
"""Watched time after which a fault counts as not found [s]."""
AFTERWARDS = 20.0
"""Watched time after a contradiction in which the monitor may go on to say more [s]."""
LATER = 10.0
"""A fault that is not found in time may be found within this of its contradiction [s]."""
TRIED = 2000.0
"""How many times as much as usual an arm leaks, to find out what that does to it, ..."""
TRYING = 0.3
"""... and for how long [s]."""
CONTRADICTS = (0.5, 0.02)
"""A reading contradicts that differs by more than this from that of a sound arm [degrees], [bar]."""


@dataclass(frozen=True)
class Kind:
    """A kind of case."""

    name: str
    make: Callable[[int, float, VirtualArm], Fault]
    """Makes the fault of muscle 1 or 2, of a begin and an arm."""
    found_as: tuple[str, ...]
    """How it may rightly be called: kinds, or what is said in detail."""
    within: float = 2.0
    """Time from the contradiction in which it is to be found [s]."""


KINDS = (
    Kind("inlet stuck closed", lambda m, t, a: StuckValve(muscle=m, begin=t), ("stuck-valve",)),
    Kind("inlet stuck open", lambda m, t, a: StuckValve(muscle=m, position="open", begin=t), ("stuck-valve",)),
    Kind("outlet stuck closed", lambda m, t, a: StuckValve(muscle=m, valve="outlet", begin=t), ("stuck-valve",)),
    Kind(
        "outlet stuck open",
        lambda m, t, a: StuckValve(muscle=m, valve="outlet", position="open", begin=t),
        ("stuck-valve",),
    ),
    Kind("inlet and outlet swapped", lambda m, t, a: SwappedValves(muscle=m, begin=t), ("swapped-valves",)),
    Kind("muscles swapped", lambda m, t, a: SwappedMuscles(muscle=m, begin=t), ("swapped-muscles",)),
    Kind("supply lost", lambda m, t, a: SupplyLoss(begin=t), ("low-supply",), 0.5),
    Kind("supply halved", lambda m, t, a: SupplyLoss(to=0.5, begin=t), ("low-supply",)),
    Kind("potentiometer dead", lambda m, t, a: DeadPotentiometer(begin=t), ("dead-potentiometer",), 0.067),
    Kind("potentiometer frozen", lambda m, t, a: FrozenPotentiometer(begin=t), ("frozen-potentiometer",), 0.5),
    Kind("potentiometer logarithmic", lambda m, t, a: LogarithmicPotentiometer(begin=t), ("changed",), 60.0),
    Kind(
        "potentiometer worn",
        lambda m, t, a: WornPotentiometer(
            angle=5, height=15 * a.spec.angle_unit, contact=8 * a.spec.angle_unit, begin=t
        ),
        ("worn-potentiometer",),
        60.0,
    ),
    Kind(
        "noise",
        lambda m, t, a: SensorNoise(
            angle=min(6 * a.spec.angle_unit, 1e3), pressure=min(6 * a.spec.pressure_unit, 1e3), begin=t
        ),
        ("sensor-noise",),
        60.0,
    ),
    Kind("large leak (0.5 / s)", lambda m, t, a: leak_of(a, m, t, 0.5), ("leak",), 60.0),
    Kind("torn hose (2 / s)", lambda m, t, a: leak_of(a, m, t, 2.0), ("torn-hose", DRAINS)),
)


def leak_of(arm: VirtualArm, muscle: int, begin: float, rate: float) -> Leak:
    """Return a leak from ``begin`` on by which a ``muscle`` of ``arm`` loses its pressure at a ``rate`` [1/s].

    By the same multiple of their usual leaks arms lose it a hundred times faster or slower, so it is tried out.
    """
    sound, leaky = (tried_with(arm, muscle, factor) for factor in (1.0, TRIED))
    return Leak(muscle=muscle, factor=TRIED * rate * TRYING / math.log(sound / leaky), begin=begin)


def tried_with(arm: VirtualArm, muscle: int, factor: float) -> float:
    """Return the pressure [Pa gauge] of a ``muscle`` that was half full and has leaked more for a moment."""
    tried, valves = arm.like(0), np.zeros((arm.spec.joints, 2), np.int8)
    valves[0, muscle - 1] = 1
    tried.set_valves(valves)
    while tried.pressure[0, muscle - 1] < 0.5 * tried.spec.max_pressure * BAR and tried.time < 10.0:
        tried.wait(0.05)
    tried.set_valves(np.zeros_like(valves))
    tried.wait(0.5)
    tried.faults = (Leak(muscle=muscle, factor=factor, begin=tried.time),)
    tried.wait(TRYING)
    return float(tried.pressure[0, muscle - 1])


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
    details: tuple[str, ...]
    """What they say."""
    since_begin: float
    """Watched time from the begin of the fault until the first one [s]."""
    since_contradiction: float
    """... from the contradiction."""
    unmarked: int
    """Readings from the contradiction until then that are not marked."""
    early: int
    """Findings before the fault began."""

    def is_called(self, names: Sequence[str]) -> bool:
        """Return whether a finding is called by one of ``names``."""
        return bool({*self.kinds, *self.details} & set(names))


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
        self.sound = self.arm.like(self._seed)
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

    def __init__(
        self, twins: Twins, make: Callable[[float], Fault], random: np.random.Generator, warm: float, watch: float
    ) -> None:
        self.turns: list[Turn] = []
        self.broke: int | None = None
        self.contradiction: int | None = None
        self._twins, self._make, self._random, self._first = twins, make, random, True
        self._warm = (warm + MOMENT * random.random()) / twins.spec.period
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


def opened(draw: str, number: int, seed: int) -> VirtualArm:
    """Return arm ``number`` of a draw, controlled as it usually is."""
    arm = open_arm(DRAWS[draw].format(number), seed)
    assert isinstance(arm, VirtualArm)
    return arm


def watched_steps(arm: Arm, monitor: Watch, seed: int, settings: CollectSettings = WHOLE_PERIODS) -> Iterator[Step]:
    """Collect for ever, as :func:`pneumarm.transitions.collect` does, and yield the turns that ``monitor`` saw."""
    random, guard = np.random.default_rng([seed, 7]), guarded(arm)
    settings = settings.for_period(arm.spec.period)
    if not settings.complete:
        settings = settings.for_arm(find_fill_times(guard))
    assert settings.begin is not None
    while True:
        settings.begin.reach(guard, random)
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
    number: int,
    seed: int,
    agent: AnyAgent | None = None,
    draw: str = "standard",
    settings: CollectSettings = WHOLE_PERIODS,
    warm: float = WARM_UP["early"],
) -> Played:
    """Let a fault happen to healthy arm ``number`` of ``draw``, that collects or that ``agent`` moves."""
    random = np.random.default_rng([seed, number])
    muscle = int(random.integers(1, 3))
    twins = Twins(opened(draw, number, seed), seed)
    stage = Stage(twins, lambda time: kind.make(muscle, time, twins.arm), random, warm, max(AFTERWARDS, kind.within))
    if agent is None:
        for _ in watched_steps(twins, stage, seed, settings):
            if stage.over:
                break
    else:
        cycle, controller, movement = ControlCycle(guarded(twins)), AgentController(agent), 0
        while not stage.over:
            drawn = draw_movement(agent.goal_range, seed, True, movement)
            BEGIN.reach(cycle.arm, drawn.random)
            move(cycle, controller, drawn.goal, agent.settings, stage)
            movement += 1
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
    kinds, details = (
        tuple(dict.fromkeys(getattr(one, name) for one in monitor.findings[early:])) for name in ("kind", "detail")
    )
    unmarked = 0
    if contradiction <= found < math.inf:
        time = np.array([turn.reading.time for turn in played.turns[int(contradiction) : int(found) + 1]])
        marks = marks_of(monitor.findings[early:], time, np.arange(len(time)))
        unmarked = len(time) - sum(mark.last - mark.first + 1 for mark in marks)
    since = 0.0 if found < contradiction else (found - contradiction) * period
    return Case(kinds, details, (found - played.begin + 1) * period, since, unmarked, early)


def measure() -> Iterator[str]:
    draw = environment.choice("PNEUMARM_FAULTS_DRAW", DRAWS)
    how = environment.choice("PNEUMARM_FAULTS_COLLECT", COLLECT)
    arms = environment.seeds("PNEUMARM_FAULTS_ARMS", "1-20")
    ways = environment.words("PNEUMARM_FAULTS_WHILE", ",".join((*WARM_UP, "holding")))
    if unknown := [way for way in ways if way not in (*WARM_UP, "holding")]:
        raise UnusableInput(f"PNEUMARM_FAULTS_WHILE: expected {', '.join((*WARM_UP, 'holding'))}, got {unknown[0]}")
    cases = environment.whole("PNEUMARM_FAULTS_CASES", 40, least=0)
    hours = environment.whole("PNEUMARM_FAULTS_HOURS", 10, least=0)
    with environment.kept_folder("PNEUMARM_FAULTS_FOLDER") as folder:
        bench = Bench(folder, draw, how)
        if cases:
            yield HEADER
        for kind in KINDS if cases else ():
            for way in [way for way in ways if way in WARM_UP and (kind.within <= SOON or way not in FIRST)]:
                yield line(kind, way, [bench.case(kind, arms[i % len(arms)], i, way) for i in range(cases)])
        for way in [way for way in ways if way != "watched"] if hours else ():  # early is the beginning of that
            each = (hours / 5 if way in ("moving", "holding") else hours) / len(arms)
            yield false_alarms(way, [bench.healthy(arm, each, way) for arm in arms])
        if environment.whole("PNEUMARM_FAULTS_LEAKS", 0, least=0):
            for name, factor, watch in (
                ("3 x", 3.0, 45.0),
                ("1.5 x", 1.5, 540.0),
                ("healthy", 1.0, 45.0),
                ("healthy", 1.0, 540.0),
            ):
                yield leaks_found(draw, arms, name, factor, LeakTest(watch=watch))


def false_alarms(way: str, found: Sequence[tuple[list[str], list[str], float]]) -> str:
    """Return a line about what was ``found`` wrong with healthy arms: faults, changes, and hours watched of each."""
    faults, changes, hours = zip(*found, strict=True)
    wrong, changed = (list(chain.from_iterable(each)) for each in (faults, changes))
    return f"{len(wrong)} false alarms and {len(changed)} changes in {sum(hours):.1f} h, {way}: {wrong + changed}"


HEADER = (
    f"{'fault':27}{'while':8}{'found':>7}{'named':>7}{'since begin':>13}{'contradiction':>16}{'in time':>26}"
    f"{'in 10 s':>9}{'unmarked':>10}{'early':>6}  as"
)


def line(kind: Kind, way: str, cases: Sequence[Case]) -> str:
    """Return a line of the table."""
    begin, contradiction, unmarked = (
        "{:.2f} {:.2f}".format(np.median(values), np.quantile(values, 0.95, method="higher"))
        for values in zip(*((one.since_begin, one.since_contradiction, one.unmarked) for one in cases), strict=True)
    )
    soon = [one.since_contradiction < kind.within + 1e-9 for one in cases]
    low, high = wilson(sum(soon), len(soon))
    names = Counter(" then ".join(one.kinds) or "nothing" for one in cases)
    return (
        f"{kind.name:27}{way:8}{f'{sum(bool(one.kinds) for one in cases)}/{len(cases)}':>7}"
        f"{sum(one.is_called(kind.found_as) for one in cases):>7}{begin:>13}{contradiction:>16}"
        f"{f'{np.mean(soon):.0%} ({low:.0%}-{high:.0%}) in {kind.within:.2g} s':>26}"
        f"{np.mean([one.since_contradiction <= LATER for one in cases]):>9.0%}{unmarked:>10}"
        f"{sum(one.early for one in cases):>6}  "
        + ", ".join(f"{name} {count}" for name, count in names.most_common())
    )


class Bench:
    """Arms of a draw with all that a monitor may know of them; what was made is kept in a folder."""

    def __init__(self, folder: Path, draw: str, how: str) -> None:
        self.folder, self.draw, self.how = folder, draw, how
        self._cases = Rows(folder / "cases.jsonl", "draw", "how", "while", "kind", "arm", "case")
        self._healthy = Rows(folder / "healthy.jsonl", "draw", "how", "while", "arm", "hours")

    def case(self, kind: Kind, arm: int, case: int, way: str) -> Case:
        """Return what a monitor makes of a fault."""
        key = self.draw, self.how, way, kind.name, arm, case
        row = self._cases.get(*key)
        if row is None:
            agent = self.agent(arm) if way == "moving" else None
            played = play(kind, arm, case, agent, self.draw, COLLECT[self.how], WARM_UP[way])
            made = judged(played, self.known(arm, way))
            row = self._cases.add(dict(zip(self._cases.keys, key, strict=True)) | asdict(made))
        return msgspec.convert(row, Case)

    def healthy(self, arm: int, hours: float, way: str) -> tuple[list[str], list[str], float]:
        """Return what was found wrong with a healthy arm: faults, changes; and the hours that it was watched."""
        key = self.draw, self.how, way, arm, hours
        row = self._healthy.get(*key)
        if row is None:
            known = self.known(arm, way)
            if known is not None and way == "moving":
                recording = self.folder / f"{self.draw}-{arm}.db"
                found, watched = healthy_movements(self.draw, arm, known, self.agent(arm), hours, recording)
            elif known is not None and way == "holding":
                found, watched = healthy_holding(self.draw, arm, known, self.agent(arm), hours)
            else:
                found, watched = healthy_collecting(arm, known, hours, self.draw, COLLECT[self.how])
            told = {"faults": [str(one) for one in found if one.spoils], "watched": watched}
            told["changes"] = [str(one) for one in found if not one.spoils]
            row = self._healthy.add(dict(zip(self._healthy.keys, key, strict=True)) | told)
        return row["faults"], row["changes"], row["watched"]

    def known(self, arm: int, way: str) -> Simulation | None:
        """Return the simulation by which a monitor judges; none in a first recording."""
        return None if way in FIRST else fitted(self.folder, arm, self.draw)

    def agent(self, arm: int) -> AnyAgent:
        """Return the default agent of an arm."""
        file = self.folder / f"{self.draw}-{arm}.agent"
        if not file.exists():
            simulation = fitted(self.folder, arm, self.draw)
            with Store.open(file.with_suffix(".db")) as store:
                begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
            train(simulation, begin, None, 1).agent.save(file)
        return load_agent(file)


def fitted(folder: Path, arm: int, draw: str = "standard") -> Simulation:
    """Return the simulation of an arm; record and fit where that is not done yet."""
    file = folder / f"{draw}-{arm}.sim"
    if not file.exists():
        file.with_suffix(".db").unlink(missing_ok=True)
        recorded(DRAWS[draw].format(arm), file.with_suffix(".db"), arm)
        with Store.open(file.with_suffix(".db")) as store:
            fit_store(store, FitSettings()).simulation.save(file)
    return Simulation.load(file)


def healthy_collecting(
    arm: int,
    simulation: Simulation | None,
    hours: float,
    draw: str = "standard",
    settings: CollectSettings = WHOLE_PERIODS,
) -> tuple[list[Finding], float]:
    """Return what was found wrong with a healthy arm that collects from a cold morning on, and the hours watched."""
    healthy, passed = opened(draw, arm, 1000 + arm), 0.0
    monitor = Monitor(healthy.spec, simulation)
    for _ in watched_steps(healthy, monitor, arm, settings):
        passed += healthy.spec.period / 3600
        if healthy.time >= hours * 3600:
            break
    return monitor.findings, passed


def healthy_movements(
    draw: str, arm: int, simulation: Simulation, agent: AnyAgent, hours: float, recording: Path
) -> tuple[list[Finding], float]:
    """Return what was found wrong with a healthy arm that a policy moves and adapts to, and the hours that took.

    As in a run the movements are stored behind the ``recording``, so that what was seen there is known.
    """
    healthy = opened(draw, arm, 2000 + arm)
    monitor = Monitor(healthy.spec, simulation)
    episodes = max(1, round(hours * 3600 / 5.5))
    settings = TransferSettings(episodes=episodes // 2, test_episodes=max(1, episodes // 4))
    with tempfile.TemporaryDirectory() as place:
        db = Path(shutil.copy(recording, place))
        with Store.for_arm(db, healthy.spec) as store:
            if (state := store.state("arm")) is not None:
                healthy.set_state(state)
            began = healthy.time
            transfer(agent, healthy, store, settings, seed=arm, watch=monitor)
    return monitor.findings, (healthy.time - began) / 3600


def healthy_holding(
    draw: str, arm: int, simulation: Simulation, agent: AnyAgent, hours: float
) -> tuple[list[Finding], float]:
    """Return what was found wrong with a healthy arm that is held at goals, and the hours that took."""
    controller = agent.controller()
    assert controller is not None
    healthy = opened(draw, arm, 3000 + arm)
    monitor, count = Monitor(healthy.spec, simulation), max(1, round(hours * 3600 / HELD))
    goals = goals_of(agent).draw(np.random.default_rng([arm, 8]), count)
    for _ in move_and_hold(healthy, controller, list(goals), MoveSettings(HELD, tries=1), watch=monitor):
        pass
    return monitor.findings, healthy.time / 3600


def leaks_found(draw: str, arms: list[int], name: str, factor: float, test: LeakTest) -> str:
    """Return a line about leak tests of arms that have been tested when they were healthy."""
    right = wrong = 0
    seconds = 0.0
    for arm in arms:
        tested = opened(draw, arm, arm)
        for _ in watched_steps(tested, Monitor(tested.spec), arm):
            if tested.time > 300:
                break
        healthy = leak_test(tested, LeakTest(watch=540.0))
        muscle = arm % 2
        if factor != 1.0:
            tested.faults = (Leak(muscle=muscle + 1, factor=factor, begin=tested.time),)
        now = leak_test(tested, test)
        leaks = leaking(healthy, now, test)[0]
        right, wrong, seconds = right + int(leaks[muscle]), wrong + int(leaks[1 - muscle]), now.seconds
    return f"leak test of {seconds:.0f} s, {name}: {right} of {len(arms)} found, {wrong} of the other muscle"
