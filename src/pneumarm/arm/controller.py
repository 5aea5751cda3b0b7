"""The seam between pneumarm and any controller."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.reference import Reference
from pneumarm.arm.seam import Reading
from pneumarm.arm.valves import Command


class Controller(Protocol):
    """What acts: maps what was read so far to commands."""

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts]; the arm is at rest with its valves closed."""

    def act(self, reading: Reading) -> Command:
        """Return the valves or pulses (joints, 2) to set after ``reading``."""


@runtime_checkable
class TrackingController(Controller, Protocol):
    """A controller that follows a reference and stays at a goal; ``reset`` is the case of a constant reference."""

    def track(self, reference: Reference) -> None:
        """Follow ``reference``, which begins at the time of the next reading, from whatever the arm is doing."""
