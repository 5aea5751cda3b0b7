"""What is done with an arm to check it: gently, a joint at a time, behind the guard.

1. *Timing*: readings and settings of closed valves, timed by the host's clock; the control cycle with closed valves.
2. *Muscles*, one at a time from vented: fill, hold, exhaust. Then a short pulse, which is over while air still flows
   fast: a sensor at the valve's side shows it by a leap (thesis A.1.1).
3. *Sweep*: from one end to the other and back in small steps, standing still after each: angle against pressures.
4. *Rest*: all muscles of all joints full and closed. After they have settled, the readings are noise (thesis A.1.3),
   and what the pressures lose is the leak (:mod:`pneumarm.checkup.leaks`).
5. *Again*: each muscle is filled once more. A supply that creeps up has done so by now (thesis A.1.1).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, ControlCycle, GuardedArm, Reading, guarded
from pneumarm.checkup.leaks import LeakTest, watch_closed
from pneumarm.errors import UnusableInput
from pneumarm.settings import Settings

Array = NDArray[np.float64]
_Duration = Annotated[float, Meta(gt=0, lt=10_000)]
_Count = Annotated[int, Meta(gt=0, lt=10_000)]


@dataclass(frozen=True)
class CheckupSettings(Settings):
    """How long an arm is looked at, and how closely."""

    step: _Duration = 0.005
    """Time between two readings while a muscle fills or exhausts [s]; an arm that is slower gives fewer."""
    fill: _Duration = 1.5
    """Time that a muscle is filled [s]: at 1 bar it is full then (thesis figure 2.6)."""
    hold: _Duration = 0.5
    """Time that it is held after that [s]."""
    exhaust: _Duration = 2.0
    """Time that it is vented [s]."""
    pulse: _Duration = 0.25
    """Length of the short pulse [s]; shorter on an arm that fills so fast that little air would flow by then."""
    settle: _Duration = 8.0
    """Time that closed muscles rest before noise and leak are measured [s]."""
    rest: _Duration = 45.0
    """Time over which noise and leak are measured [s]; a longer one finds smaller leaks."""
    rest_step: _Duration = 0.02
    """Time between two readings then [s]."""
    sweep_steps: _Count = 16
    """Steps of the sweep in one direction."""
    sweep_pulse: _Duration = 0.05
    """Time that the valves are open for a step of the sweep [s]."""
    sweep_settle: _Duration = 0.6
    """Time that the arm comes to rest after a step of the sweep [s]."""
    repeats: _Count = 200
    """How often a reading and a setting are timed."""


@dataclass(frozen=True)
class Trace:
    """What one joint's sensors read while its valves were set to something."""

    time: Array
    """Since the reading before the valves were first set [s], shape (n,)."""
    angle: Array
    """Shape (n,) [counts]."""
    pressure: Array
    """Shape (n, 2) [counts]."""

    def __getitem__(self, readings: slice) -> "Trace":
        """Return these ``readings`` of it."""
        return Trace(*[values[readings] for values in vars(self).values()])

    def __add__(self, later: "Trace") -> "Trace":
        """Return this trace with a ``later`` one, on the same clock, after it."""
        return Trace(*[np.concatenate(both) for both in zip(vars(self).values(), vars(later).values(), strict=True)])


@dataclass(frozen=True)
class MuscleTest:
    """One muscle of a joint, filled, held and exhausted, and then given a pulse, the other one vented."""

    fill: Trace
    """The inlet is open from 0 s on."""
    hold: Trace
    """Closed; its clock and that of ``exhaust`` go on from ``fill``."""
    exhaust: Trace
    """The exhaust is open from its first reading on."""
    pulse: Trace
    """The pulse, on a clock of its own, and what comes after it."""
    pulsed: float
    """Length of the pulse [s]."""
    everywhere: tuple[Trace, ...]
    """Fill, hold and exhaust as the sensors of each joint saw them, this one's among them."""

    @property
    def whole(self) -> Trace:
        """Fill, hold and exhaust."""
        return self.fill + self.hold + self.exhaust


@dataclass(frozen=True)
class JointTest:
    """What was measured of one joint."""

    before: Trace
    """While all muscles were first vented: nothing should rise."""
    muscles: tuple[MuscleTest, MuscleTest]
    sweep: Trace
    """A reading at rest for each step, up and then down; many readings are averaged for each."""
    rest: Trace
    """Both muscles full and closed."""
    again: tuple[Trace, Trace]
    """Each muscle filled once more at the end, as it was in its own test."""


@dataclass(frozen=True)
class Timing:
    """How fast the arm answers, in seconds of the host's clock, and how even its control periods are."""

    read: Array
    set_and_read: Array
    periods: Array
    """Control periods by the arm's clock [s]."""


@dataclass(frozen=True)
class Checkup:
    """All that was measured of an arm."""

    spec: ArmSpec
    settings: CheckupSettings
    timing: Timing
    joints: tuple[JointTest, ...]


def measure(
    arm: Arm,
    settings: CheckupSettings = CheckupSettings(),
    *,
    progress: Callable[[float, float], None] | None = None,
) -> Checkup:
    """Check ``arm``, whose joints must be free to move, for :func:`arm_seconds`; it is left vented and closed.

    ``progress`` is told the seconds of the arm's time so far, and those of all of it.

    Raises:
        UnusableInput: the arm has no pressure sensors, or one muscle a joint.
        ArmFailure: the arm fails.

    """
    _require_pressures(arm)
    arm.spec.require_pairs("a check-up compares the two muscles of a joint")
    guard = guarded(arm)
    joints, total = guard.spec.joints, arm_seconds(guard.spec, settings)
    told = progress or (lambda done, total: None)
    bench = _Bench(guard, settings, lambda done: told(min(done, total), total))
    try:
        done = guard.despite_losses
        first = done(bench.vent)
        timing = done(lambda: _timing(guard, settings))
        moved = []
        for joint in range(joints):
            one, two = (done(partial(bench.muscle, joint, muscle)) for muscle in range(2))
            moved.append((one, two, done(partial(bench.sweep, joint))))
        rest = done(bench.rest)
        again = [
            (done(partial(bench.again, joint, 0)), done(partial(bench.again, joint, 1))) for joint in range(joints)
        ]
        told(total, total)
        tests = [
            JointTest(_trace(first, j), (one, two), sweep, _trace(rest, j), again[j])
            for j, (one, two, sweep) in enumerate(moved)
        ]
        return Checkup(guard.spec, settings, timing, tuple(tests))
    finally:
        guard.set_valves(np.zeros_like(guard.applied))


def arm_seconds(spec: ArmSpec, settings: CheckupSettings = CheckupSettings()) -> float:
    """Return about how long a check-up takes on an arm [s]."""
    s, still = settings, settings.sweep_settle + _STILL
    muscle = 4 * s.exhaust + s.fill + 2 * s.hold + s.pulse
    sweep = s.exhaust + s.fill + still + 2 * s.sweep_steps * (1.5 * s.sweep_pulse + still)
    again = 2 * s.exhaust + s.fill
    rest = s.exhaust + s.fill + s.settle + s.rest
    return s.exhaust + s.repeats // 4 * spec.period + spec.joints * (2 * muscle + sweep + 2 * again) + rest


def _require_pressures(arm: Arm) -> None:
    if not arm.spec.pressure_sensors:
        raise UnusableInput(
            f"{arm.spec.name} has no pressure sensors, and a check-up judges muscles by their pressures; look at its "
            "angles and valves with `pneumarm arm sensors` and `pneumarm arm valves`"
        )


def fill_alone(arm: Arm, joint: int, muscle: int, settings: CheckupSettings = CheckupSettings()) -> None:
    """Vent all muscles of ``arm``, then fill one and close it: its joint stands at an end, and is left there.

    Raises:
        ArmFailure: the arm fails.

    """
    bench = _Bench(guarded(arm), settings)

    def fill() -> None:
        bench.vent()
        bench.watch(bench.alone(joint, muscle), settings.fill)
        bench.watch(bench.valves(joint, 0, 0), settings.hold)

    bench.guard.despite_losses(fill)


def _timing(guard: GuardedArm, settings: CheckupSettings) -> Timing:
    closed = np.zeros_like(guard.applied)

    def timed(what: Callable[[], object]) -> Array:
        seconds = np.empty(settings.repeats)
        for i in range(settings.repeats):
            began = perf_counter()
            what()
            seconds[i] = perf_counter() - began
            guard.wait(0.0)  # a controller that is only asked, and never told, would take us for dead
        return seconds

    def set_and_read() -> None:
        guard.set_valves(closed)
        guard.read()

    turns = iter(range(settings.repeats // 4))
    cycle = ControlCycle(guard)
    steps = list(cycle.run(lambda reading: closed if next(turns, None) is not None else None))
    periods = np.diff([step.reading.time for step in steps])
    return Timing(timed(guard.read), timed(set_and_read), periods)


_STILL = 0.1  # s over which an arm that stands still is read
_TELL = 0.5  # s between two times that it is told how far it is
_FLOWING = 0.4  # of what a muscle is filled with: until then air flows nearly as fast as at first


class _Bench:
    """Moves an arm for its check-up."""

    def __init__(
        self, guard: GuardedArm, settings: CheckupSettings, told: Callable[[float], None] = lambda time: None
    ) -> None:
        self.guard, self.settings, self._told = guard, settings, told
        self._begun: float | None = None
        self._last = -np.inf

    def tell(self, reading: Reading) -> None:
        """Tell now and then how long it has taken so far on the arm's clock."""
        if self._begun is None:
            self._begun = reading.time
        if reading.time - self._last >= _TELL:
            self._last = reading.time
            self._told(reading.time - self._begun)

    def valves(self, joint: int, first: int, second: int) -> NDArray[np.int8]:
        """Return the valves of ``joint``; those of all others closed."""
        valves = np.zeros(self.guard.applied.shape, np.int8)
        valves[joint] = first, second
        return valves

    def alone(self, joint: int, muscle: int, value: int = 1) -> NDArray[np.int8]:
        """Return the valves of one muscle set to ``value``; those of all others closed."""
        valves = np.zeros(self.guard.applied.shape, np.int8)
        valves[joint, muscle] = value
        return valves

    def vent(self) -> list[Reading]:
        """Vent all muscles."""
        self.guard.read()
        readings = self.watch(np.full_like(self.guard.applied, -1), self.settings.exhaust)
        self.guard.set_valves(np.zeros_like(self.guard.applied))
        return readings

    def watch(self, valves: NDArray[np.int8], seconds: float, step: float | None = None) -> list[Reading]:
        """Set ``valves`` and read every ``step`` [s] for ``seconds`` [s]; the first reading is from before."""
        step = step or self.settings.step
        readings = [self.guard.read()]
        self.guard.set_valves(valves)
        end = readings[0].time + seconds
        due = readings[0].time
        while (now := readings[-1].time) < end - step / 2:
            due = max(due + step, now)
            self.guard.wait(max(due - now, 0.0))
            readings.append(self.guard.watch())
            self.tell(readings[-1])
        return readings

    def muscle(self, joint: int, muscle: int) -> MuscleTest:
        """Fill, hold and exhaust a muscle; then give it a pulse."""
        wanted = self.settings
        self.vent()
        fill = self.watch(self.alone(joint, muscle), wanted.fill)
        hold = self.watch(self.valves(joint, 0, 0), wanted.hold)
        exhaust = self.watch(self.alone(joint, muscle, -1), wanted.exhaust)
        self.vent()
        pulsed = self._while_filling(fill, joint, muscle)
        pulse = self.watch(self.alone(joint, muscle), pulsed)
        after = self.watch(self.valves(joint, 0, 0), wanted.hold)
        self.vent()
        begin = fill[0].time
        filled, held, vented = (_trace(readings, joint, begin) for readings in (fill, hold, exhaust))
        everywhere = [_trace(fill + hold + exhaust, each, begin) for each in range(self.guard.spec.joints)]
        return MuscleTest(filled, held, vented, _trace(pulse + after, joint), pulsed, tuple(everywhere))

    def _while_filling(self, fill: list[Reading], joint: int, muscle: int) -> float:
        """Return the length of a pulse [s] at whose end the muscle, which took a ``fill``, still takes much air."""
        pressure = np.array([reading.pressure[joint, muscle] for reading in fill]) - fill[0].pressure[joint, muscle]
        reached = fill[int(np.argmax(pressure > _FLOWING * pressure.max()))].time - fill[0].time
        return float(np.clip(reached, 2 * self.settings.step, self.settings.pulse))

    def rest(self) -> list[Reading]:
        """Fill all muscles, close them, let them settle, and read."""
        wanted = self.settings
        self.vent()
        test = LeakTest(wanted.fill, wanted.settle, wanted.rest, wanted.rest_step)
        return watch_closed(self.guard, test, self.tell)

    def again(self, joint: int, muscle: int) -> Trace:
        """Fill a muscle from vented; then vent it."""
        self.vent()
        fill = self.watch(self.alone(joint, muscle), self.settings.fill)
        self.vent()
        return _trace(fill, joint)

    def sweep(self, joint: int) -> Trace:
        """Go from one end to the other and back, standing still after each step."""
        wanted = self.settings
        self.vent()
        self.watch(self.valves(joint, 0, 1), wanted.fill)
        stops = [self._still(joint)]
        for direction in (1, -1):
            for _ in range(wanted.sweep_steps):
                # One muscle takes air while the other lets it out: the pressures cross each other slowly.
                self._step(joint, direction)
                stops.append(self._still(joint))
        return _trace(stops, joint)

    def _step(self, joint: int, direction: int) -> None:
        out = self.settings.sweep_pulse / 2  # air leaves faster than it comes
        both, only_in = (direction, -direction), (max(direction, 0), max(-direction, 0))
        self.watch(self.valves(joint, *both), out)
        self.watch(self.valves(joint, *only_in), self.settings.sweep_pulse)

    def _still(self, joint: int) -> Reading:
        """Return the mean of the readings once the arm stands still."""
        self.watch(self.valves(joint, 0, 0), self.settings.sweep_settle, self.settings.rest_step)
        last = self.watch(self.valves(joint, 0, 0), _STILL)
        angle = np.median([r.angle for r in last], axis=0)
        return Reading(last[-1].time, angle, np.mean([r.pressure for r in last], axis=0))


def _trace(readings: list[Reading], joint: int, begin: float | None = None) -> Trace:
    time = np.array([r.time for r in readings])
    angle = np.array([r.angle[joint] for r in readings])
    return Trace(time - (time[0] if begin is None else begin), angle, np.array([r.pressure[joint] for r in readings]))
