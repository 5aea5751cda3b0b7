"""What all classical controllers have in common: the reference, the velocity, and standing still.

A goal that jumps is gone to by a polynomial of fifth degree from where the reference is, with its velocity and
acceleration; without these it is the minimum-jerk move. A smooth reference is followed as it is. Within the tolerance
of rest the valves are closed: closed muscles are springs of air that hold the joint, and nothing wears.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec, Reading
from pneumarm.arm.reference import Reference, constant
from pneumarm.classical.muscles import Muscles
from pneumarm.errors import UnusableInput

_JUMP = 1.0
"""A change of a jumping reference of more than this is another goal [counts]."""
_LEAVING = 1.8
"""A joint at rest is left alone until it is off by so many times the tolerance in which it came to rest."""
_CALM = 8.0
"""... and it comes to rest when it would need an eighth of a second or longer to cross that tolerance [1/s]."""

_FAST = 60.0
"""A joint that moves faster compresses air by more than the sensors' noise [degrees/s]."""


@dataclass(frozen=True)
class Setpoint:
    """What one joint is to do now; angles in counts, times in seconds."""

    angle: float
    """Wanted now."""
    ahead: float
    """Wanted a lead time ahead."""
    velocity: float
    """A lead time ahead."""
    acceleration: float
    """A lead time ahead."""
    velocity_now: float


class Law(Protocol):
    """How one joint's valves follow from what is wanted and what is read."""

    muscles: Muscles
    """The joint's muscles; who follows tells them what is read and what is commanded."""

    def begin(self) -> None:
        """Begin a movement."""

    def act(self, setpoint: Setpoint, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles, -1 to 1, for a joint at ``angle`` [counts] and ``velocity``."""


@dataclass(frozen=True)
class CommonGains:
    """What all laws have; times in seconds."""

    move_time: float = 0.21
    """Time of the smallest move to a goal."""
    move_speed: float = 200.0
    """A move takes longer by its length divided by this [degrees/s]."""
    smoothing: float = 0.017
    """Time constant of the filter on the measured velocity."""
    rest: float = 0.23
    """Off by less than this the joint is left alone [degrees]."""
    lead: float = 0.09
    """How far ahead the reference is fed forward."""
    total: float = 0.9
    """Sum of both pressures, in units of the highest: co-contraction."""
    trust: float = 0.6
    """Share of a reading that goes into the estimate of a pressure, while the joint stands still."""
    integral: float = 5.0
    """Ki, how fast the error of the static map is learned [1/s]."""
    memory: float = 0.27
    """Share of the map's error, as it is where a movement begins, that is taken for true there."""


class ClassicalController:
    """A controller of all joints: one :class:`Law` each."""

    def __init__(
        self, spec: ArmSpec, gains: CommonGains, laws: Sequence[Law], goal_range: NDArray[np.float64], *, pulses: bool
    ) -> None:
        self.spec, self.goal_range = spec, goal_range
        self._pulses = pulses
        self._joints = [_JointController(spec, gains, law) for law in laws]
        self._reference = constant(goal_range.mean(axis=1))
        self._begin: float | None = None
        self._fresh = True

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts], to be held."""
        goal = np.asarray(goal, np.float64).reshape(-1)
        if goal.shape != (self.spec.joints,) or not np.isfinite(goal).all():
            raise UnusableInput(f"a goal needs {self.spec.joints} finite angle(s) in counts, got {goal}")
        self.track(constant(goal))

    def track(self, reference: Reference) -> None:
        """Follow ``reference`` from the next reading on."""
        self._reference, self._begin = reference, None

    def act(self, reading: Reading) -> NDArray[Any]:
        """Return the valves (joints, 2) to set after ``reading``: -1, 0, +1, or shares of the period with pulses."""
        begins = self._begin is None
        if self._begin is None:
            self._begin = reading.time
        time = reading.time - self._begin
        pressures = (reading.pressure / self.spec.counts_per_bar).tolist()
        setpoints = self._setpoints(time, reading, begins)
        commands = [
            joint.act(reading.time, float(angle), (p[0], p[1]), setpoint)
            for joint, angle, p, setpoint in zip(self._joints, reading.angle, pressures, setpoints, strict=True)
        ]
        return np.array(commands, np.float64 if self._pulses else np.int8)

    def _setpoints(self, time: float, reading: Reading, begins: bool) -> list[Setpoint]:
        """Return what each joint is to do at the ``time`` [s] since the reference began."""
        reference = self._reference
        if begins:
            for joint, angle, p in zip(self._joints, reading.angle, reading.pressure, strict=True):
                joint.begin(reading.time, float(angle), (p / self.spec.counts_per_bar).tolist())
        if not reference.smooth:
            goals = reference.at(time).tolist()
            return [joint.on_the_way(time, goal) for joint, goal in zip(self._joints, goals, strict=True)]
        now = reference.point(time)
        found = []
        for j, joint in enumerate(self._joints):
            ahead = reference.point(time, joint.gains.lead)
            found.append(
                Setpoint(
                    float(now.angle[j]),
                    float(ahead.angle[j]),
                    float(ahead.velocity[j]),
                    float(ahead.acceleration[j]),
                    float(now.velocity[j]),
                )
            )
        return found


class _JointController:
    """One joint on its way."""

    def __init__(self, spec: ArmSpec, gains: CommonGains, law: Law) -> None:
        self.law, self.gains = law, gains
        self._counts = spec.counts_per_degree
        self._rest = gains.rest * spec.counts_per_degree
        self._time, self._angle, self._velocity, self._smooth = 0.0, 0.0, 0.0, 0.0
        self._resting = False
        self._profile: _QuinticProfile | None = None

    def begin(self, time: float, angle: float, pressures: tuple[float, float]) -> None:
        """Begin where the joint is."""
        self._time, self._angle, self._velocity, self._smooth = time, angle, 0.0, angle
        self._resting = False
        self._profile = _QuinticProfile(0.0, 0.0, angle, 0.0, 0.0, angle)
        self.law.muscles.begin(angle, pressures)
        self.law.begin()

    def on_the_way(self, time: float, goal: float) -> Setpoint:
        """Return where the joint is to be at ``time`` [s] on its way to ``goal``, which may be a new one."""
        assert self._profile is not None
        if abs(goal - self._profile.goal) > _JUMP:
            angle, velocity, acceleration = self._profile.at(time)
            duration = self.gains.move_time + abs(goal - angle) / self._counts / self.gains.move_speed
            self._profile = _QuinticProfile(time, duration, angle, velocity, acceleration, goal)
        angle, velocity, _ = self._profile.at(time)
        ahead, its_velocity, its_acceleration = self._profile.at(time + self.gains.lead)
        return Setpoint(angle, ahead, its_velocity, its_acceleration, velocity)

    def act(
        self, time: float, angle: float, pressures: tuple[float, float], setpoint: Setpoint
    ) -> tuple[float, float]:
        """Return the commands of both muscles after a reading."""
        if time > self._time:
            passed = time - self._time
            keep = self.gains.smoothing / (self.gains.smoothing + passed)
            self._velocity += (1 - keep) * ((angle - self._angle) / passed - self._velocity)
            self._smooth += (1 - keep) * (angle - self._smooth)
        self._time, self._angle = time, angle
        muscles = self.law.muscles
        muscles.read(angle, pressures, min(abs(self._velocity) / (_FAST * self._counts), 1.0))
        commands = (0.0, 0.0) if self._rests(setpoint) else self.law.act(setpoint, angle, self._velocity)
        muscles.commanded(commands)
        return commands

    def _rests(self, setpoint: Setpoint) -> bool:
        off = abs(self._smooth - setpoint.angle)
        if setpoint.velocity or setpoint.velocity_now or setpoint.acceleration:
            self._resting = False
        elif self._resting:
            self._resting = off < _LEAVING * self._rest
        else:
            self._resting = off < self._rest and abs(self._velocity) < _CALM * self._rest
        return self._resting


class _QuinticProfile:
    """The polynomial of fifth degree from an angle, a velocity and an acceleration to rest at a goal."""

    def __init__(
        self, time: float, duration: float, angle: float, velocity: float, acceleration: float, goal: float
    ) -> None:
        self.goal, self._time, self._duration = goal, time, duration
        T, left = duration, goal - angle
        v, a = velocity * T, acceleration * T * T
        self._c = (
            angle,
            v,
            a / 2,
            10 * left - 6 * v - 1.5 * a,
            -15 * left + 8 * v + 1.5 * a,
            6 * left - 3 * v - 0.5 * a,
        )

    def at(self, time: float) -> tuple[float, float, float]:
        """Return angle, velocity and acceleration at ``time`` [s]."""
        T = self._duration
        s = time - self._time
        if s >= T:
            return self.goal, 0.0, 0.0
        s /= T
        c = self._c
        angle = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
        velocity = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])))
        acceleration = 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]))
        return angle, velocity / T, acceleration / (T * T)
