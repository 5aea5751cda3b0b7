"""Moving to a goal and holding it, and following a reference, on any arm, with figures for people.

When a goal is *settled* at says :mod:`.settling`, what a *valve change* is :mod:`pneumarm.task.changes`. The *rest
error* is the mean absolute error over the last second of the hold.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm import Arm, ArmSpec, ControlCycle, GuardedArm, Reading, guarded
from pneumarm.arm.controller import Controller, TrackingController
from pneumarm.arm.hand import hand
from pneumarm.arm.reference import Reference
from pneumarm.drawing.moving_arm import Shown, moving_arm
from pneumarm.errors import UnusableInput
from pneumarm.moving.settling import DWELL, TOLERANCE, settled_at
from pneumarm.settings import Settings
from pneumarm.task.changes import valve_changes
from pneumarm.task.goals import Goal
from pneumarm.transitions.recorder import Recorder
from pneumarm.transitions.rows import Recorded
from pneumarm.transitions.watch import Watch, act_until

KIND = "movement"
"""Kind of the sequence that a movement is."""
LEAD_IN = 2.0
"""Time in which the arm moves to where a reference begins, before that begins [s]."""
SECONDS = 20.0
"""For how long a reference without an end is followed, unless it is said otherwise [s]."""
Seen = Callable[[Reading, NDArray[np.float64]], None]
"""Called with every reading and the angles (joints,) wanted at that time [counts]."""


@dataclass(frozen=True)
class MoveSettings(Settings):
    """How a goal is moved to."""

    hold: Annotated[float, Meta(gt=0, le=86_400)] = 2.0
    """For how long a goal is held, from when it is given [s]."""
    tries: Annotated[int, Meta(ge=1, le=100)] = 2
    """How often a movement that has not settled is made (thesis section 5.6.1)."""
    tolerance: Annotated[float, Meta(gt=0, lt=360)] = TOLERANCE
    """A joint is there within so much [degrees]."""
    pause: Annotated[float, Meta(ge=0, le=3600)] = 2.0
    """Time between two tries, with closed valves [s] (thesis section 5.6.1)."""
    dwell: Annotated[float, Meta(ge=0, le=3600)] = DWELL
    """For how long it stays there at least, to the end of the hold, to have settled [s]; half of a shorter hold."""


@dataclass(frozen=True)
class Moved:
    """A goal that was given, and what came of it. Times are on the arm's clock [s]."""

    goal: NDArray[np.float64]
    """Shape (joints,) [counts]."""
    time_start: float
    """When the goal was given: the beginning of the first try."""
    time_settled: float | None
    """Since when all joints stayed within the tolerance; None where they did not, or not for the dwell time."""
    rest_error: NDArray[np.float64]
    """Shape (joints,) [degrees]."""
    overshoot: NDArray[np.float64]
    """How far each joint went beyond the goal in its direction, shape (joints,) [degrees]."""
    tries: int
    switches: int
    """Valve changes of all tries."""
    air: float | None
    """Air taken from the supply in all tries [normal litres]; None where the arm cannot say."""
    recorded: Recorded
    """The last try."""
    spec: ArmSpec
    """The arm."""
    goal_xy: NDArray[np.float64] | None = None
    """Where the hand was to be, shape (2,) [m]; None where the goal was given in angles."""

    @property
    def goal_degrees(self) -> NDArray[np.float64]:
        """The goal in degrees from the middle of the range, shape (joints,)."""
        return self.spec.degrees(self.goal)

    @property
    def time(self) -> NDArray[np.float64]:
        """Times of the readings of the last try, from its beginning, shape (n,) [s]."""
        return self.recorded.time - self.recorded.time[0]

    @property
    def degrees(self) -> NDArray[np.float64]:
        """Angles at the readings of the last try, shape (n, joints) [degrees from the middle of the range]."""
        return self.spec.degrees(self.recorded.angle)

    @property
    def hand_error(self) -> float | None:
        """Mean distance of the hand from ``goal_xy`` over the last second of the hold [m]; None without one."""
        if self.goal_xy is None:
            return None
        there = hand(self.degrees[_last_second(self.recorded.time)], self.spec.links)
        return float(np.linalg.norm(there - self.goal_xy, axis=1).mean())

    @property
    def changes_at_rest(self) -> NDArray[np.int64]:
        """Valve changes in the last second of the hold, of each joint, shape (joints,)."""
        commands, late = self.recorded.command[:-1], _last_second(self.recorded.time)[:-1]
        changed = valve_changes(commands) - valve_changes(commands[~late])
        return changed.sum(axis=1)

    @property
    def success(self) -> bool:
        """Whether it settled."""
        return self.time_settled is not None

    def results(self) -> dict[str, Any]:
        """Return it as ``pneumarm move --json`` tells it."""
        found = {
            "goal_deg": self.goal_degrees.round(4).tolist(),
            "time_start": self.time_start,
            "time_settled": self.time_settled,
            "rest_error_deg": self.rest_error.round(4).tolist(),
            "overshoot_deg": self.overshoot.round(4).tolist(),
            "success": self.success,
            "tries": self.tries,
            "switches": self.switches,
            "air_litres": self.air,
        }
        if self.goal_xy is not None and self.hand_error is not None:
            found |= {"goal_xy_m": self.goal_xy.tolist(), "rest_error_m": round(self.hand_error, 6)}
        return found

    def __repr__(self) -> str:
        goal, rest = _listed(self.goal_degrees, ".1f"), _listed(self.rest_error, ".2f")
        after = (
            "not settled"
            if self.time_settled is None
            else f"settled after {self.time_settled - self.time_start:.2f} s"
        )
        return f"<Moved to {goal} deg: {after}, rest error {rest} deg>"

    def _repr_html_(self) -> str:
        return _picture(self.recorded, np.broadcast_to(self.goal, self.recorded.angle.shape), self.spec)


@dataclass(frozen=True)
class Tracked:
    """A reference that was followed. Times are on the arm's clock [s]."""

    time_start: float
    """When the reference began."""
    seconds: float
    rms_error: NDArray[np.float64]
    """Root of the mean squared error over all readings, shape (joints,) [degrees]."""
    switches: int
    air: float | None
    """Air taken from the supply [normal litres]; None where the arm cannot say."""
    recorded: Recorded
    wanted: NDArray[np.float64]
    """What the reference asked for at each reading, shape (n, joints) [counts]."""
    spec: ArmSpec
    """The arm."""

    @property
    def time(self) -> NDArray[np.float64]:
        """Times of the readings, from the beginning of the reference, shape (n,) [s]."""
        return self.recorded.time - self.time_start

    @property
    def degrees(self) -> NDArray[np.float64]:
        """Angles at the readings, shape (n, joints) [degrees from the middle of the range]."""
        return self.spec.degrees(self.recorded.angle)

    @property
    def wanted_degrees(self) -> NDArray[np.float64]:
        """What the reference asked for at each reading, shape (n, joints) [degrees from the middle of the range]."""
        return self.spec.degrees(self.wanted)

    def results(self) -> dict[str, Any]:
        """Return it as ``pneumarm track --json`` tells it."""
        return {
            "time_start": self.time_start,
            "seconds": self.seconds,
            "rms_error_deg": self.rms_error.round(4).tolist(),
            "switches": self.switches,
            "air_litres": self.air,
        }

    def __repr__(self) -> str:
        return f"<Tracked for {self.seconds:.1f} s: RMS error {_listed(self.rms_error, '.2f')} deg>"

    def _repr_html_(self) -> str:
        return _picture(self.recorded, self.wanted, self.spec)


def at_period(arm: Arm, period: float) -> Arm:
    """Return ``arm``, as it was opened, controlled with another ``period`` [s].

    The latency of a modelled arm shrinks with the period: who controls it faster computes faster.
    """
    if isinstance(arm, GuardedArm):
        raise UnusableInput("the control period of an arm is chosen before it is guarded")
    faster = min(period / arm.spec.period, 1.0)
    arm.spec = replace(arm.spec, period=period, latency=arm.spec.latency * faster)
    return arm


def move(
    arm: Arm,
    controller: Controller,
    goals: Iterable[Goal | ArrayLike],
    settings: MoveSettings = MoveSettings(),
    *,
    watch: Watch | None = None,
    seen: Seen | None = None,
    record: Recorder | None = None,
) -> Iterator[Moved]:
    """Move ``arm`` to one goal (joints,) [counts] after the other, hold each, and yield what came of it.

    Args:
        arm: any arm; it is guarded here where it is not yet.
        controller: what acts. One that cannot hold a goal is to be wrapped in :class:`~pneumarm.moving.Holding`.
        goals: in order, each a :class:`~pneumarm.task.goals.Goal` or its angles; the next is taken when the one
            before has been held.
        settings: how long to hold, how often to try, how near is there.
        watch: sees every reading, such as a :class:`~pneumarm.control.Monitor`.
        seen: called with every reading, for a display.
        record: stores every try as it happens, see :func:`~pneumarm.transitions.recorder.recorder`.

    """
    cycle = ControlCycle(guarded(arm))
    for goal in goals:
        wanted = goal if isinstance(goal, Goal) else Goal(np.array(goal, np.float64).reshape(-1))
        moved = _move_to(cycle, controller, wanted.angle, settings, watch, seen, record)
        yield replace(moved, goal_xy=wanted.xy)


def track(
    arm: Arm,
    controller: TrackingController,
    reference: Reference,
    seconds: float,
    *,
    lead_in: float = LEAD_IN,
    watch: Watch | None = None,
    seen: Seen | None = None,
    record: Recorder | None = None,
) -> Tracked:
    """Move ``arm`` to where ``reference`` begins, then follow it for ``seconds``; see :func:`move` for the rest.

    Where it is known ahead, it is known while the arm moves to its beginning, too; that movement is not recorded.
    """
    check_seconds(seconds)
    cycle = ControlCycle(guarded(arm))

    def follow() -> Tracked:
        cycle.arm.make_ready()
        coming = replace(reference, at=lambda time: reference.at(max(time - lead_in, 0.0)))
        controller.reset(reference.at(0.0))
        controller.track(coming)
        before = played(cycle, controller, lead_in, coming.at, watch, seen) if lead_in > 0 else None
        air = cycle.arm.air_used()
        recorded = played(cycle, controller, seconds, reference.at, watch, seen, record)
        # Turns come milliseconds early or late: the reference began when it was said to, not with a turn.
        start = float(recorded.time[0] if before is None else before.time[0] + lead_in)
        passed = recorded.time - start
        wanted = np.array([reference.at(max(float(time), 0.0)) for time in passed])
        error = (recorded.angle - wanted) / cycle.arm.spec.counts_per_degree
        return Tracked(
            time_start=start,
            seconds=float(passed[-1]),
            rms_error=np.sqrt((error**2).mean(axis=0)),
            switches=int(valve_changes(recorded.command[:-1]).sum()),
            air=_air_since(cycle.arm, air),
            recorded=recorded,
            wanted=wanted,
            spec=cycle.arm.spec,
        )

    return cycle.arm.despite_losses(follow)


def played(
    cycle: ControlCycle,
    controller: Controller,
    seconds: float,
    wanted: Callable[[float], NDArray[np.float64]],
    watch: Watch | None = None,
    seen: Seen | None = None,
    record: Recorder | None = None,
    info: Mapping[str, Any] | None = None,
) -> Recorded:
    """Let ``controller`` act for ``seconds`` on the arm's clock; return all that was read and applied.

    ``record`` keeps that as it happens, with ``info``.
    """
    begin: float | None = None

    def is_over(reading: Reading) -> bool:
        nonlocal begin
        begin = reading.time if begin is None else begin
        passed = reading.time - begin
        if seen is not None:
            seen(reading, wanted(passed))
        # The last turn is the one nearest to the end: a late one must not add another period.
        return passed > seconds - cycle.arm.spec.period / 2

    with nullcontext() if record is None else record.sequence(KIND, info or {}) as keep:
        return act_until(cycle, controller, is_over, kind=KIND, at_rest=False, watch=watch, keep=keep)


def check_seconds(seconds: float) -> None:
    """Raise UnusableInput where a reference cannot be followed for ``seconds``."""
    if not 0 < seconds <= 86400:
        raise UnusableInput(f"a reference is followed for up to 86400 s, got {seconds}")


def _move_to(
    cycle: ControlCycle,
    controller: Controller,
    goal: NDArray[np.float64],
    settings: MoveSettings,
    watch: Watch | None,
    seen: Seen | None,
    record: Recorder | None,
) -> Moved:
    arm, spec = cycle.arm, cycle.arm.spec
    if goal.shape != (spec.joints,) or not np.isfinite(goal).all():
        raise UnusableInput(f"a goal needs {spec.joints} finite angle(s) in counts, got {goal}")
    switches, air, start = 0, arm.air_used(), arm.read().time

    def one_try() -> Recorded:
        arm.make_ready()
        controller.reset(goal)
        asked = {"goal": goal.tolist()}
        return played(cycle, controller, settings.hold, lambda time: goal, watch, seen, record, asked)

    for number in range(1, settings.tries + 1):
        recorded = arm.despite_losses(one_try)
        switches += int(valve_changes(recorded.command[:-1]).sum())
        error = (recorded.angle - goal) / spec.counts_per_degree
        dwell = min(settings.dwell, settings.hold / 2)
        settled = settled_at(recorded.time, error, settings.tolerance, dwell)
        if settled is not None or number == settings.tries:
            break
        arm.despite_losses(lambda: arm.wait(settings.pause))
    direction = -np.sign(error[0])
    return Moved(
        goal=goal,
        time_start=start,
        time_settled=settled,
        rest_error=np.abs(error[_last_second(recorded.time)]).mean(axis=0),
        overshoot=np.maximum((direction * error).max(axis=0), 0.0),
        tries=number,
        switches=switches,
        air=_air_since(arm, air),
        recorded=recorded,
        spec=spec,
    )


def _last_second(times: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(times > times[-1] - 1)


def _air_since(arm: GuardedArm, before: float | None) -> float | None:
    now = arm.air_used()
    return None if now is None or before is None else now - before


def _listed(values: NDArray[np.float64], form: str) -> str:
    return ", ".join(format(value, form) for value in values)


def _picture(recorded: Recorded, wanted: NDArray[np.float64], spec: ArmSpec) -> str:
    """Return an SVG that plays what was ``recorded``, for a notebook."""
    command = np.nan_to_num(recorded.command)
    return moving_arm(Shown(spec, recorded.time, recorded.angle, wanted, recorded.pressure, command))
