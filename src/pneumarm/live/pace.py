"""An arm whose clock stands still while nobody waits, made to pass its time with the clock on the wall."""

from time import monotonic, sleep

from pneumarm.arm.seam import Arm, Reading
from pneumarm.arm.wrapper import ArmWrapper

_NAP = 0.05
"""For so long [s] a clock is watched to find out whether it stands still."""
_MOST_BEHIND = 0.1
"""An arm farther behind the clock on the wall than this [s] lets that time go, as after this computer slept."""


class Paced(ArmWrapper):
    """Gives each reading when its time has come: a virtual arm then takes the time that a real one takes."""

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm)
        self._ahead: float | None = None  # of the arm's clock before that on the wall

    def read(self) -> Reading:
        """Return what the sensors say, at its time."""
        reading = self.arm.read()
        now = monotonic()
        if self._ahead is None or reading.time - self._ahead < now - _MOST_BEHIND:
            self._ahead = reading.time - now
        sleep(max(reading.time - self._ahead - now, 0.0))
        return reading


def in_real_time(arm: Arm) -> Arm:
    """Return ``arm`` as it is if its clock runs by itself, else :class:`Paced`."""
    before = arm.read().time
    sleep(_NAP)
    return arm if arm.read().time - before > _NAP / 2 else Paced(arm)
