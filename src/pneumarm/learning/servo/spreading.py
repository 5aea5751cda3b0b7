"""Pulses of an arm without any: spread over whole periods."""

import numpy as np
from numpy.typing import NDArray

_MOST = 0.8  # of a period for which a valve is due, for it to open for one
_FORGOTTEN = 0.8  # share of what is due that is left after a period with closed valves


class Spreading:
    """Pulses spread over whole periods, for an arm without pulses: error diffusion of first order.

    What a valve was to be open for is summed up, and once that is most of a period the valve opens for one.
    """

    def __init__(self, joints: int) -> None:
        self._due = np.zeros((joints, 2))

    def __call__(self, pulses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return whole periods (joints, 2) of -1, 0, +1 for ``pulses`` (joints, 2)."""
        self._due[pulses * self._due < 0] = 0.0  # the other way than before
        self._due[pulses == 0] *= _FORGOTTEN
        self._due += pulses
        opened = np.where(np.abs(self._due) >= _MOST, np.sign(self._due), 0.0)
        self._due = np.clip(self._due - opened, -1.0, 1.0)
        return opened
