"""Controllers that only know how to reach a goal, made to hold it and to follow a reference."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec, Controller, Reading
from pneumarm.arm.reference import Reference, constant


class Holding:
    """Closes the valves while the goal is reached, and asks the controller behind again when the arm has left it.

    The goal is reached within half of the tolerance of every joint, slowly enough to stay within the whole of it, and
    is left where a joint is off by more than that. Under a moving reference the controller is given a new goal
    whenever the reference is a tolerance away from the last.

    Args:
        controller: what reaches goals.
        spec: of the arm.
        goal_range: goals that it knows, shape (joints, 2) [counts].
        tolerance: of every joint [degrees].

    """

    def __init__(
        self, controller: Controller, spec: ArmSpec, goal_range: NDArray[np.float64], tolerance: float = 1.0
    ) -> None:
        self.controller, self.spec, self.goal_range = controller, spec, goal_range
        self._tolerance = tolerance * spec.counts_per_degree
        self._reference = constant(goal_range.mean(axis=1))
        self._goal = self._reference.at(0.0)
        self._begin: float | None = None
        self._before: Reading | None = None
        self._holds = False

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts], to be held."""
        self.track(constant(goal))

    def track(self, reference: Reference) -> None:
        """Follow ``reference`` from the next reading on."""
        self._reference, self._begin, self._before = reference, None, None

    def act(self, reading: Reading) -> NDArray[Any]:
        """Return the valves (joints, 2) to set after ``reading``."""
        closed = np.zeros((self.spec.joints, 2), np.int8)
        if self._begin is None:
            self._begin, self._holds = reading.time, False
            self._aim(self._reference.at(0.0))
        wanted = self._reference.at(reading.time - self._begin)
        if np.abs(wanted - self._goal).max() > self._tolerance:
            self._holds = False
            self._aim(wanted)
        off = np.abs(reading.angle - self._goal).max()
        moved = np.inf if self._before is None else np.abs(reading.angle - self._before.angle).max()
        self._before = reading
        if self._holds and off > self._tolerance:
            self._holds = False
            self._aim(self._goal)
        elif not self._holds:
            self._holds = bool(off <= self._tolerance / 2 and moved <= self._tolerance / 2)
        return closed if self._holds else self.controller.act(reading)

    def _aim(self, goal: NDArray[np.float64]) -> None:
        self._goal = goal
        self.controller.reset(goal)
