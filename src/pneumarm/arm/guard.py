"""The guard between any controller and any arm: what could harm is replaced, counted, and never reaches a valve.

What is asked for passes four rules, in this order:

1. *Sense*: valves are (joints, 2) of -1, 0, +1, pulses of -1 to +1. A controller that gives anything else, that
   raises, or that takes longer than a control period is replaced: what was last applied is held, then everything is
   vented, in the end the controller is stopped (:meth:`GuardedArm.decide`, :meth:`GuardedArm.replace`).
2. *Pressure*: an inlet stays closed while its muscle reads over ``spec.max_pressure``. An arm that measures no
   pressures needs a supply that cannot burst a muscle instead, and somebody who says that it is so
   (``spec.safe_supply``); readings then carry estimates in their place (:mod:`pneumarm.arm.fill`).
3. *Time of inflation*: an inlet that was open for ``spec.max_inflation`` stays closed until its muscle has rested as
   long, or has been vented for a tenth of it. A muscle that takes air for so long without reaching its limit is
   unplugged, burst, or its pressure sensor does not see it.
4. *Angle*: at an end of ``spec.angle_limits``, valves that push further out (air into the muscle that pulls there,
   air out of the other) stay closed. A joint may always be vented whole.

Where joints have one muscle, valves of the second stay closed whatever is asked for.

Pulses are rounded to what the arm can do (:meth:`ArmSpec.possible`). On an arm that cannot time them itself
(:meth:`Arm.set_pulses`) the guard does: it cuts the wait after them where one ends, and closes its valve.

While a controller does not come back with a decision, the guard stands in for it (:meth:`GuardedArm.stand_in`, called
by the :class:`~pneumarm.arm.watchdog.Watchdog`): it holds, then vents, and in the end the controller is interrupted.
"""

import atexit
import math
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.fill import EstimatedArm
from pneumarm.arm.own import OwnArm, owned
from pneumarm.arm.seam import Arm, Reading, checked
from pneumarm.arm.valves import Command
from pneumarm.arm.watchdog import Watchdog
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.errors import ArmFailure, ControllerFailure, LineLost, PneumarmError, UnusableInput

_SETTINGS = frozenset((-1, 0, 1))
HELD = 0.1
"""Time without a decision for which the valves are held [s], one control period at least; then they are vented."""
REPLACED = 1.0
"""Decisions in a row that make up this time [s], one at least, are replaced; the one after stops the controller."""
_ROUNDED = 1e-9
"""Periods add up to a time but for so much [s]."""
VENTING = 10.0
"""How many times faster a muscle recovers from inflation by venting than by resting."""

Reason = Literal["nonsense", "raised", "late"]
Result = TypeVar("Result")

_open_arms: "weakref.WeakValueDictionary[int, Arm]" = weakref.WeakValueDictionary()


@atexit.register
def _close_open_arms() -> None:
    """Close what nobody closed before the interpreter ends."""
    for arm in list(_open_arms.values()):
        with suppress(Exception, SystemExit):  # the other arms are to be closed too
            arm.close()


@dataclass
class Interventions:
    """How often the guard did what."""

    pressure: int = 0
    """Inlets kept closed because their muscle read over its limit."""
    inflation: int = 0
    """Inlets kept closed because they had been open for too long."""
    angle: int = 0
    """Valves kept closed because they push out of the limits of the angle."""
    nonsense: int = 0
    """Decisions replaced that were no valves: NaN, other numbers, another shape, nothing like it."""
    raised: int = 0
    """Decisions replaced because the controller raised an error."""
    late: int = 0
    """Decisions replaced because they came more than a control period after their reading."""
    vented: int = 0
    """How many of the decisions that were replaced were so by venting, not by holding."""

    @property
    def total(self) -> int:
        """Valves kept closed and decisions replaced."""
        return sum(astuple(self)) - self.vented

    @property
    def replaced(self) -> int:
        """Decisions replaced."""
        return self.nonsense + self.raised + self.late

    @property
    def limited(self) -> int:
        """Valves kept closed at limits that a sound arm does not reach: of the angle, of the time of inflation."""
        return self.angle + self.inflation

    def __add__(self, other: "Interventions") -> "Interventions":
        return Interventions(*[a + b for a, b in zip(astuple(self), astuple(other), strict=True)])

    def __sub__(self, other: "Interventions") -> "Interventions":
        return Interventions(*[a - b for a, b in zip(astuple(self), astuple(other), strict=True)])

    def __str__(self) -> str:
        said = [f"{count} x {name}" for name, count in vars(self).items() if count]
        return ", ".join(said) or "none"


class GuardedArm(Arm):
    """An arm behind the guard: its readings are checked and its limits hold, whoever sets its valves.

    Waits with an open inlet are cut into control periods with a reading between them, so that the limits also
    hold during a long inflation. ``applied`` is the command as it was really given to the arm: int8 valves, or
    float64 pulses where one of them ends before its period does. An arm that nobody closed is closed when the
    interpreter ends.
    """

    def __init__(self, arm: Arm) -> None:
        """Put the guard before ``arm``.

        Raises:
            UnusableInput: it measures no pressures, and nobody has said that its supply is safe.

        """
        self._opened = arm
        arm = owned(arm)
        if not arm.spec.pressure_sensors:
            if not arm.spec.safe_supply:
                arm.close()
                raise UnusableInput(
                    f"{arm.spec.name}: without pressure sensors only the supply keeps muscles from bursting; set "
                    "it to what every muscle bears and say so, by safe_supply = true in the arm's spec or arm.toml"
                )
            arm = arm if isinstance(arm, EstimatedArm) else EstimatedArm(arm)
        self.arm = arm
        self.spec = arm.spec
        self._valves: NDArray[np.int8] = np.zeros((arm.spec.joints, 2), np.int8)  # as they are now
        self._closing: dict[int, float] = {}  # when pulses end, by flat place [s]
        self._times_pulses = False  # whether the arm ends them itself
        self._now = 0.0  # the arm's clock, as of the last reading and the waits since [s]
        self.applied: Command = self._valves
        self.peak_pressure = np.zeros((arm.spec.joints, 2))
        """Highest pressures read, shape (joints, 2) [counts]; of estimates where none are measured."""
        self._interventions = Interventions()
        self._limit = arm.spec.max_pressure_counts if arm.spec.pressure_sensors else math.inf
        self._over: NDArray[np.bool_] | None = None  # which muscles read over the limit; None if none does
        self._outward: NDArray[np.int8] | None = None  # valves that push out of the angle's limits; None if none does
        self._inflation = _Inflation(arm.spec.max_inflation, self.applied.size)
        self._inflating = False
        self._replaced = 0  # decisions in a row
        self._undecided = 0.0  # time without a decision of the controller [s]
        self._held = max(HELD, self.spec.period) + _ROUNDED
        self._most_replaced = max(round(REPLACED / self.spec.period), 1)
        self._waits_itself = _waits_itself(arm)
        self._time = -math.inf  # of the last reading
        self.watchdog = Watchdog(self)
        """Looks after a decision while it is out."""
        _open_arms[id(self._opened)] = self._opened

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy takes up, with the state of the arm behind; an arm that has none is refused."""
        if self.get_state() is None:
            raise UnusableInput(
                f"{self.spec.name} cannot be copied: only an arm that can be put into a saved state can, such as a "
                "virtual one or a simulation, and hardware never"
            )
        return vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        _open_arms[id(self.arm)] = self.arm

    @property
    def interventions(self) -> Interventions:
        """How often the guard did what until now; a record of its own, that later interventions do not change."""
        return replace(self._interventions)

    def read(self) -> Reading:
        """Return a checked reading and remember which muscles and joints are at their limits.

        Raises:
            ArmFailure: a reading that is none, or one from before the last: the arm's clock restarted.

        """
        reading = checked(self.arm.read(), self.spec)
        if reading.time < self._time:
            before, self._time = self._time, -math.inf  # the next reading is the first on the new clock
            self._inflation = _Inflation(self.spec.max_inflation, self.applied.size)
            with suppress(PneumarmError, OSError):  # the first failure is the one to tell of
                self._set(np.zeros_like(self._valves))
            raise ArmFailure(
                f"{self.spec.name}: its clock went back from {before:.2f} to {reading.time:.2f} s while in use, as "
                "when a board restarts; check its power and run the same command again"
            )
        over = max(reading.pressure.ravel().tolist()) > self._limit
        self._over = reading.pressure > self._limit if over else None
        np.maximum(self.peak_pressure, reading.pressure, out=self.peak_pressure)
        if self.spec.angle_limits is not None:
            self._outward = _outward(reading.angle, *self.spec.angle_limits)
        self._now = reading.time
        if self._closing:
            self._close_ended()
        self._inflation.pass_until(reading.time)
        self._time = reading.time
        return reading

    def set_valves(self, valves: ArrayLike) -> None:
        """Set ``valves`` (joints, 2), with those that break a limit kept closed.

        Raises:
            PneumarmError: other values or another shape; nothing is set then.

        """
        asked = self._as_valves(valves)
        if asked is None:
            raise PneumarmError(f"valves must be {self.applied.shape} of -1, 0 or +1, got {valves!r}")
        self._set(self._within_limits(asked))

    def decide(self, command: object) -> None:
        """Set the valves or pulses that a controller decided on, or replace the decision where they are none.

        Args:
            command: (joints, 2) of -1, 0, +1, or numbers from -1 to +1: the sign is the valve, the magnitude the
                share of the control period for which it is open.

        Raises:
            ControllerFailure: too many decisions in a row had to be replaced; everything is vented then.

        """
        asked = self._sensible(command)
        if asked is None:
            self.replace("nonsense", f"it gave {command!r}")
            return
        self._replaced, self._undecided = 0, 0.0
        self._set(self._within_limits(asked))

    def replace(self, reason: Reason, what: str, periods: float = 1.0, cause: Exception | None = None) -> None:
        """Do what is safe instead of what a controller decided: hold the valves as applied, or vent everything.

        Args:
            reason: why; it is counted.
            what: happened, for the message of the error.
            periods: control periods that went by without a decision.
            cause: what the controller raised.

        Raises:
            ControllerFailure: too many decisions in a row had to be replaced; everything is vented then.

        """
        counts = self._interventions
        setattr(counts, reason, getattr(counts, reason) + 1)
        self._replaced += 1
        self._undecided += periods * self.spec.period
        if self._undecided <= self._held:
            self._set(self._within_limits(self.applied.copy()))
            return
        counts.vented += 1
        self._set(np.full_like(self._valves, -1))  # no limit forbids to vent
        if self._replaced > self._most_replaced:
            raise ControllerFailure(
                f"{self.spec.name}: stopped and vented, because {self._replaced} decisions in a row could not be "
                f"used ({reason}: {what}); mend the controller and run the same command again"
            ) from cause

    def lateness(self, reading: Reading) -> float:
        """Return how many periods ago ``reading`` was on the arm's clock, for a decision that took long to make.

        The clock of an arm that has a state stands still while we compute, however long that takes, and is not asked:
        another reading would draw other noise, and nothing would repeat.
        """
        if self.get_state() is not None:
            return 0.0
        return (self.read().time - reading.time) / self.spec.period

    def stand_in(self, reading: Reading) -> bool:
        """Do what is safe while there is no decision on ``reading`` yet: keep the limits, hold, then vent.

        Called once a period for as long as that lasts; what it replaces is counted when the decision comes, or by
        :meth:`give_up`.

        Returns:
            Whether that is needed: the clock of an arm may stand still while we compute.

        """
        late = self.watch().time - reading.time
        if late < self.spec.period / 2:
            return False
        if self._undecided + late > self._held:
            self._set(np.full_like(self._valves, -1))  # over and over: so hardware knows that we are there
        return True

    def give_up(self, patience: float) -> ControllerFailure:
        """Vent everything and return the error for a controller that had not decided for ``patience`` [s]."""
        self._interventions.late += 1
        self._interventions.vented += 1
        with suppress(PneumarmError, OSError):  # the first failure is the one to tell of
            self._set(np.full_like(self._valves, -1))
        return ControllerFailure(
            f"{self.spec.name}: stopped and vented, because the controller had not decided for {patience:g} s; mend "
            "the controller and run the same command again"
        )

    def _as_valves(self, valves: object) -> NDArray[np.int8] | None:
        """Return a copy of ``valves`` if they are valves, else None."""
        try:
            asked = np.asarray(valves)
            if asked.shape == self._valves.shape and _SETTINGS.issuperset(asked.ravel().tolist()):
                return asked.astype(np.int8)
        except Exception:  # whatever a foreign object does when it is made an array
            return None
        return None

    def _sensible(self, command: object) -> Command | None:
        """Return a copy of ``command`` as the arm can carry it out if it is one, else None."""
        valves = self._as_valves(command)
        if valves is not None:
            return valves
        try:
            asked = np.asarray(command)
            if asked.shape == self._valves.shape and asked.dtype.kind == "f" and (np.abs(asked) <= 1).all():
                pulses = self.spec.possible(asked.astype(np.float64))
                whole = self._as_valves(pulses)
                return pulses if whole is None else whole
        except Exception:
            return None
        return None

    def _within_limits(self, command: Command) -> Command:
        """Close those valves of ``command`` that break a limit, and return it."""
        counts = self._interventions
        if self._over is not None:
            counts.pressure += _close(command, (command > 0) & self._over)
        if self._inflation.spent:
            counts.inflation += _close(command, (command > 0) & np.reshape(self._inflation.blocked, command.shape))
        if self._outward is not None:
            vented = (command[:, : self.spec.muscles] < 0).all(axis=1, keepdims=True)
            counts.angle += _close(command, (command != 0) & (np.sign(command) == self._outward) & ~vented)
        return command

    def _set(self, command: Command) -> None:
        """Give ``command`` to the arm, and note when its pulses end."""
        if self.spec.muscles == 1:
            command[:, 1] = 0  # a muscle that is not there
        self._closing, self._times_pulses = {}, False
        shares = [] if command.dtype == np.int8 else np.abs(command).ravel().tolist()
        if any(0 < share < 1 for share in shares):
            if self._time == -math.inf:
                self.read()  # the clock that pulses end on
            period = self.spec.period
            self._closing = {i: self._now + share * period for i, share in enumerate(shares) if 0 < share < 1}
            self._times_pulses = self.arm.set_pulses(command.astype(np.float64))
            valves = np.sign(command).astype(np.int8)
        else:
            command = valves = command.astype(np.int8, copy=False)
        if not self._times_pulses:
            self.arm.set_valves(valves)
        self.applied = command
        self._note(valves)

    def _note(self, valves: NDArray[np.int8]) -> None:
        """Note how the valves are now."""
        self._valves = valves
        self._inflation.valves = values = valves.ravel().tolist()
        self._inflating = 1 in values

    def _close_ended(self) -> None:
        """Close the valves whose pulses have ended by now."""
        ended = sorted((due, i) for i, due in self._closing.items() if due <= self._now)
        if not ended:
            return
        valves = self._valves.copy()
        for due, i in ended:
            self._inflation.pass_until(due)
            del self._closing[i]
            valves.flat[i] = 0
            self._inflation.valves[i] = 0
        if not self._times_pulses:
            self.arm.set_valves(valves)
        self._note(valves)

    def watch(self) -> Reading:
        """Return a reading, after closing the valves that are at a limit now."""
        reading = self.read()
        if self._over is not None or self._outward is not None or self._inflation.spent:
            before = self._interventions
            self._interventions = replace(before)
            now = self._within_limits(self._valves.copy()).astype(np.int8, copy=False)
            if np.array_equal(now, self._valves):
                self._interventions = before
            else:
                self._keep_closed(now)
        return reading

    def _keep_closed(self, now: NDArray[np.int8]) -> None:
        """Set the valves to ``now``, some of which are closed at a limit; pulses of others end when they were to."""
        self.arm.set_valves(now)
        self.applied = now if not self._closing else np.where(now == self._valves, self.applied, 0.0)
        self._closing = {i: due for i, due in self._closing.items() if now.flat[i]}
        self._times_pulses = False
        self._note(now)

    def end_pulses(self, before: float) -> None:
        """Let time pass until the pulses have ended that the guard times and that end ``before`` a time [s]."""
        while not self._times_pulses and self._closing and (due := min(self._closing.values())) <= before:
            if due > self._now:
                self.arm.wait(due - self._now)
                self._now = due
            self._close_ended()

    def _pass(self, seconds: float) -> None:
        """Let time pass [s], with the pulses that end in it."""
        end = self._now + seconds
        if self._closing:
            self.end_pulses(end)
            seconds = end - self._now
        self.arm.wait(seconds)
        self._now = end
        if self._closing:
            self._close_ended()

    def wait(self, seconds: float) -> None:
        """Let time pass, looking at the limits every control period while an inlet is open."""
        while seconds > self.spec.period and self._inflating:
            self._pass(self.spec.period)
            seconds -= self.spec.period
            self.watch()
        self._pass(seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s], looking at the limits as :meth:`wait` does."""
        left = time - (self._time if self._waits_itself else self.read().time)
        while left > 2 * self.spec.period and self._inflating:
            self._pass(self.spec.period)
            left = time - self.watch().time
        if not self._waits_itself:
            if left > 0:
                self._pass(left)
            return
        if self._closing:
            self.end_pulses(time)
        self.arm.wait_until(time)
        self._now = max(time, self._now)
        if self._closing:
            self._close_ended()

    def air_used(self) -> float | None:
        """Return the air that the arm behind has used [normal litres]."""
        return self.arm.air_used()

    def make_ready(self) -> None:
        """Prepare to move after a pause."""
        self.arm.make_ready()

    def regain(self) -> None:
        """Take up the arm again after its line was lost."""
        self.arm.regain()
        self._closing, self._times_pulses = {}, False
        self._note(np.zeros_like(self._valves))
        self.applied = self._valves

    def despite_losses(self, work: Callable[[], Result]) -> Result:
        """Return what ``work`` returns; where the line to the arm is lost in it, it is done again from its beginning.

        ``work`` is a movement or a measurement that does not depend on where the arm was, or that brings it there
        itself: the arm is vented while nobody is heard. Whatever else is wrong with the arm is raised.
        """
        lost = False
        while True:
            try:
                if lost:
                    self.regain()
                return work()
            except LineLost:
                lost = True

    def link_counts(self) -> dict[str, int]:
        """Return what has happened on the link to the arm behind."""
        return self.arm.link_counts()

    def get_state(self) -> bytes | None:
        """Return the state of the arm behind."""
        return self.arm.get_state()

    def set_state(self, state: bytes) -> None:
        """Restore the state of the arm behind."""
        self.arm.set_state(state)
        self.applied = self._valves = np.zeros_like(self._valves)
        self._closing, self._times_pulses = {}, False
        self._over = self._outward = None  # of another state, which nobody has read
        self._inflation = _Inflation(self.spec.max_inflation, self.applied.size)
        self._inflating, self._time, self._replaced, self._undecided = False, -math.inf, 0, 0.0

    def close(self) -> None:
        """Close the arm behind."""
        self.arm.close()
        _open_arms.pop(id(self._opened), None)


def guarded(arm: Arm) -> GuardedArm:
    """Return ``arm`` behind a guard; an arm that has one already is returned as it is."""
    return arm if isinstance(arm, GuardedArm) else GuardedArm(arm)


def _waits_itself(arm: Arm) -> bool:
    """Return whether ``arm`` brings a ``wait_until`` of its own."""
    while isinstance(arm, ArmWrapper) and type(arm).wait_until in (ArmWrapper.wait_until, OwnArm.wait_until):
        arm = arm.arm
    return type(arm).wait_until is not Arm.wait_until


def _close(command: Command, which: NDArray[np.bool_]) -> int:
    """Close ``which`` valves of ``command``; return how many."""
    command[which] = 0
    return int(which.sum())


def _outward(angle: NDArray[np.float64], low: float, high: float) -> NDArray[np.int8] | None:
    """Return the valves (joints, 2) that push joints at a limit further out, 0 elsewhere; None if no joint is there.

    Air in muscle 1 turns a joint to higher angles, air in muscle 2 to lower ones.
    """
    side = (angle >= high).astype(np.int8) - (angle <= low).astype(np.int8)
    return np.stack([side, -side], axis=1) if side.any() else None


def open_time(seconds: float, valve: int, passed: float) -> float:
    """Return for how long [s] an inlet counts as open, ``passed`` [s] after ``seconds``, its valve being so.

    This and :func:`stays_closed` are compiled by :func:`pneumarm.kernels.part` too, see
    :mod:`pneumarm.control.playing`.
    """
    if valve > 0:
        return seconds + passed
    return seconds - (passed if valve == 0 else VENTING * passed) if seconds > 0 else seconds


def stays_closed(blocked: bool, valve: int, seconds: float, limit: float) -> bool:
    """Return whether an inlet that counts as open for ``seconds`` stays closed from now on."""
    return blocked or seconds >= limit if valve > 0 else blocked and seconds > 0


class _Inflation:
    """For how long each inlet has been open: counted up while it is, down while it is closed, fast while vented.

    In plain Python: for the handful of muscles of an arm that is several times faster than NumPy, and it runs in
    every control period.
    """

    def __init__(self, limit: float, muscles: int) -> None:
        self.valves: list[int] = [0] * muscles
        self.blocked = [False] * muscles
        """Which inlets stay closed."""
        self.spent = False
        """Whether any does."""
        self._limit = limit
        self._open_for = [0.0] * muscles  # s
        self._time: float | None = None

    def pass_until(self, time: float) -> None:
        """Let time pass until ``time`` [s] with the valves as they are."""
        passed = 0.0 if self._time is None else time - self._time
        self._time = time
        for i, valve in enumerate(self.valves):
            if valve > 0 or self._open_for[i] > 0:
                self._open_for[i] = seconds = open_time(self._open_for[i], valve, passed)
                blocked = stays_closed(self.blocked[i], valve, seconds, self._limit)
                if blocked != self.blocked[i]:
                    self.blocked[i] = blocked
                    self.spent = any(self.blocked)
