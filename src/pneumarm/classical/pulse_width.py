"""PID with pulse-width modulation: the loop on the angle says directly for how long the valves are open.

    w   = Kp e + Kd (r' - y') + Kv r' - Kb (m(p1, p2) - I - y)      e = r - y, in degrees
    p1' = w + c (S - p1 - p2),   p2' = -w + c (S - p1 - p2)         S: the sum of pressures wanted

``w`` is a rate of pressure [bar/s]; the filling rates measured on the arm turn it into the share of a period.
Without pulses shares are summed up until they make a whole period. Kb damps by how far the joint is from the angle
at which it would rest with the pressures that there are, which is what its acceleration follows: ``m`` is the static
map and ``I`` its error, see :mod:`pneumarm.classical.muscles`.
"""

from dataclasses import dataclass

from pneumarm.arm import ArmSpec
from pneumarm.classical.following import CommonGains, Setpoint
from pneumarm.classical.muscles import muscles_of
from pneumarm.classical.pressure_loop import Rates
from pneumarm.classical.static_map import StaticMap


@dataclass(frozen=True)
class PulseWidthGains(CommonGains):
    """Gains of the loop; times in seconds."""

    proportional: float = 0.3
    """Kp [bar/s per degree]."""
    derivative: float = 0.0015
    """Kd [bar per degree]."""
    velocity: float = 0.02
    """Kv [bar per degree]."""
    balance: float = 0.25
    """Kb [bar/s per degree]."""
    stiffening: float = 2.0
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
        self.gains, self._counts = gains, spec.counts_per_degree
        self._total = gains.total * static_map.highest
        self._whole = shortest is None
        self._left = [0.0, 0.0]  # shares that have not made a whole period yet
        self.muscles = muscles_of(
            spec,
            static_map,
            rates,
            shortest,
            integral=gains.integral,
            memory=gains.memory,
            trust=gains.trust,
        )

    def begin(self) -> None:
        """Begin a movement."""
        self._left = [0.0, 0.0]

    def act(self, setpoint: Setpoint, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles."""
        gains, expected = self.gains, self.muscles.expected
        rate = gains.proportional * (setpoint.ahead - angle)
        rate += gains.derivative * (setpoint.velocity_now - velocity) + gains.velocity * setpoint.velocity
        rate -= gains.balance * (self.muscles.rest_angle(*expected) - angle)
        rate /= self._counts
        common = gains.stiffening * (self._total - expected[0] - expected[1])
        return self._command(0, common + rate), self._command(1, common - rate)

    def _command(self, muscle: int, rate: float) -> float:
        loop = self.muscles.loops[muscle]
        share = min(max(rate / loop.rates.at(self.muscles.expected[muscle], rate), -1.0), 1.0)
        if not self._whole:
            return loop.pulse(share)
        self._left[muscle] += share
        command = float(round(min(max(self._left[muscle], -1.0), 1.0)))
        self._left[muscle] = min(max(self._left[muscle] - command, -1.0), 1.0)
        return command
