"""Sliding mode over the nine actions of a joint.

    s = e + e' / lambda - kappa (y_rest - y)        e = r - y

The last term stands for the acceleration: the joint is drawn to ``y_rest``, where it would rest with the pressures
that there are by the static map. On s = 0 the error dies away. Within a boundary layer about it nothing is done;
outside, of the nine actions the one is taken that after a period leaves the least |s|, and little of it the
pressures' sum wrong: the reaching condition with the filling rates of the arm instead of a sign.
"""

from dataclasses import dataclass

from pneumarm.arm import ArmSpec
from pneumarm.arm.valves import CLOSED, VALVES
from pneumarm.classical.following import FollowGains, Wish
from pneumarm.classical.pressure_loop import PressureLoop, Rates
from pneumarm.classical.static_map import StaticMap

_ACTIONS = [(float(first), float(second)) for first, second in VALVES.tolist()]


@dataclass(frozen=True)
class SlidingGains(FollowGains):
    """Constants of the surface; times in seconds."""

    total: float = 1.0
    """Sum of both pressures, in units of the highest."""
    slope: float = 15.0
    """lambda [1/s]."""
    balance: float = 0.8
    """kappa."""
    integral: float = 1.0
    """Share of the error that is added to s for each second that it lasts [1/s]."""
    layer: float = 1.0
    """Half of the boundary layer's thickness, in s [degrees]."""
    stiffening: float = 5.0
    """What a bar that the sum is off counts as, in s [degrees/bar]."""
    switching: float = 0.2
    """What another action than the last counts as, in s [degrees]."""
    lead: float = 0.05
    """How far ahead the reference is followed."""


class Sliding:
    """Sliding mode of one joint, by whole periods."""

    def __init__(
        self,
        spec: ArmSpec,
        static_map: StaticMap,
        rates: tuple[Rates, Rates],
        gains: SlidingGains,
        shortest: float | None = None,
    ) -> None:
        self.gains, self.lead = gains, gains.lead
        self._map, self._period, self._counts = static_map, spec.period, spec.counts_per_degree
        self._total = gains.total * static_map.highest
        self._loops = [PressureLoop(one, spec.period, spec.latency, None, 1.0, 0.0, 1.0) for one in rates]
        self._expected = [0.0, 0.0]
        self._integral = 0.0
        self._last = CLOSED

    def begin(self, angle: float, pressures: tuple[float, float]) -> None:
        """Begin with closed valves."""
        for loop in self._loops:
            loop.reset()
        self._integral, self._last = 0.0, CLOSED

    def read(self, pressures: tuple[float, float]) -> None:
        """Take in the pressures [bar]."""
        self._expected = [loop.read(p) for loop, p in zip(self._loops, pressures, strict=True)]

    def rest(self, wish: Wish) -> None:
        """Leave the valves closed."""
        for loop in self._loops:
            loop.commanded(0.0)
        self._last = CLOSED

    def act(self, wish: Wish, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles."""
        gains = self.gains
        error = (wish.ahead - angle) / self._counts
        surface = error + (wish.velocity - velocity) / self._counts / gains.slope + self._integral
        surface += gains.balance * angle / self._counts
        best, least = CLOSED, self._missed(surface, _ACTIONS[CLOSED])
        if abs(least) <= gains.layer:
            least = 0.0
        least = self._cost(CLOSED, abs(least))
        if least > 0:
            for action, valves in enumerate(_ACTIONS):
                cost = self._cost(action, abs(self._missed(surface, valves)))
                if cost < least:
                    best, least = action, cost
        self._last = best
        commands = _ACTIONS[best]
        for loop, command in zip(self._loops, commands, strict=True):
            loop.commanded(command)
        self._integral += gains.integral * error * self._period
        self._integral = min(max(self._integral, -_MOST), _MOST)
        return commands

    def _after(self, valves: tuple[float, float]) -> list[float]:
        """Return the pressures [bar] after a period of ``valves``."""
        return [
            max(expected + command * loop.rates.at(expected, command) * self._period, 0.0)
            for loop, expected, command in zip(self._loops, self._expected, valves, strict=True)
        ]

    def _missed(self, surface: float, valves: tuple[float, float]) -> float:
        first, second = self._after(valves)
        return surface - self.gains.balance * self._map.angle(first, second) / self._counts

    def _cost(self, action: int, missed: float) -> float:
        cost = missed + self.gains.stiffening * abs(sum(self._after(_ACTIONS[action])) - self._total)
        return cost + (self.gains.switching if action != self._last else 0.0)


_MOST = 8.0
"""The integral adds up to so much to s at most [degrees]: anti-windup."""
