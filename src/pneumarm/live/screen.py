"""What all pages are shown: the arm as it is now, many times a second, and how things stand, when that changes."""

from collections.abc import Mapping
from threading import Lock
from time import monotonic
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, Reading
from pneumarm.arm.valves import Command
from pneumarm.console import jsonable

MOST_FRAMES = 40.0
"""Frames a second; of an arm that is controlled faster only some readings are shown."""


class Screen:
    """The last frame and the state, each with a number that grows when it changes."""

    def __init__(self) -> None:
        self.frame = "{}"
        """The last frame, JSON."""
        self.frames = 0
        """How many there have been."""
        self.versions = 0
        """How often the state has changed."""
        self._state: dict[str, Any] = {}
        self._lock = Lock()
        self._shown = 0.0

    def show(
        self, spec: ArmSpec, reading: Reading, wanted: NDArray[np.float64] | None, command: Command | None
    ) -> None:
        """Show a reading, the angles (joints,) [counts] wanted at that time, and the command after it."""
        now = monotonic()
        if now - self._shown < 1 / MOST_FRAMES:
            return
        self._shown = now
        frame = {
            "time": round(reading.time, 4),
            "angle": spec.degrees(reading.angle).round(2).tolist(),
            "goal": None if wanted is None else spec.degrees(wanted).round(2).tolist(),
            "pressure": _of_muscles(spec.bar(reading.pressure), spec).round(4).tolist(),
            "valves": None if command is None else _of_muscles(command, spec).round(3).tolist(),
        }
        self.frame = msgspec.json.encode(frame).decode()
        self.frames += 1

    def tell(self, **state: Any) -> None:
        """Change what is told of how things stand, where it is something else."""
        known: Mapping[str, Any] = jsonable(state)
        with self._lock:
            if any(self._state.get(name, ...) != value for name, value in known.items()):
                self._state.update(known)
                self.versions += 1

    @property
    def state(self) -> dict[str, Any]:
        """How things stand."""
        with self._lock:
            return dict(self._state)


def _of_muscles(values: NDArray[Any], spec: ArmSpec) -> NDArray[Any]:
    """Return ``values`` of muscles that are there, shape (joints, muscles)."""
    return np.asarray(values).reshape(spec.joints, -1)[:, : spec.muscles]
