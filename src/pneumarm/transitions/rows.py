"""Rows of the store as arrays: what was measured, raw, and what was commanded, in order of time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Rows:
    """A block of ``n`` rows, whole sequences in order; a row is an observation and the command that followed it.

    Velocity is not among them: it is derived (thesis section 2.3.4), see :mod:`pneumarm.transitions.window`.
    """

    sequence: NDArray[np.int64]
    """Number of the sequence, shape (n,)."""
    step: NDArray[np.int64]
    """Step within the sequence, shape (n,); rows whose steps do not follow on each other are never joined."""
    time: NDArray[np.float64]
    """Time of the reading on the arm's clock, shape (n,) [s]."""
    angle: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    pressure: NDArray[np.float64]
    """Shape (n, joints, 2) [counts]."""
    command: NDArray[np.float64]
    """What was applied after the reading, shape (n, joints, 2): valves -1, 0, +1, or a continuous command in
    an imported recording; NaN in the last row of a sequence, after which nothing was recorded."""
    at_rest: NDArray[np.bool_]
    """Whether the row's sequence began at rest with closed valves, so that rows before its first may be taken
    as copies of it, shape (n,)."""

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.angle.shape[1])

    def __len__(self) -> int:
        return len(self.sequence)
