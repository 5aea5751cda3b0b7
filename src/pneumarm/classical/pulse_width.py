"""PID with pulse-width modulation: the loop on the angle says directly for how long the valves are open.

    w  = Kp e + Ki ∫e dt + Kd (r' - y') + Kv r' + Kb (y_rest - y)        e = r - y, in degrees
    p1' = w + c (S - p1 - p2),   p2' = -w + c (S - p1 - p2)                  S: the sum of pressures wanted

``w`` is a rate of pressure [bar/s]; the filling rates measured on the arm turn it into the share of a period.
Without pulses shares are summed up until they make a whole period. Kb damps by how far the joint is from the angle
at which it would rest with the pressures that there are (by the static map), which is what its acceleration follows.
"""

from dataclasses import dataclass

from pneumarm.arm import ArmSpec
from pneumarm.classical.following import FollowGains, Wish
from pneumarm.classical.pressure_loop import PressureLoop, Rates
from pneumarm.classical.static_map import StaticMap


@dataclass(frozen=True)
class PulseWidthGains(FollowGains):
    """Gains of the loop; times in seconds."""

    total: float = 1.0
    """Sum of both pressures, in units of the highest."""
    proportional: float = 0.08
    """Kp [bar/s per degree]."""
    integral: float = 0.1
    """Ki [bar/s2 per degree]."""
    derivative: float = 0.006
    """Kd [bar per degree]."""
    velocity: float = 0.01
    """Kv [bar per degree]."""
    balance: float = 0.05
    """Kb, negative feedback [bar/s per degree]."""
    lead: float = 0.05
    """How far ahead the reference is followed."""
    stiffening: float = 3.0
    """c [1/s]."""


class PulseWidth:
    """The loop of one joint."""

    def __init__(
        self,
        spec: ArmSpec,
        static_map: StaticMap,
        rates: tuple[Rates, Rates],
        gains: PulseWidthGains,
        shortest: float | None,
    ) -> None:
        self.gains, self.lead = gains, gains.lead
        self._map, self._period, self._counts = static_map, spec.period, spec.counts_per_degree
        self._total = gains.total * static_map.highest
        self._loops = [PressureLoop(one, spec.period, spec.latency, shortest, 1.0, 0.0, 1.0) for one in rates]
        self._whole = shortest is None
        self._expected = [0.0, 0.0]
        self._left = [0.0, 0.0]
        self._integral = 0.0

    def begin(self, angle: float, pressures: tuple[float, float]) -> None:
        """Begin without an integral."""
        for loop in self._loops:
            loop.reset()
        self._integral, self._left = 0.0, [0.0, 0.0]

    def read(self, pressures: tuple[float, float]) -> None:
        """Take in the pressures [bar]."""
        self._expected = [loop.read(p) for loop, p in zip(self._loops, pressures, strict=True)]

    def rest(self, wish: Wish) -> None:
        """Leave the valves closed."""
        for loop in self._loops:
            loop.commanded(0.0)
        self._integral, self._left = 0.0, [0.0, 0.0]

    def act(self, wish: Wish, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles."""
        gains = self.gains
        error = (wish.ahead - angle) / self._counts
        rate = gains.proportional * error + self._integral
        rate += (gains.derivative * (wish.velocity_now - velocity) + gains.velocity * wish.velocity) / self._counts
        rate -= gains.balance * (self._map.angle(self._expected[0], self._expected[1]) - angle) / self._counts
        common = gains.stiffening * (self._total - sum(self._expected))
        commands = [self._command(0, rate + common), self._command(1, common - rate)]
        if not all(abs(command) >= 1 for command in commands) or error * rate < 0:  # else it would wind up
            self._integral += gains.integral * error * self._period
        return commands[0], commands[1]

    def _command(self, muscle: int, rate: float) -> float:
        loop = self._loops[muscle]
        share = rate / loop.rates.at(self._expected[muscle], rate)
        share = min(max(share, -1.0), 1.0)
        if self._whole:
            self._left[muscle] += share
            command = float(round(min(max(self._left[muscle], -1.0), 1.0)))
            self._left[muscle] = min(max(self._left[muscle] - command, -1.0), 1.0)
        else:
            command = loop.pulse(share)
        loop.commanded(command)
        return command
