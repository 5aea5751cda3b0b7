"""The two muscles of a joint as its loops see them: their pressures soon, and where the joint will rest with them.

The static map is wrong by friction, load and creep. By how much is learned all the time from where the joint is and
what the pressures really are, which is the integral action of all loops here:

    I' = Ki (m(p1, p2) - y - I)        m: the static map

It goes to the error of the map whatever a loop asks for (an integral with external reset), so nothing winds up where
valves or pressures do all that they can. A moving joint lies behind the map, so learning waits until it is slow.
"""

from pneumarm.arm import ArmSpec
from pneumarm.classical.pressure_loop import PressureLoop, Rates
from pneumarm.classical.static_map import StaticMap


class Muscles:
    """Both muscles of one joint.

    Args:
        spec: of the arm.
        static_map: of the joint.
        rates: of its muscles.
        loops: what commands them.
        integral: Ki [1/s].
        memory: share of the map's error, as it is where a movement begins, that is taken for true.

    """

    def __init__(
        self,
        spec: ArmSpec,
        static_map: StaticMap,
        loops: tuple[PressureLoop, PressureLoop],
        integral: float,
        memory: float,
    ) -> None:
        self.map, self.loops = static_map, loops
        self._share, self._memory = min(integral * spec.period, 1.0), memory
        self.expected = (0.0, 0.0)
        """Pressures when a command now takes effect [bar]."""
        self.error = 0.0
        """How far above the joint's rest the map is [counts]."""

    def begin(self, angle: float, pressures: tuple[float, float]) -> None:
        """Begin with closed valves, the joint at rest at ``angle`` [counts] and ``pressures`` [bar]."""
        for loop in self.loops:
            loop.reset()
        self.error = self._memory * (self.map.angle(*pressures) - angle)

    def read(self, angle: float, pressures: tuple[float, float], motion: float) -> None:
        """Take in a reading; ``motion`` is 0 for a joint that stands still and 1 for one that moves fast."""
        self.expected = (self.loops[0].read(pressures[0], motion), self.loops[1].read(pressures[1], motion))
        now = self.map.angle(self.loops[0].estimate or 0.0, self.loops[1].estimate or 0.0)
        self.error += self._share * (1 - motion) * (now - angle - self.error)

    def rest_angle(self, first: float, second: float) -> float:
        """Return where the joint will rest [counts] with the pressures ``first`` and ``second`` [bar]."""
        return self.map.angle(first, second) - self.error

    def commanded(self, commands: tuple[float, float]) -> None:
        """Remember the ``commands`` that are carried out after the last reading."""
        self.loops[0].commanded(commands[0])
        self.loops[1].commanded(commands[1])


def muscles_of(
    spec: ArmSpec,
    static_map: StaticMap,
    rates: tuple[Rates, Rates],
    shortest: float | None,
    *,
    integral: float,
    memory: float,
    trust: float,
    pressure_gain: float = 1.0,
    dead_band: float = 0.0,
) -> Muscles:
    """Return the muscles of a joint with a loop on the pressure of each."""

    def loop(one: Rates) -> PressureLoop:
        return PressureLoop(one, spec.period, spec.latency, shortest, pressure_gain, dead_band, trust)

    return Muscles(spec, static_map, (loop(rates[0]), loop(rates[1])), integral, memory)
