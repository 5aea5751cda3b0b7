"""The virtual arm behind the seam."""

import hashlib
import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import Arm, ArmSpec, Reading, Sensor, with_measured
from pneumarm.arm.virtual.constants import COUNTS_PER_BAR, COUNTS_PER_DEGREE, HIGHEST_COUNT, Constants, constants
from pneumarm.arm.virtual.faults import Fault, Plan
from pneumarm.arm.virtual.further import begin_sampling, changing, further_sensors, pass_sampling, sense_further
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, ArmParameters
from pneumarm.arm.virtual.playing import FaultPlayer
from pneumarm.arm.virtual.rest import pass_time, static_angle
from pneumarm.arm.virtual.sensors import MOST_CONVERSIONS, sense, sense_with_faults
from pneumarm.arm.virtual.start import start
from pneumarm.arm.virtual.state import INLET, JOINT, MUSCLE, OUTLET, QUEUE, SLOW_TICK, SURROUNDINGS
from pneumarm.arm.virtual.valve import command, command_sides
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.kernels import kernel
from pneumarm.random import random_states, uniform

LATENCY = 0.007
"""Time between reading and acting [s] (thesis section 5.1: about 7 ms)."""
MOST_LATENESS = 8.0
"""The control cycle is never later than so many standard deviations."""
LONGEST_WAIT = 1e8
"""Longest wait [s], three years."""
_SUPPLY, _SENSORS, _JITTER = range(3)
_HEADER = struct.Struct("<8sI16s")
_MAGIC, _VERSION = b"pneumarm", 1


class Records(NamedTuple):
    """The arm's own state records, not copies: read them, and leave them alone."""

    muscles: NDArray[Any]
    """MUSCLE, shape (joints, 2)."""
    joints: NDArray[Any]
    """JOINT, shape (joints,)."""
    surroundings: NDArray[Any]
    """SURROUNDINGS, shape (1,)."""
    supply_random: NDArray[np.uint64]
    """Random state of the supply's fluctuation, shape (4,)."""


class Live(NamedTuple):
    """All that kernels need to move an arm, its own arrays and not copies. See :attr:`VirtualArm.live`."""

    muscles: NDArray[Any]
    """MUSCLE, shape (joints, 2)."""
    muscle_constants: NDArray[Any]
    """MUSCLE_CONSTANTS, shape (joints, 2)."""
    joints: NDArray[Any]
    """JOINT, shape (joints,)."""
    joint_constants: NDArray[Any]
    """JOINT_CONSTANTS, shape (joints,)."""
    air: NDArray[Any]
    """SURROUNDINGS, shape (1,)."""
    air_constants: NDArray[Any]
    """SURROUNDINGS_CONSTANTS, shape (1,)."""
    sensor_constants: NDArray[Any]
    """SENSOR_CONSTANTS, shape (1,)."""
    supply_random: NDArray[np.uint64]
    """Random state of the supply's fluctuation, shape (4,)."""
    sensor_random: NDArray[np.uint64]
    """Random state of the sensors' noise, shape (4,)."""
    jitter_random: NDArray[np.uint64]
    """Random state of the control cycle's lateness, shape (4,)."""
    conversions: NDArray[np.float64]
    """Room for the conversions of a reading, shape (MOST_CONVERSIONS,)."""
    lateness: float
    """Mean lateness of the control cycle [s]."""


class VirtualArm(Arm):
    """An arm that exists only as physics: valves, air, braided muscles, a hinge with a weight, and sensors.

    Time passes only in :meth:`wait` and :meth:`wait_until`; reading and setting valves take none. ``wait`` is
    exact; ``wait_until`` ends late, as under an operating system that is not real-time: by an exponentially
    distributed time, such that the interval between two deadlines has the standard deviation
    ``parameters.jitter``. Waits of more than 10 s of an arm at rest are fast-forwarded.

    The arm starts in the morning, vented and at rest, as it hung overnight.

    Args:
        parameters: what the arm is made of; the nominal arm by default.
        seed: seeds the noise of the sensors, the jitter, and the fluctuation of the supply.
        name: what reports call the arm.
        faults: what goes wrong with it, and when; see :mod:`pneumarm.arm.virtual.faults`.
        velocity_sensor: whether it also reads the velocity, from faster samples of its angle.
        sensors: accelerometers and thermometers that it has besides; see :mod:`pneumarm.arm.virtual.further`.

    Raises:
        UnusableInput: the arm cannot play the faults, or has no joint for a sensor.

    """

    def __init__(
        self,
        parameters: ArmParameters | None = None,
        *,
        seed: int = 0,
        name: str = "virtual",
        faults: Sequence[Fault] = (),
        velocity_sensor: bool = False,
        sensors: Sequence[Sensor] = (),
    ) -> None:
        self.parameters = parameters if parameters is not None else ArmParameters()
        joints = len(self.parameters.joints)
        self.spec = ArmSpec(
            joints=joints,
            counts_per_degree=COUNTS_PER_DEGREE,
            counts_per_bar=COUNTS_PER_BAR,
            angle_range=(0.0, HIGHEST_COUNT),
            max_pressure=self.parameters.max_pressure / BAR,
            latency=LATENCY,
            name=name,
            velocity_sensor=velocity_sensor,
            sensors=tuple(sensors),
        )
        self._constants = constants(self.parameters)
        self._muscles = np.zeros((joints, 2), MUSCLE)
        self._joints = np.zeros(joints, JOINT)
        self._surroundings = np.zeros(1, SURROUNDINGS)
        if seed < 0:
            raise UnusableInput(f"the seed of a virtual arm must be 0 or more, got {seed}")
        self._random = random_states(seed, 3)
        self._lateness = self.parameters.jitter / math.sqrt(2)  # an interval has two ends
        self._scratch = np.zeros(MOST_CONVERSIONS)
        fixed = self._constants
        self._physics = (
            self._muscles,
            fixed.muscles,
            self._joints,
            fixed.joints,
            self._surroundings,
            fixed.surroundings,
            self._random[_SUPPLY],
        )
        self._sensing = (
            self._muscles,
            self._joints,
            self._surroundings,
            fixed.sensors,
            self._random[_SENSORS],
            self._scratch,
        )
        start(*self._physics)
        self._player: FaultPlayer | None = None
        self._further = further_sensors(self.spec, seed) if self.spec.further else None
        if self._further is not None:
            begin_sampling(self._sensing, self._further.sound, self._further)
        self.faults = tuple(faults)

    @property
    def faults(self) -> Plan:
        """The faults that the arm plays; set it, also while the arm moves, to play others from now on."""
        return () if self._player is None else self._player.plan

    @faults.setter
    def faults(self, plan: Sequence[Fault]) -> None:
        asked = self._asked()
        before, self._player = self._player, None
        if before is not None:
            before.restore()
        try:
            if plan:
                self._player = FaultPlayer(
                    tuple(plan),
                    self.parameters,
                    self._constants,
                    self._muscles,
                    self._joints,
                    self._surroundings,
                    asked,
                )
        except UnusableInput:
            self._player = before
            if before is not None:
                before.update(self.time, afresh=True)
            raise
        if before is not None or plan:
            self.set_valves(asked)

    def _asked(self) -> NDArray[np.int8]:
        """Return the valves (joints, 2) as they were last asked for."""
        if self._player is not None:
            return self._player.asked.copy()
        sides = (self._muscles["open"] + self._muscles["pending"]) % 2
        return (sides[..., INLET] - sides[..., OUTLET]).astype(np.int8)

    @property
    def constants(self) -> Constants:
        """The arm's parameters as records for kernels."""
        return self._constants

    @property
    def records(self) -> Records:
        """The arm's true state as records for kernels."""
        return Records(self._muscles, self._joints, self._surroundings, self._random[_SUPPLY])

    @property
    def live(self) -> Live:
        """What kernels move the arm by.

        Raises:
            UnusableInput: the arm plays faults or has further sensors, which only its own methods do.

        """
        if self._player is not None:
            raise UnusableInput(f"{self.spec.name}: kernels cannot move an arm that plays faults; remove them")
        if self._further is not None:
            raise UnusableInput(f"{self.spec.name}: kernels cannot read further sensors; open the arm without them")
        fixed = self._constants
        return Live(
            self._muscles,
            fixed.muscles,
            self._joints,
            fixed.joints,
            self._surroundings,
            fixed.surroundings,
            fixed.sensors,
            self._random[_SUPPLY],
            self._random[_SENSORS],
            self._random[_JITTER],
            self._scratch,
            self._lateness,
        )

    @property
    def time(self) -> float:
        """The arm's clock [s]."""
        return float(self._surroundings["time"][0])

    @property
    def angle(self) -> NDArray[np.float64]:
        """The true angles, shape (joints,) [rad]."""
        return self._joints["angle"].copy()

    @property
    def speed(self) -> NDArray[np.float64]:
        """The true angular velocities, shape (joints,) [rad/s]."""
        return self._joints["speed"].copy()

    @property
    def pressure(self) -> NDArray[np.float64]:
        """The true gauge pressures, shape (joints, 2) [Pa]."""
        return self._muscles["pressure"] - ATMOSPHERE

    @property
    def temperature(self) -> NDArray[np.float64]:
        """The true temperatures of the muscles, shape (joints, 2) [degrees Celsius]."""
        return self._muscles["temperature"].copy()

    def read(self) -> Reading:
        """Return what the sensors say now; two readings at the same time differ by their noise."""
        joints = self.spec.joints
        angle, pressure = np.empty(joints), np.empty((joints, 2))
        if self._player is not None:
            time = sense_with_faults(*self._sensing, self._player.track, self._player.leap, angle, pressure)
        else:
            time = sense(*self._sensing, angle, pressure)
        reading = Reading(time, angle, pressure)
        if self._further is None:
            return reading
        values = np.empty(len(self.spec.further))
        sense_further(self._sensing, self._constants.joints, self._further, values)
        return with_measured(reading, self.spec, values.tolist())

    def set_valves(self, valves: ArrayLike) -> None:
        """Set the valves (joints, 2) of -1 out, 0 closed, +1 in; the air notices after the pipe's delay.

        Raises:
            PneumarmError: other values or another shape.

        """
        asked = np.asarray(valves)
        if asked.shape == self._muscles.shape:
            exact = asked if asked.dtype == np.int8 else _as_int8(asked)
            if self._player is not None and np.isin(exact, (-1, 0, 1)).all():
                self._route(self._player, exact)
                return
            if command(self._muscles, self._surroundings, self._constants.surroundings, np.ascontiguousarray(exact)):
                return
        raise PneumarmError(f"valves must be {self._muscles.shape} of -1, 0 or +1, got {valves!r}")

    def wait(self, seconds: float) -> None:
        """Let exactly ``seconds`` [s] pass.

        Raises:
            PneumarmError: ``seconds`` is negative, not a number, or longer than LONGEST_WAIT.

        """
        if not 0.0 <= seconds <= LONGEST_WAIT:
            raise PneumarmError(f"an arm can wait for 0 to {LONGEST_WAIT:g} s, got {seconds!r}")
        if self._player is not None:
            self._play(self._player, self.time + seconds)
        elif self._further is not None:
            self._pass(self.time + seconds)
        else:
            pass_for(*self._physics, seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until the clock shows ``time`` [s], or a little more; return at once if it is past.

        Raises:
            PneumarmError: ``time`` is not a number or farther away than LONGEST_WAIT.

        """
        if not time <= LONGEST_WAIT and not time - self.time <= LONGEST_WAIT:
            raise PneumarmError(f"an arm can wait for up to {LONGEST_WAIT:g} s, got the time {time!r}")
        if self._player is not None:
            self._play(self._player, time, late=True)
        elif self._further is not None:
            self._pass_late(time)
        else:
            pass_until(*self._physics, self._random[_JITTER], self._lateness, time)

    def _play(self, player: FaultPlayer, until: float, *, late: bool = False) -> None:
        """Let time pass until ``until`` [s], or until a little ``late``, cut where faults change."""
        while (change := player.next_change()) < until:
            self._pass(change)
            self._update(player)
        if late:
            self._pass_late(until)
        else:
            self._pass(until)
        self._update(player)

    def _pass(self, until: float) -> None:
        """Let time pass until ``until`` [s], with samples of the angle where there is a sensor that needs them."""
        if self._further is None:
            pass_time(*self._physics, until)
        else:
            track = self._further.sound if self._player is None else self._player.track
            pass_sampling(self._physics, self._sensing, track, self._further, until)

    def _pass_late(self, until: float) -> None:
        """Let time pass until ``until`` [s], or a little more; not at all if it is past."""
        if self._further is None:
            pass_until(*self._physics, self._random[_JITTER], self._lateness, until)
        elif until > self.time:
            self._pass(until + drawn_lateness(self._random[_JITTER], self._lateness))

    def _update(self, player: FaultPlayer) -> None:
        if player.update(self.time):
            self._route(player, player.asked.copy())

    def _route(self, player: FaultPlayer, asked: NDArray[np.int8]) -> None:
        command_sides(self._muscles, self._surroundings, self._constants.surroundings, player.route(asked))

    def rest(self, seconds: float) -> None:
        """Vent all muscles for ``seconds`` [s] and close the valves again; a night costs milliseconds."""
        self.set_valves(np.full(self._muscles.shape, -1, np.int8))
        self.wait(seconds)
        self.set_valves(np.zeros(self._muscles.shape, np.int8))

    def close(self) -> None:
        """Close all valves."""
        self.set_valves(np.zeros(self._muscles.shape, np.int8))

    def _parts(self) -> tuple[NDArray[Any], ...]:
        further = () if self._further is None else changing(self._further)
        return self._muscles, self._joints, self._surroundings, self._random, *further

    def _digest(self) -> bytes:
        digest = hashlib.blake2b(digest_size=16)
        player = self._player
        for record in self._constants if player is None else player.sound:
            digest.update(record.tobytes())
        digest.update(struct.pack("<d", self._lateness))
        if self._further is not None:
            digest.update(repr((self.spec.velocity_sensor, self.spec.sensors)).encode())
        if player is not None:
            digest.update(player.digest())
        return digest.digest()

    def get_state(self) -> bytes:
        """Return everything that the arm's future depends on besides its parameters."""
        parts = [_HEADER.pack(_MAGIC, _VERSION, self._digest()), *(part.tobytes() for part in self._parts())]
        return b"".join(parts if self._player is None else [*parts, self._player.get_state()])

    def set_state(self, state: bytes) -> None:
        """Take up a state of an arm with the same parameters and faults; the future is the same bit for bit.

        Raises:
            UnusableInput: no state of an arm with these parameters and faults, or a damaged one.

        """
        player = self._player
        expected = _HEADER.size + sum(part.nbytes for part in self._parts())
        expected += 0 if player is None else player.state_size
        if len(state) != expected:
            raise UnusableInput(f"{self.spec.name}: expected a saved state of {expected} bytes, got {len(state)}")
        magic, version, digest = _HEADER.unpack_from(state)
        if (magic, version) != (_MAGIC, _VERSION):
            raise UnusableInput(f"{self.spec.name}: this is no saved state of a virtual arm of version {_VERSION}")
        if digest != self._digest():
            raise UnusableInput(f"{self.spec.name}: the saved state is of an arm with other parameters or faults")
        offset, restored = _HEADER.size, []
        for part in self._parts():
            restored.append(np.frombuffer(state, part.dtype, part.size, offset).reshape(part.shape))
            offset += part.nbytes
        for values in restored:
            _check_state(values, self.spec.name)
        played = None if player is None else player.check_state(state[offset:], self.spec.name)
        for part, values in zip(self._parts(), restored, strict=True):
            part[...] = values
        if player is not None and played is not None:
            player.set_state(played)


def _check_state(values: NDArray[Any], name: str) -> None:
    """Raise UnusableInput unless all numbers are finite and the counts in it are possible."""
    fields = [values[field] for field in values.dtype.names] if values.dtype.names else [values]
    checks = [np.isfinite(field) for field in fields]
    if values.dtype == MUSCLE:
        checks += [np.isin(values["open"], (0, 1)), values["pressure"] > 0]
        checks += [values["pending"] >= 0, values["pending"] <= QUEUE]
    if values.dtype == SURROUNDINGS:
        since = values["time"] - values["tick"]
        checks += [values["time"] >= 0, values["time"] <= 100 * LONGEST_WAIT, since >= 0, since <= 2 * SLOW_TICK]
    if not all(check.all() for check in checks):
        raise UnusableInput(f"{name}: the saved state is damaged: it holds impossible numbers")


def _as_int8(values: NDArray[Any]) -> NDArray[np.int8]:
    """Return ``values`` as int8, with 2, which no valve knows, where they are no whole small numbers."""
    return np.where(np.isin(values, (-1, 0, 1)), values, 2).astype(np.int8)


@kernel
def pass_for(muscles, muscle_c, joints, joint_c, air, air_c, random, seconds):  # type: ignore[no-untyped-def]
    """Let ``seconds`` [s] pass."""
    pass_time(muscles, muscle_c, joints, joint_c, air, air_c, random, air[0].time + seconds)


@kernel
def drawn_lateness(jitter, lateness):  # type: ignore[no-untyped-def]
    """Return how long the operating system takes to wake up [s]."""
    return min(-lateness * math.log(1.0 - uniform(jitter)), MOST_LATENESS * lateness)


@kernel
def pass_until(  # type: ignore[no-untyped-def]
    muscles, muscle_c, joints, joint_c, air, air_c, random, jitter, lateness, time
):
    """Let time pass until ``time`` [s] and then as long as the operating system takes to wake up."""
    if time > air[0].time:
        pass_time(muscles, muscle_c, joints, joint_c, air, air_c, random, time + drawn_lateness(jitter, lateness))


def resting_angle(parameters: ArmParameters, pressures: ArrayLike, *, end_stops: bool = True) -> NDArray[np.float64]:
    """Return the angles [rad] (joints,) at which an arm rests at gauge ``pressures`` (joints, 2) [Pa].

    Without dry friction and after all creep, at 20 degrees Celsius.
    """
    fixed = constants(parameters)
    pressures = np.asarray(pressures, np.float64).reshape(fixed.muscles.shape)
    angles = [
        static_angle(fixed.muscles[j], fixed.joints[j], pressures[j], end_stops) for j in range(len(fixed.joints))
    ]
    return np.array(angles)
