"""The guard between any controller and any arm: no inlet opens into a muscle that reads over its limit."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import Arm, Reading, checked
from pneumarm.errors import PneumarmError

_SETTINGS = frozenset((-1, 0, 1))


class GuardedArm(Arm):
    """An arm whose inlets stay closed while their muscle reads over ``spec.max_pressure``.

    Waits with an open inlet are cut into control periods with a reading between them, so that the limit also
    holds during a long inflation. ``applied`` are the valves as they were really set.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.spec = arm.spec
        self.applied: NDArray[np.int8] = np.zeros((arm.spec.joints, 2), np.int8)
        self.interventions = 0
        """Number of times that an inlet was kept closed."""
        self.peak_pressure = np.zeros((arm.spec.joints, 2))
        """Highest pressures read, shape (joints, 2) [counts]."""
        self._limit = arm.spec.max_pressure_counts
        self._over: NDArray[np.bool_] | None = None  # which muscles read over the limit; None if none does

    def read(self) -> Reading:
        """Return a checked reading and remember which muscles are over the limit."""
        reading = checked(self.arm.read(), self.spec)
        over = max(reading.pressure.ravel().tolist()) > self._limit
        self._over = reading.pressure > self._limit if over else None
        np.maximum(self.peak_pressure, reading.pressure, out=self.peak_pressure)
        return reading

    def set_valves(self, valves: ArrayLike) -> None:
        """Set ``valves`` (joints, 2), with the inlets of muscles over the limit kept closed."""
        asked = np.asarray(valves)
        if asked.shape != self.applied.shape or not _SETTINGS.issuperset(asked.ravel().tolist()):
            raise PneumarmError(f"valves must be {self.applied.shape} of -1, 0 or +1, got {valves!r}")
        applied = asked.astype(np.int8)
        if self._over is not None:
            blocked = (applied > 0) & self._over
            applied[blocked] = 0
            self.interventions += int(blocked.sum())
        self.arm.set_valves(applied)
        self.applied = applied

    def wait(self, seconds: float) -> None:
        """Let time pass, looking at the pressures every control period while an inlet is open."""
        while seconds > self.spec.period and (self.applied > 0).any():
            self.arm.wait(self.spec.period)
            seconds -= self.spec.period
            self.read()
            if self._over is not None and ((self.applied > 0) & self._over).any():
                self.set_valves(self.applied)
        self.arm.wait(seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s]."""
        self.arm.wait_until(time)

    def get_state(self) -> bytes | None:
        """Return the state of the arm behind."""
        return self.arm.get_state()

    def set_state(self, state: bytes) -> None:
        """Restore the state of the arm behind."""
        self.arm.set_state(state)
        self.applied = np.zeros_like(self.applied)

    def close(self) -> None:
        """Close the arm behind."""
        self.arm.close()


def guarded(arm: Arm) -> GuardedArm:
    """Return ``arm`` behind a guard; an arm that has one already is returned as it is."""
    return arm if isinstance(arm, GuardedArm) else GuardedArm(arm)
