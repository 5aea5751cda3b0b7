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
import time as wall_clock
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.controller import Controller
from pneumarm.arm.counts import Counts
from pneumarm.arm.cycle import BeginState, ControlCycle, Step
from pneumarm.arm.guard import GuardedArm, Interventions, guarded
from pneumarm.arm.seam import Arm, ArmSpec, Reading
from pneumarm.arm.valves import ACTIONS, Command, to_valves
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.settings import Settings, Valid
from pneumarm.transitions.players import Trajectory
from pneumarm.transitions.rows import Recorded, broken_off
from pneumarm.transitions.store import Store
from pneumarm.transitions.watch import Watch, keep_watch, warm_up, watched

KINDS = ("zero-velocity", "velocity", "controller")
"""Kinds of the sequences made here."""
FEWEST_TRANSITIONS = 2_000
"""Fewer cannot be learnt from."""
MOST_SPOILED = 5
"""Sequences in a row in which something may be wrong before collecting gives up."""
PURPOSE = "collect"
"""The purpose of the runs made here."""

Progress = Callable[[int, int], None]
"""Called with the transitions stored so far and those asked for."""


@dataclass(frozen=True)
class CollectBegin(BeginState):
    """How the arm is brought to the begin state of a sequence at rest."""

    inflate: float = 1.2
    """Longest time that a muscle is inflated again [s] (thesis section 3.2.2: 1.2)."""


@dataclass(frozen=True)
class CollectSettings(Settings):
    """How transitions are collected."""

    actions: int = 200
    """Actions of a sequence (thesis section 3.2.2: 200)."""
    velocity_share: float = 0.5
    """Share of sequences whose actions are held (the thesis decides "randomly")."""
    longest_hold: int = 10
    """Most control periods that an action is held, the least is 1 (the thesis does not say)."""
    pulses: float = 0.0
    """Share of the openings that are pulses of random length, where the arm can do them; the others last the whole
    period, as in the thesis. A record of both serves controllers with pulses and without."""
    begin: CollectBegin = field(default_factory=CollectBegin)
    """How a sequence is begun (thesis: inflations of 0 to 1200 ms; the other times are those of section 5.5)."""
    close_while_computing: bool = False
    """Whether the valves are closed between reading and acting (thesis figure 2.8)."""

    def _valid(self) -> Valid:
        return {
            "actions": 1 <= self.actions <= 50_000,
            "velocity_share": 0 <= self.velocity_share <= 1,
            "longest_hold": self.longest_hold >= 1,
            "pulses": 0 <= self.pulses <= 1,
        }


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


@dataclass
class _Tally:
    """What is counted over all calls of one collection; kept in the store with each sequence."""

    seconds: float = 0.0
    interventions: dict[str, int] = field(default_factory=dict)
    missed_deadlines: int = 0
    peak_pressure: list[list[float]] = field(default_factory=list)
    link: dict[str, int] = field(default_factory=dict)

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
) -> CollectResult:
    """Collect at least ``transitions`` transitions in ``store``, going on where an earlier call was interrupted.

    Only whole sequences are stored, each durable before the next begins. A call that asks for more than is there
    goes on with the same collection; one that asks for less does nothing. Where the arm has a state, a collection
    that was interrupted and resumed equals an uninterrupted one bit for bit.

    Args:
        arm: any arm; it is closed when anything fails, and left open when all went well.
        store: a store made for this arm, open for writing.
        transitions: how many to have in the end.
        seed: of the begin states, actions and goals.
        progress: told after each sequence.
        settings: how; the thesis' way by default.
        controller: what acts instead of random actions.
        goals: range (joints, 2) [counts] in which goals are drawn for ``controller``, one a sequence; by default
            the range of the angle's sensor.
        watch: sees every reading and marks what nothing may be learned from, such as a
            :class:`~pneumarm.control.Monitor`; marked transitions do not count as collected.

    Raises:
        UnusableInput: fewer than 2,000 transitions, another arm or other settings than the store was begun with.
        ArmFailure: the arm failed, or something has been wrong for several sequences; what was stored before stays.
            The sequence that it failed in is not stored of an arm with a state, which can make it again; of one
            without, such as hardware, all of it that was read is, its last row marked.

    """
    settings = settings or CollectSettings()
    _check(arm, store, transitions, seed)
    begun = wall_clock.perf_counter()
    run = store.resume_run(PURPOSE, _as_settings(settings, seed, controller))
    entries = [entry.transitions for entry in store.catalogue(run)]
    done, number = sum(entries), len(entries)
    tally = _restored(arm, store, resumed=number > 0)
    guard = guarded(arm)
    if watch is not None and number and (seen := store.state("watch")) is not None:
        watch.set_state(seen)
    if watch is not None:
        warm_up(watch, arm.spec)
    wrong = 0

    def keep_broken(recorded: Recorded) -> None:
        """Store what there is of a sequence that no arm can make again."""
        state = {"collect": json.dumps(asdict(tally)).encode()}
        if watch is not None:
            recorded = replace(recorded, marks=(*watch.marks(recorded), *recorded.marks))
            keep_watch(store, watch, run)
            state["watch"] = watch.get_state()
        store.append(recorded, state)

    try:
        while done < transitions:
            random = np.random.default_rng([seed, number])
            recorded = _sequence(guard, tally, settings, random, controller, goals, watch, keep_broken)
            state = {"collect": json.dumps(asdict(tally)).encode()}
            if (arm_state := guard.get_state()) is not None:
                state["arm"] = arm_state
            if watch is not None:
                recorded = replace(recorded, marks=watch.marks(recorded))
                done -= keep_watch(store, watch, run)
                state["watch"] = watch.get_state()
                wrong = _still_wrong(arm, watch, wrong)
            store.append(recorded, state)
            done += recorded.transitions
            number += 1
            if progress is not None:
                progress(min(done, transitions), transitions)
    except BaseException as error:
        with suppress(Exception):  # the first failure is the one to tell of
            arm.close()
        if isinstance(error, PneumarmError) or not isinstance(error, Exception):
            raise
        raise ArmFailure(
            f"{arm.spec.name}: failed while collecting sequence {number + 1} ({type(error).__name__}: {error}); "
            f"the {number} sequences before it are stored. Check the arm and run the same command again"
        ) from error
    return CollectResult(
        transitions=done,
        sequences=number,
        seconds=tally.seconds,
        wall_seconds=wall_clock.perf_counter() - begun,
        peak_pressure=np.array(tally.peak_pressure),
        interventions=Interventions(**tally.interventions),
        missed_deadlines=tally.missed_deadlines,
        link=tally.link,
        marked=store.marked_rows(run),
    )


def _still_wrong(arm: Arm, watch: Watch, before: int) -> int:
    """Return for how many sequences something has been wrong; raise ArmFailure where that is no passing trouble."""
    found = watch.spoiled_since()
    if found is None:
        return 0
    if before + 1 >= MOST_SPOILED:
        raise ArmFailure(
            f"{arm.spec.name}: {found[1]}, for {MOST_SPOILED} sequences now; nothing can be learned from that: "
            "see to the arm and run the same command again"
        )
    return before + 1


def enough(transitions: int) -> bool | str:
    """Return whether something can be learned from so many ``transitions``, or what is expected in their place."""
    return transitions >= FEWEST_TRANSITIONS or f"{FEWEST_TRANSITIONS:,} or more"


def require_enough(transitions: int) -> None:
    """Raise UnusableInput where so few transitions are asked for that nothing can be learned from them."""
    if (found := enough(transitions)) is not True:
        raise UnusableInput(f"{transitions:,} transitions are too few to learn from; expected {found}")


def _check(arm: Arm, store: Store, transitions: int, seed: int) -> None:
    require_enough(transitions)
    if seed < 0:
        raise UnusableInput(f"a seed must be 0 or more, got {seed}")
    if not store.valves:
        raise UnusableInput(f"{store.path}: holds continuous commands; collect into a store of its own")
    mine, kept = asdict(arm.spec), asdict(store.spec)
    different = [f"{name} was {kept[name]!r}, is {mine[name]!r}" for name in kept if mine[name] != kept[name]]
    if different:
        raise UnusableInput(f"{store.path}: was made for another arm ({'; '.join(different)}); give another file")


def _as_settings(settings: CollectSettings, seed: int, controller: Controller | None) -> dict[str, object]:
    name = None if controller is None else type(controller).__name__
    return {"seed": seed, "controller": name, **asdict(settings)}


def _restored(arm: Arm, store: Store, resumed: bool) -> _Tally:
    """Put the arm back to where the last stored sequence left it, and return what was counted until then."""
    kept = store.state("collect")
    if not resumed or kept is None:
        return _Tally()
    state = store.state("arm")
    if state is not None:
        arm.set_state(state)
    return _Tally(**json.loads(kept))


def _sequence(
    arm: GuardedArm,
    tally: _Tally,
    settings: CollectSettings,
    random: np.random.Generator,
    controller: Controller | None,
    goals: ArrayLike | None,
    watch: Watch | None,
    keep_broken: Callable[[Recorded], None],
) -> Recorded:
    """Bring the arm to a begin state, carry out one sequence, and return what was read."""
    cycle = ControlCycle(arm, settings.close_while_computing)
    before = Counts.now(cycle)
    start = arm.read().time
    settings.begin.reach(arm, random)
    info: Mapping[str, object] = {}
    actor: Controller
    if controller is None:
        kind, actor = random_actions(arm.spec, settings, random)
        actor.reset(np.zeros(arm.spec.joints))
    else:
        kind, actor = "controller", controller
        goal = _goal(arm, goals, random)
        info = {"goal": goal.tolist()}
        _told(actor, goal)
    remaining = iter(range(settings.actions))

    def decide(reading: Reading) -> Command | None:
        return None if next(remaining, None) is None else actor.act(reading)

    def broken(steps: list[Step], why: BaseException) -> None:
        recorded = broken_off(steps, arm.spec, why, kind=kind, at_rest=True, info=info)
        tally.add(arm, Counts.now(cycle) - before, steps[-1].reading.time - start if steps else 0.0)
        if recorded is not None and arm.get_state() is None:
            with suppress(Exception):  # the first failure is the one to tell of
                keep_broken(recorded)

    steps = watched(cycle.run(decide), watch, at_rest=True, broken=broken)
    tally.add(arm, Counts.now(cycle) - before, steps[-1].reading.time - start)
    return Recorded.from_steps(steps, arm.spec, kind=kind, at_rest=True, info=info)


def random_actions(spec: ArmSpec, settings: CollectSettings, random: np.random.Generator) -> tuple[str, Trajectory]:
    """Return one of the two kinds of random sequences: its name and its commands."""
    actions = random.integers(ACTIONS, size=(settings.actions, spec.joints))
    drawn = np.tile(np.arange(settings.actions)[:, None], spec.joints)  # which action each step and joint does
    kind = "zero-velocity"
    if random.random() < settings.velocity_share:
        kind = "velocity"
        for joint in range(spec.joints):
            lengths = random.integers(1, settings.longest_hold, size=settings.actions, endpoint=True)
            drawn[:, joint] = np.repeat(drawn[:, joint], lengths)[: settings.actions]
    commands = to_valves(actions).astype(np.float64)
    if settings.pulses and spec.pulses:
        shortest = min(spec.shortest_pulse / spec.period, 1.0)
        shares = random.uniform(shortest, 1.0, commands.shape)
        commands *= np.where(random.random(commands.shape) < settings.pulses, shares, 1.0)
    return kind, Trajectory(commands[drawn, np.arange(spec.joints)])


def _goal(arm: Arm, goals: ArrayLike | None, random: np.random.Generator) -> NDArray[np.float64]:
    spec = arm.spec
    span = np.broadcast_to(np.asarray(spec.angle_range if goals is None else goals, np.float64), (spec.joints, 2))
    return random.uniform(span[:, 0], span[:, 1])


def _told(controller: Controller, goal: NDArray[np.float64]) -> None:
    try:
        controller.reset(goal)
    except Exception as error:
        raise PneumarmError(f"the controller failed at a new goal ({type(error).__name__}: {error})") from error
