"""The virtual arm behind the seam."""

import hashlib
import struct
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import Arm, ArmSpec, Reading, Sensor, with_measured
from pneumarm.arm.valves import Command
from pneumarm.arm.virtual.body import Body, body_of
from pneumarm.arm.virtual.constants import constants
from pneumarm.arm.virtual.faults import Fault, Plan, check_plan
from pneumarm.arm.virtual.further import begin_sampling, changing, further_sensors, pass_sampling, sense_further
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, PERIOD, ArmParameters
from pneumarm.arm.virtual.passing import drawn_lateness, pass_time
from pneumarm.arm.virtual.playing import FaultPlayer
from pneumarm.arm.virtual.rest import stand
from pneumarm.arm.virtual.sensors import sense
from pneumarm.arm.virtual.spring import with_springs
from pneumarm.arm.virtual.start import start
from pneumarm.arm.virtual.state import INLET, JOINT, MUSCLE, OUTLET, QUEUE, SLOW_TICK, SURROUNDINGS
from pneumarm.arm.virtual.valve import command, command_sides
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.kernels import direct

LATENCY = 0.007
"""Time between reading and acting [s] (thesis section 5.1: about 7 ms)."""
LONGEST_WAIT = 1e8
"""Longest wait [s], three years."""
_sense, _pass_time, _drawn_lateness = direct(sense), direct(pass_time), direct(drawn_lateness)
_open_valves, _open_pulses = direct(command), direct(command)
_HEADER = struct.Struct("<8sI16s")
_MAGIC, _VERSION = b"pneumarm", 4


def spec_of(
    parameters: ArmParameters,
    *,
    name: str,
    period: float,
    velocity_sensor: bool,
    sensors: Sequence[Sensor],
    pressure_sensors: bool,
    pulses: bool,
    muscles: int,
) -> ArmSpec:
    """Return the spec of the virtual arm with ``parameters``; the rest is as for :class:`VirtualArm`."""
    converter = parameters.sensors
    return ArmSpec(
        joints=len(parameters.joints),
        muscles=muscles,
        period=period,
        counts_per_degree=converter.counts_per_degree,
        counts_per_bar=converter.counts_per_bar,
        angle_range=(0.0, converter.highest),
        max_pressure=parameters.max_pressure / BAR,
        latency=LATENCY * _share(period),
        links=parameters.links,
        name=name,
        velocity_sensor=velocity_sensor,
        sensors=tuple(sensors),
        pressure_sensors=pressure_sensors,
        safe_supply=not pressure_sensors,
        pulses=pulses,
    )


def _share(period: float) -> float:
    """Return which share of the usual latency and jitter a computer has that controls with ``period`` [s]."""
    return min(1.0, period / PERIOD)


class VirtualArm(Arm):
    """An arm that exists only as physics: valves, air, braided muscles, a chain of links with weights, and sensors.

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
        period: of its control [s]; by default the one that it is made for. What is controlled at a higher rate than
            the thesis' 30 Hz is so by a faster computer: latency and jitter are shorter in proportion.
        velocity_sensor: whether it also reads the velocity, from faster samples of its angle.
        sensors: accelerometers and thermometers that it has besides; see :mod:`pneumarm.arm.virtual.further`.
        pressure_sensors: whether it reads pressures; where not, its supply is turned down to what its muscles bear.
        pulses: whether its valves may be open for a part of a control period.
        muscles: of each joint; with 1 a spring pulls in place of muscle 2 (:mod:`pneumarm.arm.virtual.spring`).

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
        period: float | None = None,
        velocity_sensor: bool = False,
        sensors: Sequence[Sensor] = (),
        pressure_sensors: bool = True,
        pulses: bool = True,
        muscles: int = 2,
    ) -> None:
        self.parameters = parameters if parameters is not None else ArmParameters()
        if not pressure_sensors:
            self.parameters = _with_safe_supply(self.parameters)
        if muscles == 1:
            self.parameters = with_springs(self.parameters)
        period = self.parameters.period if period is None else period
        self.spec = spec_of(
            self.parameters,
            name=name,
            period=period,
            velocity_sensor=velocity_sensor,
            sensors=sensors,
            pressure_sensors=pressure_sensors,
            pulses=pulses,
            muscles=muscles,
        )
        if seed < 0:
            raise UnusableInput(f"the seed of a virtual arm must be 0 or more, got {seed}")
        self.body = body_of(replace(self.parameters, jitter=self.parameters.jitter * _share(period)), seed)
        """The arm itself, not a copy, for kernels; read it, and leave it alone."""
        start(self.body)
        self._player: FaultPlayer | None = None
        self._further = further_sensors(self.spec, seed) if self.spec.further else None
        if self._further is not None:
            begin_sampling(self.body, self._further)
        self.faults = tuple(faults)

    @property
    def faults(self) -> Plan:
        """The faults that the arm plays; set it, also while the arm moves, to play others from now on."""
        return () if self._player is None else self._player.plan

    @faults.setter
    def faults(self, plan: Sequence[Fault]) -> None:
        plan = check_plan(plan, self.spec.joints, muscles=self.spec.muscles)
        asked, before = self._asked(), self._player
        if before is not None:
            before.restore()
        self._player = FaultPlayer(plan, self.parameters, self.body, self.spec.period) if plan else None
        if before is not None or plan:
            self._command(asked)

    def _asked(self) -> Command:
        """Return the command (joints, 2) that was last asked for; of pulses of a sound arm how they end."""
        if self._player is not None:
            return self._player.asked.copy()
        sides = (self.body.muscles["open"] + self.body.muscles["pending"]) % 2
        return (sides[..., INLET] - sides[..., OUTLET]).astype(np.int8)

    def like(self, seed: int, parameters: ArmParameters | None = None) -> "VirtualArm":
        """Return another arm that is as this one was when it was opened; ``parameters`` are others than its own."""
        spec = self.spec
        return VirtualArm(
            self.parameters if parameters is None else parameters,
            seed=seed,
            name=spec.name,
            faults=self.faults,
            period=spec.period,
            velocity_sensor=spec.velocity_sensor,
            sensors=spec.sensors,
            pressure_sensors=spec.pressure_sensors,
            pulses=spec.pulses,
            muscles=spec.muscles,
        )

    @property
    def is_plain(self) -> bool:
        """Whether kernels alone can move it: :attr:`plain` gives its body."""
        return self._own_methods_only is None

    @property
    def plain(self) -> Body:
        """The body of an arm that kernels alone can move.

        Raises:
            UnusableInput: the arm plays faults or has further sensors, which only its own methods do, it has no
                pressure sensors, in place of which only the guard has estimates, or one muscle a joint.

        """
        if self._own_methods_only is not None:
            raise UnusableInput(f"{self.spec.name}: kernels cannot {self._own_methods_only}")
        return self.body

    @property
    def _own_methods_only(self) -> str | None:
        """What it has that kernels cannot do, and what to do about it; None of a plain arm."""
        if self._player is not None:
            return "move an arm that plays faults; remove them"
        if self._further is not None:
            return "read further sensors; open the arm without them"
        if not self.spec.pressure_sensors:
            return "estimate pressures; open the arm with its sensors"
        if self.spec.muscles != 2:
            return "move joints with one muscle; open the arm with two a joint"
        return None

    @property
    def time(self) -> float:
        """The arm's clock [s]."""
        return float(self.body.surroundings["time"][0])

    @property
    def angle(self) -> NDArray[np.float64]:
        """The true angles, shape (joints,) [rad]."""
        return self.body.joints["angle"].copy()

    @property
    def speed(self) -> NDArray[np.float64]:
        """The true angular velocities, shape (joints,) [rad/s]."""
        return self.body.joints["speed"].copy()

    @property
    def pressure(self) -> NDArray[np.float64]:
        """The true gauge pressures, shape (joints, 2) [Pa]."""
        return self.body.muscles["pressure"] - ATMOSPHERE

    @property
    def temperature(self) -> NDArray[np.float64]:
        """The true temperatures of the muscles, shape (joints, 2) [degrees Celsius]."""
        return self.body.muscles["temperature"].copy()

    def read(self) -> Reading:
        """Return what the sensors say now; two readings at the same time differ by their noise."""
        joints = self.spec.joints
        angle, pressure = np.empty(joints), np.empty((joints, 2))
        reading = Reading(_sense(self.body, angle, pressure), angle, pressure)
        if not self.spec.pressure_sensors:
            reading = Reading(reading.time, angle)
        elif self.spec.muscles == 1:
            reading = Reading(reading.time, angle, pressure[:, :1].copy())
        if self._further is None:
            return reading
        values = np.empty(len(self.spec.further))
        sense_further(self.body, self._further, values)
        return with_measured(reading, self.spec, values.tolist())

    def set_valves(self, valves: ArrayLike) -> None:
        """Set the valves (joints, 2) of -1 out, 0 closed, +1 in; the air notices after the pipe's delay.

        Raises:
            PneumarmError: other values or another shape.

        """
        asked = np.asarray(valves)
        if asked.shape == self.body.muscles.shape:
            exact = asked if asked.dtype == np.int8 else _as_int8(asked)
            if self._command(np.ascontiguousarray(exact)):
                return
        raise PneumarmError(f"valves must be {self.body.muscles.shape} of -1, 0 or +1, got {valves!r}")

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Open the valves now and close each after its share of the control period, to the microsecond.

        Raises:
            PneumarmError: shares beyond -1 to +1, or another shape.

        """
        shape = self.body.muscles.shape
        if command.shape != shape or not self._command(np.ascontiguousarray(command, np.float64)):
            raise PneumarmError(f"pulses must be {shape} of numbers from -1 to +1, got {command!r}")
        return True

    def _command(self, command: Command) -> bool:
        """Give ``command`` to the valves; return False, with nothing done, where it is none."""
        if self._player is None:
            opened = _open_valves if command.dtype == np.int8 else _open_pulses
            return bool(opened(self.body, command, self.spec.period))
        if not ((command >= -1) & (command <= 1)).all():
            return False
        self._player.ask(command.astype(np.float64))
        command_sides(self.body, self._player.route())
        return True

    def air_used(self) -> float:
        """Return the air that came in through the inlets so far [normal litres, ISO 8778: 1 bar, 20 Celsius]."""
        return 1e3 * float(self.body.muscles["taken"].sum())

    def wait(self, seconds: float) -> None:
        """Let exactly ``seconds`` [s] pass.

        Raises:
            PneumarmError: ``seconds`` is negative, not a number, or longer than LONGEST_WAIT.

        """
        if not 0.0 <= seconds <= LONGEST_WAIT:
            raise PneumarmError(f"an arm can wait for 0 to {LONGEST_WAIT:g} s, got {seconds!r}")
        until = self.time + float(seconds)
        if self._player is not None:
            self._play(self._player, until)
        else:
            self._pass(until)

    def wait_until(self, time: float) -> None:
        """Let time pass until the clock shows ``time`` [s], or a little more; return at once if it is past.

        Raises:
            PneumarmError: ``time`` is not a number or farther away than LONGEST_WAIT.

        """
        if not time <= LONGEST_WAIT and not time - self.time <= LONGEST_WAIT:
            raise PneumarmError(f"an arm can wait for up to {LONGEST_WAIT:g} s, got the time {time!r}")
        if self._player is not None:
            self._play(self._player, float(time), late=True)
        else:
            self._pass_late(float(time))

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
            _pass_time(self.body, until)
        else:
            pass_sampling(self.body, self._further, until)

    def _pass_late(self, until: float) -> None:
        """Let time pass until ``until`` [s], or a little more; not at all if it is past."""
        if until > self.time:
            self._pass(until + _drawn_lateness(self.body))

    def _update(self, player: FaultPlayer) -> None:
        if player.update(self.time):
            command_sides(self.body, player.route())

    def rest(self, seconds: float) -> None:
        """Vent all muscles for ``seconds`` [s] and close the valves again; a night costs milliseconds."""
        self.set_valves(np.full(self.body.muscles.shape, -1, np.int8))
        self.wait(seconds)
        self.set_valves(np.zeros(self.body.muscles.shape, np.int8))

    def close(self) -> None:
        """Close all valves."""
        self.set_valves(np.zeros(self.body.muscles.shape, np.int8))

    def _parts(self) -> tuple[NDArray[Any], ...]:
        further = () if self._further is None else changing(self._further)
        body = self.body
        random = body.supply_random, body.sensor_random, body.jitter_random
        return body.muscles, body.joints, body.surroundings, *random, *further

    def _digest(self) -> bytes:
        """Return what tells arms apart; computers may draw parameters whose last digits differ."""
        digest = hashlib.blake2b(digest_size=16)
        player = self._player
        for record in self.body.constants if player is None else player.sound:
            for field in record.dtype.names or ():
                digest.update(record[field].astype(np.float32).tobytes())
        digest.update(struct.pack("<f", self.body.lateness))
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


def _with_safe_supply(parameters: ArmParameters) -> ArmParameters:
    """Return ``parameters`` with the supply at the largest pressure that the muscles bear, if it was over that."""
    supply = min(parameters.air.supply, parameters.max_pressure)
    return replace(parameters, air=replace(parameters.air, supply=supply))


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


def resting_angle(parameters: ArmParameters, pressures: ArrayLike, *, end_stops: bool = True) -> NDArray[np.float64]:
    """Return the angles [rad] (joints,) at which an arm rests at gauge ``pressures`` (joints, 2) [Pa].

    Without dry friction and after all creep, at 20 degrees Celsius.
    """
    fixed = constants(parameters)
    joints = np.zeros(len(fixed.joints), JOINT)
    stand(fixed, np.asarray(pressures, np.float64).reshape(fixed.muscles.shape), end_stops, joints)
    return joints["angle"].copy()
