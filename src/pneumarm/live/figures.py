"""How well controllers move while people play with them: figures of the last goals and curves, side by side."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumarm.moving.settling import settled_at

HELD = 2.0
"""A goal that stayed the same for so long [s] is counted."""
LEAST = 5.0
"""... if it was so far away when it was given [degrees]."""
_RESTING = 1.0  # the last part [s] of that in which the rest error is the mean error
_KEPT = 100  # goals, of each controller


@dataclass
class ControllerFigures:
    """What came of the last goals and curves of one controller."""

    settled: deque[float]
    """Time [s] from a goal until the arm had settled (:mod:`pneumarm.moving.settling`); infinite where it did not."""
    rest: deque[float]
    """Mean error at rest of the joint that is worst [degrees]."""
    curve: float | None = None
    """Root mean squared error of the joint that is worst along the last curve [degrees]."""

    def results(self) -> dict[str, float | int | None]:
        """Return them for a page: how many goals, how many settled, medians of time [s] and rest error [degrees]."""
        times = [time for time in self.settled if math.isfinite(time)]
        return {
            "goals": len(self.settled),
            "settled": len(times),
            "time": float(np.median(times)) if times else None,
            "rest": float(np.median(self.rest)) if self.rest else None,
            "curve": self.curve,
        }


class PlayFigures:
    """Sees every error of the arm and makes figures of the goals that were given and then left alone."""

    def __init__(self) -> None:
        self.by_controller: dict[str, ControllerFigures] = {}
        self._since: float | None = None  # when the goal was given that is counted; None while none is
        self._seen: list[tuple[float, NDArray[np.float64]]] = []  # times [s], errors (joints,) [degrees]
        self._curve: tuple[float, int] | None = None  # sum of squares, number

    def of(self, controller: str) -> ControllerFigures:
        """Return the figures of ``controller``."""
        return self.by_controller.setdefault(controller, ControllerFigures(deque(maxlen=_KEPT), deque(maxlen=_KEPT)))

    def new_goal(self, time: float, error: NDArray[np.float64]) -> None:
        """Begin to count a goal that is given at ``time`` [s] and is ``error`` (joints,) [degrees] away."""
        far = float(np.abs(error).max()) >= LEAST
        self._since, self._seen, self._curve = time if far else None, [], None

    def new_curve(self) -> None:
        """Begin to count a curve."""
        self.forget()
        self._curve = 0.0, 0

    def forget(self) -> None:
        """Count nothing of what is going on."""
        self._since, self._curve = None, None

    def see(self, controller: str, time: float, error: NDArray[np.float64]) -> None:
        """Take in the ``error`` (joints,) [degrees] at ``time`` [s], while a goal is held or a curve followed."""
        worst = float(np.abs(error).max())
        if self._curve is not None:
            self._curve = self._curve[0] + worst**2, self._curve[1] + 1
            return
        if self._since is None:
            return
        self._seen.append((time, error))
        if time - self._since >= HELD:
            times, errors = (np.array(values) for values in zip(*self._seen, strict=True))
            settled = settled_at(times, errors)
            kept = self.of(controller)
            kept.settled.append(math.inf if settled is None else settled - self._since)
            kept.rest.append(float(np.abs(errors[times - self._since > HELD - _RESTING]).max(axis=1).mean()))
            self._since = None

    def end_curve(self, controller: str) -> None:
        """Keep what came of the curve."""
        if self._curve is not None and self._curve[1]:
            self.of(controller).curve = math.sqrt(self._curve[0] / self._curve[1])
        self._curve = None
