"""The cascade: a PID loop on the angle asks for pressures, an inner loop for each muscle brings them about.

    q  = r + Tv r' + Ta r'' + Kp e + Ki ∫e dt + Kd (r' - y')        e = r - y
    p1, p2 = M(q)                                                    M: the inverse static map at a sum of pressures

``q`` is the angle at which the joint would come to rest with the pressures asked for, so all gains are without unit
or in seconds, and the slope of the map schedules them: where a bar moves the joint far, little is asked for. ``r``
in the feed-forward is the reference a lead time ahead, which makes up for the lateness of the inner loops.

Anti-windup: the integral stands still while ``q`` is beyond what the map can give or a valve does all that it can,
and where it would push further.
"""

from dataclasses import dataclass, replace

from pneumarm.arm import ArmSpec
from pneumarm.classical.following import FollowGains, Wish
from pneumarm.classical.pressure_loop import PressureLoop, Rates
from pneumarm.classical.static_map import StaticMap, interpolate


@dataclass(frozen=True)
class CascadeGains(FollowGains):
    """Gains of the cascade; times in seconds."""

    total: float = 1.0
    """Sum of both pressures, in units of the highest: co-contraction."""
    proportional: float = 0.5
    """Kp."""
    integral: float = 2.0
    """Ki [1/s]."""
    derivative: float = 0.05
    """Kd."""
    velocity: float = 0.05
    """Tv."""
    acceleration: float = 0.004
    """Ta [s2]."""
    lead: float = 0.05
    """How far ahead the reference is fed forward."""
    memory: float = 0.5
    """Share of the map's error, as it is where a movement begins, that the integral begins with."""
    pressure_gain: float = 0.8
    """Share of a pressure's error that a pulse takes away."""
    dead_band: float = 0.01
    """Errors of pressure below this are left [bar]."""
    trust: float = 0.7
    """Share of a reading that goes into the estimate of a pressure."""


@dataclass(frozen=True)
class ScheduledGains(CascadeGains):
    """Gains of the cascade that are scheduled over the angle: those given are of the middle of the range."""

    proportional_outside: float = 1.0
    """Factor of Kp at the ends of the range."""
    integral_outside: float = 1.0
    """Factor of Ki there."""
    derivative_outside: float = 1.0
    """Factor of Kd there."""
    total_outside: float = 1.0
    """Factor of the sum of pressures there."""


class Cascade:
    """The cascade of one joint."""

    def __init__(
        self,
        spec: ArmSpec,
        static_map: StaticMap,
        rates: tuple[Rates, Rates],
        gains: CascadeGains,
        shortest: float | None,
    ) -> None:
        self.gains, self.lead = gains, gains.lead
        self._map, self._period = static_map, spec.period
        self._loops = [
            PressureLoop(one, spec.period, spec.latency, shortest, gains.pressure_gain, gains.dead_band, gains.trust)
            for one in rates
        ]
        self._expected = [0.0, 0.0]
        self._integral = 0.0
        self._rested = False
        self._ends = static_map.ends

    def begin(self, angle: float, pressures: tuple[float, float]) -> None:
        """Begin with part of the map's error at this place as the integral."""
        for loop in self._loops:
            loop.reset()
        self._integral = self.gains.memory * (self._map.angle(*pressures) - angle)
        self._rested = False

    def read(self, pressures: tuple[float, float]) -> None:
        """Take in the pressures [bar]."""
        self._expected = [loop.read(p) for loop, p in zip(self._loops, pressures, strict=True)]

    def rest(self, wish: Wish) -> None:
        """Leave the valves closed."""
        for loop in self._loops:
            loop.commanded(0.0)
        self._rested = True

    def act(self, wish: Wish, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles."""
        gains = self._gains(wish.angle)
        error = wish.angle - angle
        if self._rested:  # go on from the pressures that there are, without a bump
            self._integral = self._map.angle(self._expected[0], self._expected[1]) - wish.angle
            self._rested = False
        forward = wish.ahead + gains.velocity * wish.velocity + gains.acceleration * wish.acceleration
        back = gains.proportional * error + gains.derivative * (wish.velocity_now - velocity)
        asked = forward + back + self._integral
        wanted = self._map.pressures(asked, gains.total * self._map.highest)
        commands = [
            loop.command(p, expected) for loop, p, expected in zip(self._loops, wanted, self._expected, strict=True)
        ]
        for loop, command in zip(self._loops, commands, strict=True):
            loop.commanded(command)
        if not self._saturated(asked, error):
            self._integral += gains.integral * error * self._period
        return commands[0], commands[1]

    def _gains(self, angle: float) -> CascadeGains:
        return self.gains

    def _saturated(self, asked: float, error: float) -> bool:
        """Return whether more of the integral, in the direction of ``error``, could bring nothing about."""
        low, high = self._ends
        beyond = (asked > high and error > 0) or (asked < low and error < 0)
        return beyond or all(loop.saturated for loop in self._loops)


class Scheduled(Cascade):
    """The cascade of one joint whose gains are interpolated between the middle and the ends of the range."""

    gains: ScheduledGains

    def _gains(self, angle: float) -> CascadeGains:
        gains = self.gains
        low, high = self._ends
        share = min(abs(2 * angle - low - high) / (high - low), 1.0)
        return replace(
            gains,
            proportional=gains.proportional * interpolate(share, (0.0, 1.0), (1.0, gains.proportional_outside)),
            integral=gains.integral * interpolate(share, (0.0, 1.0), (1.0, gains.integral_outside)),
            derivative=gains.derivative * interpolate(share, (0.0, 1.0), (1.0, gains.derivative_outside)),
            total=gains.total * interpolate(share, (0.0, 1.0), (1.0, gains.total_outside)),
        )
