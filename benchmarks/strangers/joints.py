"""What the muscles of strangers turn: a hinge with its load, or two in a chain, and where they come to rest."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.strangers import motion
from benchmarks.strangers.air import ATMOSPHERE
from benchmarks.strangers.body import Body
from benchmarks.strangers.muscles import Muscles

Array = NDArray[np.float64]

_TORQUES = "inertia", "viscous", "spring", "weight", "stop_stiffness", "stop_damping", "creep"


class Statics(NamedTuple):
    """A joint by itself, without motion, friction or memory."""

    body: Body
    muscles: Muscles
    exponent: float
    """Of the change of state of air that is shut in."""

    def torque(self, angle: float, first: float, second: float) -> float:
        """Return the torque at ``angle`` [rad] and two pressures [bar gauge]; at rest it is 0 [N m]."""
        return float(motion.rests(self.body, self.muscles, angle, first, second))

    def volume(self, angle: float, muscle: int) -> float:
        """Return the volume of a ``muscle`` [l]."""
        return float(motion.volume_at(self.body, self.muscles, angle, muscle))

    def by_bar(self, pressure: float) -> float:
        """Return what a bar more in the first muscle turns with in the middle [N m/bar]."""
        return (self.torque(0.0, pressure + 0.01, pressure) - self.torque(0.0, pressure, pressure)) / 0.01

    def stiffness(self, pressure: float, closed: bool) -> float:
        """Return the stiffness in the middle, both muscles ``closed`` at a pressure or held at it [N m/rad]."""
        step = 0.01
        turned = [self.torque(side * step, *self._pressures(side * step, pressure, closed)) for side in (-1, 1)]
        return (turned[0] - turned[1]) / (2 * step)

    def _pressures(self, angle: float, pressure: float, closed: bool) -> list[float]:
        if not closed:
            return [pressure, pressure]
        squeezed = [self.volume(0.0, m) / self.volume(angle, m) for m in (0, 1)]
        return [(pressure + ATMOSPHERE) * one**self.exponent - ATMOSPHERE for one in squeezed]

    def reach(self, full: float, friction: float) -> tuple[float, float]:
        """Return how far muscles at ``full`` [bar] turn it from one end and from the other, against ``friction``.

        Shares of the way to the stop on the other side, -1 to 1: of the first muscle upwards, of the second down.
        """
        places = np.linspace(-1.0, 1.0, 41)
        stop = float(self.body.stop[0])
        up = [self.torque(place * stop, full, 0.0) > friction for place in places]
        down = [self.torque(-place * stop, 0.0, full) < -friction for place in places]
        return _first_not(places, up), _first_not(places, down)


def _first_not(places: Array, there: list[bool]) -> float:
    """Return the place before the first that is not ``there``."""
    return float(places[-1] if all(there) else places[max(there.index(False) - 1, 0)])


def joined(parts: list[Any]) -> Any:
    """Return named tuples of arrays as one, whose arrays hold a joint after the other."""
    return type(parts[0])(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def stronger(muscles: Muscles, body: Body, by: float) -> tuple[Muscles, Body]:
    """Return a joint of which everything that pulls, weighs and holds is stronger ``by`` a factor."""
    scaled = {name: getattr(body, name) * by for name in _TORQUES}
    return muscles._replace(table=muscles.table * by, damping=muscles.damping * by), body._replace(**scaled)
