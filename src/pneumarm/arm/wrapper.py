"""An arm that passes everything on to the arm behind it: the base of those that change or watch one thing."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm, Reading


class ArmWrapper(Arm):
    """``arm``, with its spec; what is not overridden is its own."""

    def __init__(self, arm: Arm) -> None:
        self.arm, self.spec, self.real_time = arm, arm.spec, arm.real_time

    def read(self) -> Reading:
        """Return what the sensors say."""
        return self.arm.read()

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves."""
        self.arm.set_valves(valves)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses, if the arm can time them."""
        return self.arm.set_pulses(command)

    def air_used(self) -> float | None:
        """Return the air that the arm has used."""
        return self.arm.air_used()

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        self.arm.wait(seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s]."""
        self.arm.wait_until(time)

    def make_ready(self) -> None:
        """Prepare to move after a pause."""
        self.arm.make_ready()

    def regain(self) -> None:
        """Take up the arm again after its line was lost."""
        self.arm.regain()

    def link_counts(self) -> dict[str, int]:
        """Return what has happened on the link to the arm."""
        return self.arm.link_counts()

    def get_state(self) -> bytes | None:
        """Return the state of the arm."""
        return self.arm.get_state()

    def set_state(self, state: bytes) -> None:
        """Restore the state of the arm."""
        self.arm.set_state(state)

    def close(self) -> None:
        """Close the arm."""
        self.arm.close()


Kind = TypeVar("Kind", bound=Arm)


def unwrapped(arm: Arm | None, kind: type[Kind]) -> Kind | None:
    """Return the arm of a ``kind`` behind ``arm``, which may be guarded, paced or corrected; None where none is."""
    while arm is not None and not isinstance(arm, kind):
        arm = getattr(arm, "arm", None)
    return arm
