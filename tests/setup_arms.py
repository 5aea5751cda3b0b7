"""An arm for the first day: its joints can be turned by hand, and its wires be mended while it is set up."""

from dataclasses import replace

from pneumarm.arm import Reading
from pneumarm.arm.virtual import VirtualArm, draw_parameters


class HandArm(VirtualArm):
    """A virtual arm whose sensors read what a hand turns the joints to, while one does."""

    def __init__(self, seed: int = 3, joints: int = 1) -> None:
        super().__init__(draw_parameters(seed, joints), seed=seed)
        self.hand: dict[int, float] = {}
        """Angles of the joints that are held [counts], by their number from 0."""
        self.crossed: list[int] = list(range(joints))
        """Which joint's angle each channel reads."""
        self.reversed: set[int] = set()
        """Channels with the outer wires of their potentiometers swapped."""
        self.pressures_swapped = False
        """Whether the pressure sensors of each joint are on each other's channels."""

    def read(self) -> Reading:
        reading = super().read()
        angle = reading.angle.copy()
        for joint, held in self.hand.items():
            angle[joint] = held
        angle = angle[self.crossed]
        for channel in self.reversed:
            angle[channel] = sum(self.spec.angle_range) - angle[channel]
        pressure = reading.pressure[:, ::-1] if self.pressures_swapped else reading.pressure
        return replace(reading, angle=angle, pressure=pressure)


_arm: list[HandArm] = []


def begin(arm: HandArm) -> None:
    """Have ``arm`` be the one that is opened from now on."""
    _arm[:] = [arm]


def mine() -> HandArm:
    """Return the arm, for ``python:setup_arms:mine``."""
    return _arm[0]


def sound() -> HandArm:
    """Return an arm that nobody turns by hand, for ``python:setup_arms:sound`` in another process."""
    return HandArm()
