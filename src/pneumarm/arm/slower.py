"""An arm that is controlled at every second, third or later one of its control periods.

Where valves open for parts of a period nothing is gained by deciding more often than the arm moves, and much is lost:
what an arm does in a period goes under in the noise of its readings, a window of so many of them holds less of its
past, and a training looks less far ahead. An arm without pulses has some then: as many of its own periods as one
likes. See docs/decisions/arm.md.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.errors import UnusableInput

_FASTEST, _USUAL = 50.0, 30.0  # Hz: who is faster than the first is controlled near the second


def usual_turns(period: float) -> int:
    """Return how many periods [s] of its own an arm is usually controlled by at a time."""
    return max(round(1 / (_USUAL * period)), 1) if period * _FASTEST < 1 else 1


class SlowerArm(ArmWrapper):
    """``arm``, with a control period that is ``turns`` of its own."""

    def __init__(self, arm: Arm, turns: int) -> None:
        if turns < 1:
            raise UnusableInput(f"{arm.spec.name}: expected every=1 or more of its periods, got {turns}")
        super().__init__(arm)
        self._turns = turns
        self.spec = replace(arm.spec, period=turns * arm.spec.period)
        if not arm.spec.pulses and turns > 1:
            own = arm.spec.period
            self.spec = replace(self.spec, pulses=True, shortest_pulse=own, pulse_step=own)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses, if the arm can time them and they end within one of its own periods."""
        if not self.arm.spec.pulses:
            return False
        share = np.abs(command)
        longer = np.where(share < 1, share * self._turns, share)
        return bool((longer <= 1).all()) and self.arm.set_pulses(np.sign(command) * np.where(share < 1, longer, 1.0))
