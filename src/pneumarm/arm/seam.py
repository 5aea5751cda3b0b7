"""The seam between pneumarm and any arm: what a user provides to use their own hardware.

An arm has three primitives: read the sensors, set the valves, let time pass. Everything that moves an arm
takes an :class:`Arm`; nothing else in pneumarm knows whether it is virtual, simulated or bolted to a table.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from types import TracebackType
from typing import Annotated, Literal, Self

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.settings import NonNegativeFloat, PositiveFloat, PositiveInt, Settings, Valid

SensorKind = Literal["velocity", "acceleration", "temperature"]
"""Kinds of further sensors, besides those of angle and pressure that every arm has."""


@dataclass(frozen=True)
class Sensor(Settings):
    """A further sensor of an arm: an accelerometer of a joint, or a thermometer of a muscle.

    The velocity of the joints is none of these: a board makes it of the angle's faster samples, without a
    sensor of its own; see :attr:`ArmSpec.velocity_sensor`.
    """

    kind: Literal["acceleration", "temperature"]
    """What it measures: tangential acceleration of a joint's link [m/s2], or temperature of a muscle [Celsius]."""
    joint: PositiveInt = 1
    """Joint that it is at, from 1."""
    muscle: Annotated[int, Meta(ge=1, le=2)] | None = None
    """Muscle that a thermometer is at, 1 or 2; None for an accelerometer."""
    channel: PositiveInt | None = None
    """The board's extra channel that it is wired to, from 1; None where there is no board between."""
    scale: float = 1.0
    """What a count of that channel is worth [m/s2 or Celsius]."""
    offset: float = 0.0
    """What the count 0 says [m/s2 or Celsius]."""

    def _valid(self) -> Valid:
        muscle = self.muscle is not None if self.kind == "temperature" else self.muscle is None
        return {
            "muscle": muscle or "the muscle of a thermometer, and none for an accelerometer",
            "scale": self.scale != 0 or "another number",
        }

    @property
    def name(self) -> str:
        """What its readings are called, such as ``joint_1_temperature_2``."""
        return f"joint_{self.joint}_{self.kind}" + ("" if self.muscle is None else f"_{self.muscle}")

    def value(self, counts: float) -> float:
        """Return what ``counts`` of its channel say [m/s2 or Celsius]."""
        return self.offset + self.scale * counts

    def counts(self, value: float) -> float:
        """Return the counts, not rounded, that say ``value`` [m/s2 or Celsius]."""
        return (value - self.offset) / self.scale


@dataclass(frozen=True)
class ArmSpec(Settings):
    """What pneumarm must know of an arm. All angles and pressures of the seam are in sensor counts."""

    joints: PositiveInt = 1
    """Number of hinges, each with two antagonistic muscles, or with one."""
    period: PositiveFloat = 1 / 30
    """Control period [s] (thesis section 5.1: 30 Hz)."""
    counts_per_degree: PositiveFloat = 11.378
    """Counts of the angle sensor per degree (thesis section 2.3.4)."""
    counts_per_bar: PositiveFloat = 166.0
    """Counts of the pressure sensors per bar (thesis section 2.3.4)."""
    angle_range: tuple[float, float] = (0.0, 1023.0)
    """Lowest and highest count of the angle sensor; its middle is called 0 degrees."""
    max_pressure: PositiveFloat = 1.05
    """Inlets stay closed while their muscle reads over this [bar]."""
    pressure_sensors: bool = True
    """Whether pressures are measured. Where not, they are estimated from what the valves were told
    (:mod:`pneumarm.arm.fill`), ``max_pressure`` is that of the supply, and the guard cannot enforce it."""
    safe_supply: bool = False
    """That the supply, at its highest, cannot burst a muscle: the guard asks for your word on this where no pressures
    are measured."""
    fill_times: tuple[PositiveFloat, PositiveFloat] = (1.5, 0.7)
    """Times in which a muscle is filled and emptied [s], about; asked only where no pressures are measured."""
    max_inflation: PositiveFloat = 10.0
    """An inlet that was open for so long [s] stays closed until its muscle has rested (:mod:`pneumarm.arm.guard`)."""
    angle_limits: tuple[float, float] | None = None
    """At these angles [counts] valves that push further out stay closed; None where the end stops bear that."""
    pulses: bool = True
    """Whether valves may be open for a part of a control period; where not, commands are rounded to whole periods."""
    shortest_pulse: PositiveFloat = 0.003
    """Shortest time that a valve is open [s]; what is shorter is rounded to none or to this (thesis section 2.2:
    valves switch at 330 Hz)."""
    pulse_step: NonNegativeFloat = 0.0
    """Pulses last for a multiple of this time [s], as where an arm without pulses is controlled at every third of its
    periods; 0: for any time from the shortest on."""
    velocity_sensor: bool = False
    """Whether readings carry the velocity that the arm measures itself, as a board does that samples faster
    (thesis sections 5.1 and 7.3)."""
    sensors: tuple[Sensor, ...] = ()
    """Further sensors whose readings it carries, no two in one place or on one channel (thesis appendix A)."""
    muscles: Annotated[int, Meta(ge=1, le=2)] = 2
    """Muscles of each joint. 1: a spring or a weight pulls against it, towards lower angles. Valves of the second are
    then never opened, and its pressure is 0 behind the guard, whatever the arm says."""
    latency: NonNegativeFloat = 0.0
    """Time [s] between reading and acting that the control cycle has to let pass on this arm.

    An arm whose reading and computing take real time by themselves leaves it 0."""
    links: tuple[PositiveFloat, ...] = ()
    """Lengths of the links, one a joint, from hinge to hinge and from the last hinge to the hand [m]; only goals in x
    and y need them. At 0 degrees they are taken to hang straight down in a line (:mod:`pneumarm.arm.hand`)."""
    name: str = "arm"
    """What reports call the arm."""

    def _valid(self) -> Valid:
        low, high = self.angle_range
        lowest, highest = self.angle_limits or (-1.0, 1.0)
        sensors = self.sensors
        return {
            "pulse_step": self.pulse_step <= self.shortest_pulse or "0 to ``shortest_pulse``",
            "angle_range": low < high or "a lower and a higher count",
            "angle_limits": lowest < highest or "a lower and a higher count",
            "latency": self.latency < self.period or "less than ``period``",
            "links": len(self.links) in (0, self.joints) or f"{self.joints} length(s), one a joint, or none",
            "sensors": (
                all(one.joint <= self.joints and (one.muscle or 1) <= self.muscles for one in sensors)
                and _unlike(one.name for one in sensors)
                and _unlike(one.channel for one in sensors)
            )
            or "sensors of its joints and muscles, no two in one place or on one channel",
        }

    @property
    def pressure_word(self) -> str:
        """What people are to call the pressures of its readings."""
        return "pressure" if self.pressure_sensors else "estimated pressure"

    @property
    def angle_unit(self) -> float:
        """What a count of the thesis' angle sensor, in which its thresholds are given, is on this one [counts]."""
        return self.counts_per_degree / ArmSpec.counts_per_degree

    @property
    def pressure_unit(self) -> float:
        """What a count of the thesis' pressure sensors is on these [counts]."""
        return self.counts_per_bar / ArmSpec.counts_per_bar

    @property
    def max_pressure_counts(self) -> float:
        """The pressure limit [counts]."""
        return self.max_pressure * self.counts_per_bar

    def require_pairs(self, why: str) -> None:
        """Raise UnusableInput, and say ``why``, unless each joint has two muscles."""
        if self.muscles != 2:
            raise UnusableInput(f"{self.name} has one muscle a joint, and {why}")

    def possible(self, command: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pulses (joints, 2) nearest to ``command`` that the arm can carry out, shares of a period."""
        shortest = min(self.shortest_pulse / self.period, 1.0) if self.pulses else 1.0
        share = np.abs(command)
        if self.pulses and self.pulse_step > 0:
            step = self.pulse_step / self.period
            share = np.minimum(np.round(share / step) * step, 1.0)
        rounded = np.where(2 * share < shortest, 0.0, np.maximum(share, shortest))
        return np.sign(command) * rounded + 0.0  # no -0.0

    @cached_property
    def further(self) -> tuple[str, ...]:
        """Names of all that readings carry besides angles and pressures, velocities first."""
        velocities = [velocity_name(j) for j in range(1, self.joints + 1)] if self.velocity_sensor else []
        return (*velocities, *(one.name for one in self.sensors))

    def degrees(self, counts: ArrayLike) -> NDArray[np.float64]:
        """Convert angles [counts] to degrees, 0 in the middle of the range."""
        middle = sum(self.angle_range) / 2
        return (np.asarray(counts, np.float64) - middle) / self.counts_per_degree

    def bar(self, counts: ArrayLike) -> NDArray[np.float64]:
        """Convert pressures [counts] to bar gauge."""
        return np.asarray(counts, np.float64) / self.counts_per_bar


def _unlike(values: Iterable[object]) -> bool:
    """Return whether no two of ``values`` that are there are equal."""
    there = [value for value in values if value is not None]
    return len(set(there)) == len(there)


@dataclass(frozen=True, slots=True)
class Reading:
    """What the sensors said at one moment; ``None`` for a sensor that the arm does not have."""

    time: float
    """The arm's clock [s]."""
    angle: NDArray[np.float64]
    """Angles, shape (joints,) [counts]."""
    pressure: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """Pressures, shape (joints, 2) [counts], of an arm with one muscle a joint also (joints, 1); left out by an arm
    without pressure sensors, and estimated behind the guard."""
    velocity: NDArray[np.float64] | None = None
    """Angular velocities from a sensor of their own, shape (joints,) [counts/ms]."""
    temperature: NDArray[np.float64] | None = None
    """Temperatures of the muscles, shape (joints, 2) [degrees Celsius]; NaN for a muscle without a thermometer."""
    acceleration: NDArray[np.float64] | None = None
    """Tangential accelerations of the links, shape (joints,) [m/s2]; NaN for a joint without an accelerometer."""


def velocity_name(joint: int) -> str:
    """Return what the measured velocity of ``joint``, from 1, is called."""
    return f"joint_{joint}_velocity"


def unit_of(name: str) -> str:
    """Return the unit of what the further sensor called ``name`` says."""
    return _UNITS[_place(name)[0]]


_UNITS = {"velocity": "counts/ms", "acceleration": "m/s2", "temperature": "°C"}


def measured(reading: Reading, names: Iterable[str], whose: str = "the arm") -> list[float]:
    """Return what the further sensors called ``names`` say in ``reading``; see :attr:`ArmSpec.further`.

    Raises:
        ArmFailure: one says nothing, or no finite number; ``whose`` it is stands in the message.

    """
    found = []
    for name in names:
        kind, place = _place(name)
        values = getattr(reading, kind)
        try:
            value = math.nan if values is None else float(np.asarray(values)[place])
        except (TypeError, ValueError, IndexError):
            value = math.nan
        if not math.isfinite(value):
            raise ArmFailure(f"{whose}: a reading must hold a finite {name}, got {values!r} as {kind}")
        found.append(value)
    return found


@cache
def _place(name: str) -> tuple[str, tuple[int, ...]]:
    """Return the field of a reading and the place in it that the sensor ``name`` fills."""
    _, joint, kind, *muscle = name.split("_")
    return kind, (int(joint) - 1, *(int(m) - 1 for m in muscle))


def with_measured(reading: Reading, spec: ArmSpec, values: Sequence[float]) -> Reading:
    """Return ``reading`` with ``values`` in the order of :attr:`ArmSpec.further`: the inverse of :func:`measured`."""
    if not spec.further:
        return reading
    velocity = np.array(values[: spec.joints], np.float64) if spec.velocity_sensor else None
    temperature = acceleration = None
    for one, value in zip(spec.sensors, values[len(values) - len(spec.sensors) :], strict=True):
        if one.kind == "temperature":
            temperature = np.full((spec.joints, 2), np.nan) if temperature is None else temperature
            temperature[one.joint - 1, (one.muscle or 1) - 1] = value
        else:
            acceleration = np.full(spec.joints, np.nan) if acceleration is None else acceleration
            acceleration[one.joint - 1] = value
    return Reading(reading.time, reading.angle, reading.pressure, velocity, temperature, acceleration)


class Arm(ABC):
    """An arm: a context manager whose ``close`` leaves every valve closed or vented on every way out.

    Calls come one at a time, but not always from the same thread: while a controller does not come back, the watchdog
    of decisions reads and vents from one of its own.
    """

    spec: ArmSpec
    real_time: bool = False
    """Whether its seconds are those of the computer, as of hardware. A wait that takes far longer by the computer's
    clock is then a failure of the arm; one that is simulated may be slower or faster, and leaves it False."""

    @abstractmethod
    def read(self) -> Reading:
        """Return what the sensors say now, in arrays that later readings do not change."""

    @abstractmethod
    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves (joints, 2) of -1 out, 0 closed, +1 in; takes effect now, holds until the next call."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Let time pass [s]: real on hardware, simulated on a virtual arm."""

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Open the valves (joints, 2) now and close each after its share of the control period.

        For arms that can time this by themselves. The sign of a ``command`` is the valve, its magnitude the share,
        one that :meth:`ArmSpec.possible` gives; +-1 holds until the next call. The next call, also of
        :meth:`set_valves`, ends what is left of it.

        Returns:
            Whether it was done. Where not, as by default, nothing is set and the guard times the pulses.

        """
        return False

    def air_used(self) -> float | None:
        """Return the air that the muscles have taken so far [normal litres]; None where nobody knows.

        Nobody does by default: pressures alone do not tell what flows through a leak or into a muscle that grows. An
        arm with a flow meter says it here, and then ``move`` and ``track`` do.
        """
        return None

    @abstractmethod
    def close(self) -> None:
        """Leave every valve closed or vented and let go of the hardware. May be called twice."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.spec.name!r}>"

    def wait_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s]; return at once if it is past.

        The guard reads and waits by itself where an arm leaves this as it is, and looks at the limits between. An arm
        that brings its own has to wait by a clock that never goes back: the guard cannot see until it returns.
        """
        remaining = time - self.read().time
        if remaining > 0:
            self.wait(remaining)

    def make_ready(self) -> None:  # noqa: B027 - most arms are always ready
        """Prepare to move after a pause, in which hardware may have vented the arm because nobody moved it.

        Called before each movement; an arm that was vented for any other reason raises.
        """

    def regain(self) -> None:
        """Take up the arm again, its valves closed, after a call raised :class:`~pneumarm.errors.LineLost`.

        It may wait for the arm to be there again. One that somebody has to look at first raises another ArmFailure.
        """
        self.make_ready()

    def link_counts(self) -> dict[str, int]:
        """Return what has happened on the link to the arm so far, by name; nothing where there is no link."""
        return {}

    def get_state(self) -> bytes | None:
        """Return everything that the arm's future depends on, or None where that cannot be had (hardware).

        A virtual arm gives it, so that an interrupted run goes on exactly where it was.
        """
        return None

    def set_state(self, state: bytes) -> None:
        """Take up a state that ``get_state`` returned."""
        raise UnusableInput(f"{self.spec.name} cannot be put into a saved state")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except PneumarmError as failure:
            if not isinstance(error, PneumarmError):
                raise
            raise ArmFailure(f"{error}; and it could not be closed: {failure}") from error


_FAR = 10.0
"""An angle may lie outside of ``angle_range`` by so many times its width: potentiometers do by a little, encoders
that count on by some turns."""


def checked(reading: Reading, spec: ArmSpec) -> Reading:
    """Return ``reading`` with float64 arrays of the right shapes; as it is where it has them already.

    Raises:
        ArmFailure: a value is missing, not finite or of the wrong shape, also of the further sensors of ``spec``, or
            an angle lies far outside ``angle_range``. An arm without pressure sensors may leave out the pressures,
            one with one muscle a joint those of others.

    """
    try:
        time = float(reading.time)
        angle = _array(reading.angle, (spec.joints,))
        none = not spec.pressure_sensors and np.size(reading.pressure) == 0
        pressure = reading.pressure if none else _pressures(reading.pressure, spec)
    except (TypeError, ValueError, AttributeError) as error:
        raise ArmFailure(
            f"{spec.name}: a reading needs a time, {spec.joints} angle(s) and {spec.joints} x {spec.muscles} "
            f"pressures, got {reading!r} ({error})"
        ) from error
    # For a handful of numbers Python is several times faster than np.isfinite, and this runs in every period.
    angles = angle.tolist()
    if not all(map(math.isfinite, [time, *angles, *pressure.ravel().tolist()])):
        raise ArmFailure(f"{spec.name}: a reading must hold finite numbers, got {reading!r}")
    low, high = spec.angle_range
    if not low - _FAR * (high - low) <= min(angles) <= max(angles) <= high + _FAR * (high - low):
        raise ArmFailure(
            f"{spec.name}: expected angles of {low:g} to {high:g} counts (angle_range), or a little outside, got "
            f"{angles}; check the sensor, its wires, and angle_range"
        )
    if spec.further:
        measured(reading, spec.further, spec.name)
    if angle is reading.angle and pressure is reading.pressure and type(reading.time) is float:
        return reading
    return Reading(time, angle, pressure, reading.velocity, reading.temperature, reading.acceleration)


def check_pressures(made_for: ArmSpec, found: ArmSpec, what: str) -> None:
    """Raise UnusableInput where ``what`` was made for an arm whose pressures come from elsewhere."""
    if made_for.pressure_sensors != found.pressure_sensors:
        words = ["without", "with"]
        raise UnusableInput(
            f"{what} for an arm {words[made_for.pressure_sensors]} pressure sensors, {found.name} is one "
            f"{words[found.pressure_sensors]}; record, fit and train on an arm like this"
        )
    if not found.pressure_sensors and not np.allclose(made_for.fill_times, found.fill_times, rtol=1e-3):
        raise UnusableInput(
            f"{what} for an arm whose fill_times are {made_for.fill_times}, those of {found.name} are "
            f"{found.fill_times}; give the same arm.toml"
        )


def _pressures(values: ArrayLike, spec: ArmSpec) -> NDArray[np.float64]:
    """Return ``values`` as pressures (joints, 2) of ``spec``, 0 for muscles that are not there."""
    if spec.muscles == 2:
        return _array(values, (spec.joints, 2))
    given = np.asarray(values, np.float64).reshape(spec.joints, -1)
    if given.shape[1] > 2:
        raise ValueError(f"{given.shape[1]} pressures a joint")
    return np.stack([given[:, 0], np.zeros(spec.joints)], axis=1)


def _array(values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return ``values`` as a float64 array of ``shape``; the same object where it is one."""
    array = np.asarray(values, np.float64)
    return array if array.shape == shape else array.reshape(shape)
