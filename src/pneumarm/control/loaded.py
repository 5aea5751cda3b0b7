"""A controller as a program gets it from a file: with goals in counts or degrees, all within what the arm does."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm import ArmSpec, Controller, Reading
from pneumarm.arm.controller import TrackingController
from pneumarm.arm.reference import Reference
from pneumarm.arm.valves import Command
from pneumarm.task.goals import goal_in_counts
from pneumarm.task.reference import parse_reference
from pneumarm.transitions.goals import Goals


class LoadedController:
    """A controller, the spec of the arm that it is for, and the goals that it knows.

    Args:
        controller: what acts.
        spec: of its arm.
        goals: that it knows.

    """

    def __init__(self, controller: Controller, spec: ArmSpec, goals: Goals) -> None:
        self.controller, self.spec, self.goals = controller, spec, goals

    @property
    def goal_range(self) -> NDArray[np.float64]:
        """Goals that it knows, shape (joints, 2) [counts]; joints that pull on each other not all of them."""
        return self.goals.range

    @property
    def goal_range_deg(self) -> NDArray[np.float64]:
        """Goals that it knows, shape (joints, 2) [degrees from the middle of the range]."""
        return self.spec.degrees(self.goal_range)

    def reset(self, goal: ArrayLike | None = None, *, goal_deg: ArrayLike | None = None) -> None:
        """Begin a movement with the arm at rest and its valves closed.

        Args:
            goal: one number, or one a joint [counts].
            goal_deg: the same in degrees from the middle of the range, in place of ``goal``.

        Raises:
            UnusableInput: it is no goal, or one that the arm has not been seen to reach.

        """
        self.controller.reset(goal_in_counts(goal, goal_deg, self.spec, self.goals))

    def act(self, reading: Reading) -> Command:
        """Return the valves or pulses (joints, 2) to set after ``reading``; call it once a control period."""
        return self.controller.act(reading)

    def __repr__(self) -> str:
        ranges = ", ".join(f"{low:.0f} to {high:.0f} degrees" for low, high in self.goal_range_deg)
        return f"<{type(self.controller).__name__} for {self.spec.name}, {1 / self.spec.period:.0f} Hz, {ranges}>"


class LoadedTracker(LoadedController):
    """One that also follows references."""

    def __init__(self, controller: TrackingController, spec: ArmSpec, goals: Goals) -> None:
        super().__init__(controller, spec, goals)
        self._tracking = controller

    def track(self, reference: Reference | str) -> None:
        """Follow ``reference``, which begins at the time of the next reading.

        It may be a name, such as ``sine:0.5Hz,20deg``; see :mod:`pneumarm.task.reference`.
        """
        known = parse_reference(reference, self.spec) if isinstance(reference, str) else reference
        self._tracking.track(known)


def loaded(controller: Controller, spec: ArmSpec, goals: Goals) -> LoadedController:
    """Return ``controller`` as one that checks its goals; it follows references where ``controller`` does."""
    if isinstance(controller, TrackingController):
        return LoadedTracker(controller, spec, goals)
    return LoadedController(controller, spec, goals)
