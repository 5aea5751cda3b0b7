"""Pulses of an arm without any: spread over whole periods."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel

_MOST = 0.8  # of a period for which a valve is due, for it to open for one
_FORGOTTEN = 0.8  # share of what is due that is left after a period with closed valves


@kernel
def spread_pulses(due, pulses):  # type: ignore[no-untyped-def]
    """Replace ``pulses`` (joints, 2) by whole periods of -1, 0, +1; ``due`` (joints, 2) is what was left before."""
    for j in range(due.shape[0]):
        for muscle in range(2):
            pulse, left = pulses[j, muscle], due[j, muscle]
            if pulse * left < 0.0:  # the other way than before
                left = 0.0
            if pulse == 0.0:
                left *= _FORGOTTEN
            left += pulse
            opened = 0.0
            if abs(left) >= _MOST:
                opened = 1.0 if left > 0.0 else -1.0
            due[j, muscle] = min(max(left - opened, -1.0), 1.0)
            pulses[j, muscle] = opened


class Spreading:
    """Pulses spread over whole periods, for an arm without pulses: error diffusion of first order.

    What a valve was to be open for is summed up, and once that is most of a period the valve opens for one.
    """

    def __init__(self, joints: int) -> None:
        self._due = np.zeros((joints, 2))

    def __call__(self, pulses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return whole periods (joints, 2) of -1, 0, +1 for ``pulses`` (joints, 2)."""
        opened = pulses.copy()
        spread_pulses(self._due, opened)
        return opened
