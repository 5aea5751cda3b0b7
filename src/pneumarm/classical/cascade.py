"""The cascade: a PID loop on the angle asks for pressures, an inner loop for each muscle brings them about.

    q  = r + Tv r' + Ta r'' + Kp e + Kd (r' - y') + I        e = r - y
    p1, p2 = M(q)                                            M: the inverse static map at a sum of pressures

``q`` is the angle at which the joint would come to rest with the pressures asked for, so all gains are without unit
or in seconds, and the slope of the map schedules them: where a bar moves the joint far, little is asked for. ``r``
in the feed-forward is the reference a lead time ahead, which makes up for the lateness of the inner loops. ``I`` is
the error of the map, see :mod:`pneumarm.classical.muscles`.
"""

from dataclasses import dataclass

from pneumarm.arm import ArmSpec
from pneumarm.classical.following import CommonGains, Setpoint
from pneumarm.classical.muscles import muscles_of
from pneumarm.classical.pressure_loop import Rates
from pneumarm.classical.static_map import StaticMap


@dataclass(frozen=True)
class CascadeGains(CommonGains):
    """Gains of the cascade; times in seconds."""

    proportional: float = 0.33
    """Kp."""
    derivative: float = 0.009
    """Kd."""
    velocity: float = 0.045
    """Tv."""
    acceleration: float = 0.0017
    """Ta [s2]."""
    pressure_gain: float = 1.4
    """Share of a pressure's error that a pulse takes away."""
    dead_band: float = 0.0085
    """Errors of pressure below this are left [bar]."""


@dataclass(frozen=True)
class ScheduledGains(CascadeGains):
    """Gains of the cascade that are scheduled over the angle: those given are of the middle of the range."""

    proportional_outside: float = 1.0
    """Factor of Kp at the ends of the range."""
    derivative_outside: float = 1.0
    """Factor of Kd there."""
    velocity_outside: float = 1.0
    """Factor of Tv there."""
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
        self.gains, self.map = gains, static_map
        self.muscles = muscles_of(
            spec,
            static_map,
            rates,
            shortest,
            integral=gains.integral,
            memory=gains.memory,
            trust=gains.trust,
            pressure_gain=gains.pressure_gain,
            dead_band=gains.dead_band,
        )

    def begin(self) -> None:
        """Begin a movement: there is nothing to forget."""

    def act(self, setpoint: Setpoint, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles."""
        gains, muscles = self.gains, self.muscles
        proportional, derivative, velocity_gain, total = self._scheduled(setpoint.angle)
        asked = setpoint.ahead + velocity_gain * setpoint.velocity + gains.acceleration * setpoint.acceleration
        asked += proportional * (setpoint.angle - angle) + derivative * (setpoint.velocity_now - velocity)
        first, second = self.map.pressures(asked + muscles.error, total * self.map.highest)
        return (
            muscles.loops[0].command(first, muscles.expected[0]),
            muscles.loops[1].command(second, muscles.expected[1]),
        )

    def _scheduled(self, angle: float) -> tuple[float, float, float, float]:
        """Return Kp, Kd, Tv and the sum of pressures, in units of the highest, for a reference at ``angle``."""
        gains = self.gains
        return gains.proportional, gains.derivative, gains.velocity, gains.total


class Scheduled(Cascade):
    """The cascade of one joint whose gains are interpolated between the middle and the ends of the range."""

    gains: ScheduledGains

    def _scheduled(self, angle: float) -> tuple[float, float, float, float]:
        gains = self.gains
        low, high = self.map.ends
        outside = min(abs(2 * angle - low - high) / (high - low), 1.0)
        return (
            gains.proportional * (1 + outside * (gains.proportional_outside - 1)),
            gains.derivative * (1 + outside * (gains.derivative_outside - 1)),
            gains.velocity * (1 + outside * (gains.velocity_outside - 1)),
            gains.total * (1 + outside * (gains.total_outside - 1)),
        )
