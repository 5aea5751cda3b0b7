"""Sliding mode over the nine actions of a joint.

    s = e + e' / lambda - kappa (m(p1, p2) - I - y)        e = r - y

The last term stands for the acceleration: the joint is drawn to where it would rest with the pressures that there
are, by the static map ``m`` and its error ``I`` (:mod:`pneumarm.classical.muscles`). On s = 0 the error dies away.
Within a boundary layer about it nothing is done; outside, of the nine actions the one is taken that after a period
leaves the least |s|, and little of it the pressures' sum wrong: the reaching condition with the filling rates of the
arm instead of a sign.
"""

from dataclasses import dataclass

from pneumarm.arm import ArmSpec
from pneumarm.arm.valves import CLOSED, VALVES
from pneumarm.classical.following import CommonGains, Setpoint
from pneumarm.classical.muscles import muscles_of
from pneumarm.classical.pressure_loop import Rates
from pneumarm.classical.static_map import StaticMap

_ACTIONS = [(float(first), float(second)) for first, second in VALVES.tolist()]


@dataclass(frozen=True)
class SlidingGains(CommonGains):
    """Constants of the surface; times in seconds."""

    slope: float = 24.0
    """lambda [1/s]."""
    balance: float = 0.9
    """kappa."""
    layer: float = 0.8
    """Half of the boundary layer's thickness, in s [degrees]."""
    stiffening: float = 9.5
    """What a bar that the sum is off counts as, in s [degrees/bar]."""
    switching: float = 0.2
    """What another action than the last counts as, in s [degrees]."""


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
        self.gains, self._period, self._counts = gains, spec.period, spec.counts_per_degree
        self._total = gains.total * static_map.highest
        self._last = CLOSED
        self.muscles = muscles_of(
            spec,
            static_map,
            rates,
            None,
            integral=gains.integral,
            memory=gains.memory,
            trust=gains.trust,
        )

    def begin(self) -> None:
        """Begin a movement with closed valves."""
        self._last = CLOSED

    def act(self, setpoint: Setpoint, angle: float, velocity: float) -> tuple[float, float]:
        """Return the commands of both muscles."""
        gains = self.gains
        surface = setpoint.ahead - angle + (setpoint.velocity - velocity) / gains.slope + gains.balance * angle
        missed = [self._missed(surface, valves) for valves in _ACTIONS]
        if missed[CLOSED] <= gains.layer:
            missed[CLOSED] = 0.0
        costs = [one + self._cost(action) for action, one in enumerate(missed)]
        self._last = CLOSED if missed[CLOSED] == 0.0 else costs.index(min(costs))
        return _ACTIONS[self._last]

    def _after(self, valves: tuple[float, float]) -> tuple[float, float]:
        """Return the pressures [bar] after a period of ``valves``."""
        first, second = (
            max(expected + command * loop.rates.at(expected, command) * self._period, 0.0)
            for loop, expected, command in zip(self.muscles.loops, self.muscles.expected, valves, strict=True)
        )
        return first, second

    def _missed(self, surface: float, valves: tuple[float, float]) -> float:
        """Return |s| after a period of ``valves`` [degrees]; ``surface`` is what of s they do not change [counts]."""
        rest = self.muscles.rest_angle(*self._after(valves))
        return abs(surface - self.gains.balance * rest) / self._counts

    def _cost(self, action: int) -> float:
        off = abs(sum(self._after(_ACTIONS[action])) - self._total)
        return self.gains.stiffening * off + (self.gains.switching if action != self._last else 0.0)
