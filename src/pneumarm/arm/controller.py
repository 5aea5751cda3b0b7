"""The seam between pneumarm and any controller."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Reading


class Controller(Protocol):
    """What acts: maps what was read so far to valves."""

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts]; the arm is at rest with its valves closed."""

    def act(self, reading: Reading) -> NDArray[np.int8]:
        """Return the valves (joints, 2) to set after ``reading``."""
