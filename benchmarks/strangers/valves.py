"""Solenoid valves of strangers: open a while after their coil has current, closed a while after it has none.

One whose current ends before it opens stays closed, so a pulse shorter than the time to open does nothing; and one
that has current again before it closes stays open.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Valves:
    """Inlets and outlets of the muscles of an arm, and from when to when each is open."""

    def __init__(self, opening: Array, closing: Array) -> None:
        """Take dead times of opening and closing, shape (joints, 2, 2): of inlet and outlet of each muscle [s]."""
        self._dead = [*zip(opening.ravel().tolist(), closing.ravel().tolist(), strict=True)]
        self.open = np.full((*opening.shape, 2), -math.inf)
        """From when to when each is open, or was [s]."""
        self.current = np.full(opening.shape, -math.inf)
        """Until when its coil has current [s]."""

    def set(self, now: float, command: Array, period: float) -> None:
        """Set the valves ``command`` (joints, 2) at a time [s]: -1 to 1, whose magnitude is a share of ``period``."""
        wanted = np.stack([command, -command], axis=-1).ravel().tolist()
        spans, current = self.open.reshape(-1, 2), self.current.reshape(-1)
        for i, (share, (opening, closing)) in enumerate(zip(wanted, self._dead, strict=True)):
            opens, closes, until = float(spans[i, 0]), float(spans[i, 1]), float(current[i])
            if share <= 0 and until <= now:
                continue
            end = now if share <= 0 else math.inf if share >= 1 else now + share * period
            if until <= now and not opens < now < closes:
                opens = now + opening
            spans[i] = opens, (end + closing if end > opens else opens)
            current[i] = end
