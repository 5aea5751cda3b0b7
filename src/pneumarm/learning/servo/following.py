"""A moving reference on its way: where it goes, what it is missed by, and whether plans keep nearer to it."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.reference import Reference
from pneumarm.learning.servo.correction import Correction, features_of
from pneumarm.learning.servo.predictive import PredictiveControl
from pneumarm.learning.servo.servo import Servo
from pneumarm.learning.servo.two_ways import TwoWays
from pneumarm.task.acting import LATE
from pneumarm.task.forecast import Forecast

TAUGHT_BY = 2.0  # most tolerances of an error that corrections are learned from
_HOPED, _LEARNED = 0.5, 0.7  # tolerances that plans are hoped to be off by; see TwoWays
_GAINED = 0.12  # tolerances nearer by a plan than by the policy, in the simulation, for plans to be tried first ...
_ASKED = 0.0, 0.167, 0.333  # s after a reference began to move, at which the simulation is asked that
_BELIEVED = 2.0  # ... and kept while they are not off by more


class Following:
    """How one reference is followed, from its begin on."""

    def __init__(self, reference: Reference, agent: Servo, tolerance: float) -> None:
        """Begin, moved by ``agent``; corrections are learned from errors of a few of this ``tolerance`` [counts]."""
        self._reference, self._spec = reference, agent.spec
        self._middle = agent.goal_range.mean(axis=1)
        self._unit = agent.settings.tolerance * agent.spec.counts_per_degree
        self._forecast = Forecast(agent.spec.period)
        self._before: NDArray[np.float64] | None = None
        self._correction = Correction(agent.spec.joints, TAUGHT_BY * tolerance)
        self._ways = TwoWays(agent.spec.period, _HOPED, learned=_LEARNED)
        self._asked = [1 + round(after / agent.spec.period) for after in _ASKED]
        self._moved = 0  # turns in which the reference has moved
        self._planned_at: float | None = None  # time of the last reading, if what followed it was planned

    def path(self, time: float, ahead: int) -> NDArray[np.float64]:
        """Return what was asked for a period ago, is now, and will be in those to come, shape (3 + ahead, joints).

        ``time`` [s] counts from its begin; ``ahead`` periods matter, and one after them says how it goes on.
        """
        now, steps = self._reference.at(time), np.arange(1, 2 + ahead)
        if self._reference.stays:
            return np.tile(now, (3 + ahead, 1))
        if self._reference.known_ahead:
            coming = np.array([self._reference.at(time + k * self._spec.period) for k in steps])
        else:
            self._forecast.see(now, time)
            coming = self._forecast.ahead(steps)
        before, self._before = now if self._before is None else self._before, now
        return np.concatenate([[before, now], coming])

    def corrections(
        self, path: NDArray[np.float64], moves: NDArray[np.bool_], angle: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what is added to a ``path`` for joints it ``moves`` (joints,), learned from what they miss it by.

        ``angle`` (joints,) is what is read now; returned are (1 + ahead, joints), from now on [counts].
        """
        if self._reference.stays:
            return np.zeros_like(path[1:-1])
        features = features_of(path, self._middle)
        self._correction.learn(np.where(moves, path[1] - angle, 0.0), features[0])
        return self._correction.of(features)

    def is_planned(
        self,
        plans: PredictiveControl,
        moves: NDArray[np.bool_],
        off: NDArray[np.float64],
        state: NDArray[np.float32],
        wanted: NDArray[np.float64],
    ) -> bool:
        """Return whether commands are planned now: where the reference ``moves`` (joints,) and that keeps nearer.

        ``off`` (joints,) is how far the joints are from it [counts]; the rest as of
        :meth:`.PredictiveControl.pulses`. Before anything was seen the simulation is believed.
        """
        if not moves.any():
            self._ways.leave()
            return False
        self._moved += 1
        before = self._ways.second
        if self._moved in self._asked and not before and plans.gains(state, wanted) > _GAINED:
            self._ways = TwoWays(self._spec.period, _HOPED, (_BELIEVED, _HOPED), learned=_LEARNED)
        self._ways.see(float(np.abs(off[moves]).max() / self._unit))
        if self._ways.second != before:  # what one way falls short by says nothing of the other
            self._correction.forget()
        return self._ways.second

    def note_plan(self, time: float, plans: PredictiveControl | None) -> None:
        """Note that what follows the reading at ``time`` [s] is planned, or is not; late ``plans`` are hurried."""
        if plans is not None and self._planned_at is not None and time - self._planned_at > LATE * self._spec.period:
            plans.hurry()
        self._planned_at = None if plans is None else time
