"""Collect transitions on any arm (thesis section 3.2.2).

    repeat
        vent all muscles, inflate each for a random time, wait until the oscillations are damped
        draw one of two kinds of sequence:
            zero velocity   uncorrelated random actions
            velocity        random actions, each held for a random number of steps
        carry it out and store it

Where we differ from the thesis, or it leaves something open:

1. How long an action is held at most is not given; see :attr:`CollectSettings.longest_hold`. It is drawn anew for
   every action. With several joints the actions of each are drawn and held independently.
2. The guard keeps inlets closed at too high a pressure; stored are the valves as applied.
3. Sequence ``n`` is drawn from a random generator of its own, made of the seed and ``n``, so that a collection that
   was interrupted goes on as if it had not been.
"""

import json
import math
import time as wall_clock
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, NamedTuple, Self

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.controller import Controller
from pneumarm.arm.counts import Counts
from pneumarm.arm.cycle import BeginState, ControlCycle, Step
from pneumarm.arm.guard import GuardedArm, Interventions, guarded
from pneumarm.arm.seam import Arm, ArmSpec
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.settings import PositiveInt, PythonOnly, Settings, Share
from pneumarm.transitions.doubtful import with_doubtful_marked
from pneumarm.transitions.fill_times import FillTimes, find_fill_times
from pneumarm.transitions.players import Trajectory
from pneumarm.transitions.rows import Recorded, broken_off, joinable
from pneumarm.transitions.store import Store
from pneumarm.transitions.watch import MOST_SPOILED, Patience, Watch, act_until, keep_watch, warm_up_watch

KINDS = ("zero-velocity", "velocity", "pulses", "sparse", "controller")
"""Kinds of the sequences made here."""
FEWEST_TRANSITIONS = 1_000
"""Fewer cannot be learnt from."""
PURPOSE = "collect"
"""The purpose of the runs made here."""

Progress = Callable[[int, int], None]
"""Called with the transitions stored so far and those asked for."""


@dataclass(frozen=True)
class CollectBegin(BeginState):
    """How the arm is brought to the begin state of a sequence at rest."""

    inflate: float = 1.2
    """Longest time that a muscle is inflated again [s] (thesis section 3.2.2: 1.2)."""

    def reach_end(self, arm: GuardedArm, sides: NDArray[np.int64]) -> None:
        """Bring every joint to one of its ends, that of higher angles where its side (joints,) is +1, and wait.

        One muscle is filled and the other emptied until the joints hardly move any more, but no longer than that
        takes slow ones: a muscle that fills alone shortens, so that it needs more air than one of two that fill.
        """
        arm.make_ready()
        begun = last = arm.read()
        arm.set_valves(np.stack([sides, -sides], axis=1))
        piece, passed = self.inflate / 2, 0.0
        while passed < _SLOWEST * self.inflate:
            arm.wait(piece)
            passed += piece
            now = arm.read()
            moved, way = np.abs(now.angle - last.angle), np.abs(now.angle - begun.angle)
            if passed >= self.deflate and (moved <= _HARDLY * way + arm.spec.angle_unit).all():
                break
            last = now
        arm.set_valves(np.zeros(arm.applied.shape, np.int8))
        arm.wait(self.settle)


_USUAL_RATE = 30.0  # Hz; at higher ones as many seconds as there, at lower ones as many periods
_LONGEST_PULSES = 4  # most periods in a row in which a muscle gets the same pulse
_ACTIONS, _HELD = 200, 10  # of a sequence; most periods for which an action is held
_BEGUN = 3.8  # s in which a sequence is begun, about
_FULL, _EMPTY = 4 / 3, 4.0  # times of nine tenths of the way in which muscles are full or empty
_SLOWEST = 4.0  # times of filling after which a joint is taken to be at its end, whatever it does
_HARDLY = 0.03  # share of its way; a joint that moves less in half a time of filling is at its end
_FAR = 1.0, 3.0  # how far muscles lean in sequences from an end, in the logarithm of the odds
_SPARSE = 0.35  # share of steps in which a muscle's valve opens in a sparse sequence


@dataclass(frozen=True)
class CollectSettings(Settings):
    """How transitions are collected."""

    actions: Annotated[int, Meta(ge=1, le=50_000)] | None = None
    """Actions of a sequence (thesis section 3.2.2: 200); by default that, or those of 6.7 s
    if the arm is controlled faster than there."""
    velocity_share: Share = 0.5
    """Share of sequences whose actions are held (the thesis decides "randomly")."""
    longest_hold: PositiveInt | None = None
    """Most control periods that an action is held, the least is 1 (the thesis does not say); by default 10, or
    those of a third of a second if they are more."""
    pulses: Share = 0.55
    """Share of the sequences in which valves open for pulses of random length, where the arm can do them; in the
    others they are open for whole periods, as in the thesis. A record of both serves controllers of both kinds."""
    sparse: Share = 0.45
    """Share of those in which most steps keep the valves closed and pulses are short, as near to rest."""
    inlets: Annotated[float, Meta(gt=0, lt=1)] | None = None
    """Share of inlets among the valves that open (the thesis: a half); by default such that the muscles of this arm,
    which may fill more slowly than they empty, are as often full as empty."""
    lean: Annotated[float, Meta(ge=0, le=10)] = 1.0
    """How far each muscle leans to inlets or to outlets for a whole sequence, drawn up to this in the logarithm of
    their odds (the thesis: 0); so one muscle goes up while the other goes down, as far as they can."""
    ends: Share = 0.0
    """Share of the sequences that begin at an end of the range (the thesis: 0): one muscle of each joint is full, the
    other empty. Both lean further than in the others, in turn to stay there and to go over to the other end. With
    0.25 goals lie wherever the arm can be, which takes longer to learn well."""
    begin: Annotated[CollectBegin | None, PythonOnly] = None
    """How a sequence is begun (thesis: inflations of 0 to 1200 ms; the other times are those of section 5.5); by
    default by times that this arm's muscles take to fill and to empty."""
    close_while_computing: Annotated[bool, PythonOnly] = False
    """Whether the valves are closed between reading and acting (thesis figure 2.8)."""

    def for_period(self, period: float) -> Self:
        """Return the settings with the numbers of control periods [s] that they stand for where none are given."""
        actions, held = (_periods(usual, period) for usual in (_ACTIONS, _HELD))
        return replace(self, actions=self.actions or actions, longest_hold=self.longest_hold or held)

    @property
    def complete(self) -> bool:
        """Whether nothing is left to how fast an arm's muscles fill and empty."""
        return self.begin is not None and self.inlets is not None

    def for_arm(self, times: FillTimes) -> Self:
        """Return the settings with what they leave to the ``times`` of an arm."""
        begin = CollectBegin(
            deflate=max(_EMPTY * times.emptying, CollectBegin.deflate), inflate=_FULL * times.filling
        )
        slowness = math.sqrt(times.filling / times.emptying)
        return replace(self, begin=self.begin or begin, inlets=self.inlets or slowness / (1 + slowness))


def _periods(usual: int, period: float) -> int:
    """Return how many periods [s] are as long as so many at the usual rate, and no fewer."""
    return max(usual, round(usual / (_USUAL_RATE * period)))


WHOLE_PERIODS = CollectSettings(pulses=0.0, inlets=0.5, lean=0.0, begin=CollectBegin())
"""As in the thesis: every valve that opens is open for whole control periods, on any arm for the same times."""


@dataclass(frozen=True)
class CollectResult:
    """What was collected, interrupted or not."""

    transitions: int
    """Transitions stored."""
    sequences: int
    """Sequences stored."""
    seconds: float
    """Time that it took on the arm's clock [s]."""
    wall_seconds: float
    """Time that this call took [s]."""
    peak_pressure: NDArray[np.float64]
    """Highest pressures read, shape (joints, 2) [counts]."""
    interventions: Interventions
    """How often the guard did what."""
    missed_deadlines: int
    """Points of the grid of control periods that passed without a turn within half a period."""
    link: dict[str, int] = field(default_factory=dict)
    """What happened on the link to the arm, by name; empty for an arm without one."""
    marked: dict[str, int] = field(default_factory=dict)
    """How many stored rows are marked, so that nothing is learned from them, by reason."""

    @property
    def counts(self) -> Counts:
        """What guard, control cycle and link counted."""
        return Counts(self.interventions, self.missed_deadlines, self.link)

    def __repr__(self) -> str:
        minutes = self.seconds / 60
        return f"<{self.transitions:,} transitions in {self.sequences:,} sequences, {minutes:.1f} min of the arm>"


@dataclass
class _Tally:
    """What is counted over all calls of one collection; kept in the store with each sequence."""

    seconds: float = 0.0
    interventions: dict[str, int] = field(default_factory=dict)
    missed_deadlines: int = 0
    peak_pressure: list[list[float]] = field(default_factory=list)
    link: dict[str, int] = field(default_factory=dict)
    fill_times: list[float] | None = None

    @property
    def counts(self) -> Counts:
        return Counts(Interventions(**self.interventions), self.missed_deadlines, self.link)

    def add(self, arm: GuardedArm, counts: Counts, seconds: float) -> None:
        self.seconds += seconds
        total = (self.counts + counts).as_dict()
        self.interventions, self.link = total["interventions"], total["link"]
        self.missed_deadlines = total["missed_deadlines"]
        peak = arm.peak_pressure
        self.peak_pressure = (np.maximum(peak, self.peak_pressure) if self.peak_pressure else peak).tolist()


def collect(
    arm: Arm,
    store: Store,
    transitions: int = 200_000,
    seed: int = 0,
    *,
    progress: Progress | None = None,
    settings: CollectSettings | None = None,
    controller: Controller | None = None,
    goals: ArrayLike | None = None,
    watch: Watch | None = None,
    exact: bool = False,
) -> CollectResult:
    """Collect at least ``transitions`` transitions in ``store``, going on where an earlier call was interrupted.

    Each sequence is durable before the next begins. A call that asks for more than is there goes on with the same
    collection; one that asks for less does nothing. Where the arm has a state, a collection that was interrupted and
    resumed equals an uninterrupted one bit for bit.

    Args:
        arm: any arm; it is closed when anything fails, and left open when all went well.
        store: a store made for this arm, open for writing.
        transitions: how many to have in the end.
        seed: of the begin states, actions and goals.
        progress: told after each sequence.
        settings: how; the thesis' way is :data:`WHOLE_PERIODS`.
        controller: what acts instead of random actions.
        goals: range (joints, 2) [counts] in which goals are drawn for ``controller``, one a sequence; by default
            the range of the angle's sensor.
        watch: sees every reading and marks what nothing may be learned from, such as a
            :class:`~pneumarm.control.Monitor`; marked transitions do not count as collected.
        exact: cut the last sequence short, so that no more are recorded than were asked for. By default all are
            whole, and asking for some and then for more gives what asking for all of them at once does.

    Raises:
        UnusableInput: fewer than 1,000 transitions, another arm or other settings than the store was begun with.
        ArmFailure: the arm failed, or something has been wrong for several sequences; what was stored before stays.
            The sequence that it failed in is not stored of an arm with a state, which can make it again; of one
            without, such as hardware, all of it that was read is, its last row marked.

    """
    settings = settings or CollectSettings()
    _check(arm, store, transitions, seed)
    begun = wall_clock.perf_counter()
    collection = _Collection(arm, store, seed, settings, controller, goals, watch)

    def record() -> None:
        if collection.done < transitions:
            collection.find_fill_times()
        while collection.done < transitions:
            collection.make_sequence(transitions - collection.done if exact else None)
            if progress is not None:
                progress(min(collection.done, transitions), transitions)

    try:
        collection.arm.despite_losses(record)
    except BaseException as error:
        with suppress(Exception):  # the first failure is the one to tell of
            arm.close()
        if isinstance(error, PneumarmError) or not isinstance(error, Exception):
            raise
        number = collection.number
        raise ArmFailure(
            f"{arm.spec.name}: failed while collecting sequence {number + 1} ({type(error).__name__}: {error}); "
            f"the {number} sequences before it are stored. Check the arm and run the same command again"
        ) from error
    return collection.result(wall_clock.perf_counter() - begun)


def recording_seconds(transitions: int, period: float = 1 / _USUAL_RATE) -> float:
    """Return about how long an arm controlled with this ``period`` [s] takes for so many transitions [s].

    Its sequences begin at rest, and getting there takes more than half as long as they do.
    """
    return transitions * period * (1 + _BEGUN * _USUAL_RATE / _ACTIONS)


def require_enough(transitions: int) -> None:
    """Raise UnusableInput where so few transitions are asked for that nothing can be learned from them."""
    if transitions < FEWEST_TRANSITIONS:
        raise UnusableInput(
            f"{transitions:,} transitions are too few to learn from; expected {FEWEST_TRANSITIONS:,} or more"
        )


def _check(arm: Arm, store: Store, transitions: int, seed: int) -> None:
    require_enough(transitions)
    if seed < 0:
        raise UnusableInput(f"a seed must be 0 or more, got {seed}")
    store.check_arm(arm.spec)


class _Collection:
    """One collection, made sequence after sequence, from where an earlier call has left it."""

    def __init__(
        self,
        arm: Arm,
        store: Store,
        seed: int,
        settings: CollectSettings,
        controller: Controller | None,
        goals: ArrayLike | None,
        watch: Watch | None,
    ) -> None:
        settings = settings.for_period(arm.spec.period)
        self._store, self._seed, self._settings = store, seed, settings
        self._controller, self._goals, self._watch = controller, goals, watch
        name = None if controller is None else type(controller).__name__
        self._run = store.resume_run(PURPOSE, {"seed": seed, "controller": name, **asdict(settings)})
        entries = [entry.transitions for entry in store.catalogue(self._run)]
        self.done, self.number = sum(entries), len(entries)
        """Transitions and sequences that are stored."""
        kept = {name: store.state(name) if self.number else None for name in ("collect", "arm", "watch")}
        self._tally = _Tally(**json.loads(kept["collect"])) if kept["collect"] is not None else _Tally()
        self.arm = guarded(arm)
        if kept["arm"] is not None:
            self.arm.set_state(kept["arm"])
        self._patience, self._doubtful = Patience(arm.spec.name), 0
        self._link: Mapping[str, int] = self.arm.link_counts()
        if watch is not None:
            if kept["watch"] is not None:
                watch.set_state(kept["watch"])
            warm_up_watch(watch, arm.spec)

    def find_fill_times(self) -> None:
        """Take what the settings leave to this arm from its fill times, found now or by an earlier call."""
        if self._settings.complete:
            return
        if self._tally.fill_times is None:
            start = self.arm.read().time
            self._tally.fill_times = list(find_fill_times(self.arm))
            self._tally.seconds += self.arm.read().time - start
        self._settings = self._settings.for_arm(FillTimes(*self._tally.fill_times))

    def make_sequence(self, most: int | None = None) -> None:
        """Bring the arm to a begin state, carry out one sequence, no longer than ``most`` actions, and store it."""
        arm, random = self.arm, np.random.default_rng([self._seed, self.number])
        cycle = ControlCycle(arm, self._settings.close_while_computing)
        before, start = replace(Counts.now(cycle), link=self._link), arm.read().time
        assert self._settings.begin is not None
        end = None if self._controller is not None else end_of(self.number, self._settings.ends, arm.spec.joints)
        if end is None:
            self._settings.begin.reach(arm, random)
        else:
            self._settings.begin.reach_end(arm, end.sides)
        kind, actor, info = self._actor(random, end)
        actions = self._settings.actions or 0
        remaining = iter(range(actions if most is None else min(actions, most)))

        def broken(steps: list[Step], why: BaseException) -> None:
            recorded = broken_off(steps, arm.spec, why, kind=kind, at_rest=True, info=info)
            self._count(Counts.now(cycle), before, steps[-1].reading.time - start if steps else 0.0)
            if recorded is not None and arm.get_state() is None:  # no arm can make it again
                with suppress(Exception):  # the first failure is the one to tell of
                    self._keep(recorded, whole=False)

        made = act_until(
            cycle,
            actor,
            lambda reading: next(remaining, None) is None,
            kind=kind,
            at_rest=True,
            info=info,
            watch=self._watch,
            broken=broken,
        )
        self._count(Counts.now(cycle), before, float(made.time[-1]) - start)
        self._keep(made, whole=True)

    def _count(self, now: Counts, before: Counts, seconds: float) -> None:
        """Count what happened in a sequence of so many ``seconds``, and on the link since the last one."""
        self._tally.add(self.arm, now - before, seconds)
        self._link = now.link

    def _actor(self, random: np.random.Generator, end: "End | None") -> tuple[str, Controller, Mapping[str, object]]:
        """Return the kind of the next sequence, what acts in it, and what else is kept with it."""
        spec = self.arm.spec
        if self._controller is None:
            kind, actor = random_actions(spec, self._settings, random, end)
            return kind, actor, {}
        span = np.asarray(spec.angle_range if self._goals is None else self._goals, np.float64)
        low, high = np.broadcast_to(span, (spec.joints, 2)).T
        goal = random.uniform(low, high)
        try:
            self._controller.reset(goal)
        except Exception as error:
            raise PneumarmError(f"the controller failed at a new goal ({type(error).__name__}: {error})") from error
        return "controller", self._controller, {"goal": goal.tolist()}

    def _keep(self, recorded: Recorded, *, whole: bool) -> None:
        """Store a sequence with all that is needed to go on after it, unless it broke off."""
        state, watch = {"collect": json.dumps(asdict(self._tally)).encode()}, self._watch
        if whole and (arm_state := self.arm.get_state()) is not None:
            state["arm"] = arm_state
        if watch is not None:
            recorded = replace(recorded, marks=(*watch.marks(recorded), *recorded.marks))
            self.done -= keep_watch(self._store, watch, self._run)
            state["watch"] = watch.get_state()
            if whole:
                self._patience.judge(watch, float(recorded.time[-1]))
        before, recorded = len(recorded.marks), with_doubtful_marked(recorded, self.arm.spec, valves=True)
        doubtful = recorded.marks[before:]
        self._store.append(recorded, state)
        self._doubtful = 0 if joinable(recorded.step, doubtful) else self._doubtful + 1
        if self._doubtful >= MOST_SPOILED and doubtful:
            raise ArmFailure(
                f"{self.arm.spec.name}: {doubtful[0].reason}, in {self._doubtful} sequences in a row; they are "
                "stored and marked, nothing can be learned of them. See to the sensor and run the same command again"
            )
        self.done += recorded.transitions
        self.number += 1

    def result(self, wall_seconds: float) -> CollectResult:
        """Return what there is of it now, after a call that took ``wall_seconds`` [s]."""
        tally = self._tally
        return CollectResult(
            transitions=self.done,
            sequences=self.number,
            seconds=tally.seconds,
            wall_seconds=wall_seconds,
            peak_pressure=np.array(tally.peak_pressure),
            interventions=tally.counts.interventions,
            missed_deadlines=tally.missed_deadlines,
            link=tally.link,
            marked=self._store.marked_rows(self._run),
        )


class End(NamedTuple):
    """Where a sequence begins at an end of the range, and where it goes to from there."""

    sides: NDArray[np.int64]
    """+1 for joints at the end of higher angles, -1 for the others, shape (joints,)."""
    stays: bool
    """Whether the muscles lean to this end, or to the other one."""

    def lean(self, random: np.random.Generator) -> NDArray[np.float64]:
        """Return how far each muscle leans to inlets, shape (joints, 2)."""
        towards = self.sides if self.stays else -self.sides
        return np.stack([towards, -towards], axis=1) * random.uniform(*_FAR, (len(towards), 2))


def end_of(number: int, share: float, joints: int) -> End | None:
    """Return at which end sequence ``number`` begins; None where it is none of the ``share`` that does.

    They come at equal distances from the first sequence on, so that few sequences have their share of them, too, and
    who watches the arm soon knows its ends. Sides are taken in turn, all of several joints with all of the others.
    """
    turn = math.floor(number * share)
    if math.floor((number - 1) * share) == turn:
        return None
    sides = np.array([1 if turn >> joint & 1 else -1 for joint in range(joints)])
    return End(sides, bool(turn >> joints & 1))


def random_actions(
    spec: ArmSpec, settings: CollectSettings, random: np.random.Generator, end: End | None = None
) -> tuple[str, Trajectory]:
    """Return one of the kinds of random sequences: its name and its commands; from an ``end`` if it begins there."""
    kind, commands = _random_commands(spec, settings, random, end)
    commands[..., spec.muscles :] = 0.0
    return kind, Trajectory(commands)


def _random_commands(
    spec: ArmSpec, settings: CollectSettings, random: np.random.Generator, end: End | None
) -> tuple[str, NDArray[np.float64]]:
    """Return the name and the commands (actions, joints, 2) of a sequence of joints with two muscles."""
    settings = settings.for_period(spec.period)
    assert settings.actions is not None
    assert settings.longest_hold is not None
    valves = _random_valves((settings.actions, spec.joints, 2), settings, random, end)
    drawn = np.tile(np.arange(settings.actions)[:, None], spec.joints)  # which action each step and joint does
    kind = "zero-velocity"
    if random.random() < settings.velocity_share:
        kind = "velocity"
        for joint in range(spec.joints):
            lengths = random.integers(1, settings.longest_hold, size=settings.actions, endpoint=True)
            drawn[:, joint] = np.repeat(drawn[:, joint], lengths)[: settings.actions]
    if settings.pulses and spec.pulses and random.random() < settings.pulses:
        return _random_pulses(spec, settings, random, end)
    return kind, valves[drawn, np.arange(spec.joints)].astype(np.float64)


def _random_valves(
    shape: tuple[int, int, int], settings: CollectSettings, random: np.random.Generator, end: End | None
) -> NDArray[np.int64]:
    """Return valves (steps, joints, 2), each closed with a probability of a third, and else an inlet or an outlet."""
    inlets = 0.5 if settings.inlets is None else settings.inlets
    lean = random.uniform(-settings.lean, settings.lean, shape[1:]) if end is None else end.lean(random)
    odds = inlets / (1 - inlets) * np.exp(lean)
    side = np.where(random.random(shape) < odds / (1 + odds), 1, -1)
    return np.where(random.random(shape) < 1 / 3, 0, side)


def _random_pulses(
    spec: ArmSpec, settings: CollectSettings, random: np.random.Generator, end: End | None
) -> tuple[str, NDArray[np.float64]]:
    """Return a sequence of pulses, every muscle for itself: some repeated over a few periods, or few short ones."""
    shortest = min(spec.shortest_pulse / spec.period, 1.0)
    actions = settings.actions or 0
    shape = (actions, spec.joints, 2)
    valves, shares = _random_valves(shape, settings, random, end), random.uniform(shortest, 1.0, shape)
    if random.random() < settings.sparse:
        opened = random.random(shape) < _SPARSE
        return "sparse", (valves * opened).astype(np.float64) * np.maximum(shares**2, shortest)
    commands = (valves * shares).reshape(actions, -1)
    longest = _periods(_LONGEST_PULSES, spec.period)
    for muscle in range(commands.shape[1]):
        lengths = random.integers(1, longest, size=actions, endpoint=True)
        commands[:, muscle] = np.repeat(commands[:, muscle], lengths)[:actions]
    return "pulses", commands.reshape(shape)
