"""A servo as a controller of an arm: it settles at goals, holds them and follows references."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.reference import Reference, constant
from pneumarm.arm.seam import Reading, checked
from pneumarm.errors import UnusableInput
from pneumarm.learning.servo.following import Following
from pneumarm.learning.servo.rest import Rest
from pneumarm.learning.servo.servo import Servo
from pneumarm.learning.servo.spreading import Spreading
from pneumarm.task.tracker import StateTracker
from pneumarm.transitions.watch import made_up_readings


class ServoController:
    """Maps readings to pulses with a :class:`~.servo.Servo`.

    Joints whose goal stays are brought to rest there and kept at it (:class:`~.rest.Rest`). A moving reference is
    followed by the policy or by plans (:mod:`~.predictive`), whichever keeps nearer (:class:`~.following.Following`).
    """

    def __init__(self, agent: Servo) -> None:
        self.spec, self.goal_range = agent.spec, agent.goal_range
        self._agent, self._actor, self._plans = agent, agent.actor(), agent.predictive()
        self._previews = agent.task.inputs.steps
        self._ahead = int(self._previews.max()) if self._plans is None else self._plans.ahead
        self._tracker = StateTracker(agent.window, agent.scaling)
        self._rest = Rest(agent.spec, agent.simulation, agent.settings)
        self._spreading = None if agent.spec.pulses else Spreading(agent.spec.joints)
        self._following: Following | None = None
        self._begin: float | None = None
        self._fresh = True

    @property
    def ways(self) -> tuple[float, ...]:
        """What was learned of the joints of this arm, as in :attr:`.ServoSettings.ways`."""
        return self._rest.ways

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts], to be held; the arm is at rest with its valves closed."""
        goal = np.asarray(goal, np.float64).reshape(-1)
        if goal.shape != (self.spec.joints,) or not np.isfinite(goal).all():
            raise UnusableInput(f"a goal needs {self.spec.joints} finite angle(s) in counts, got {goal}")
        self._fresh = True
        self.track(constant(goal))

    def track(self, reference: Reference) -> None:
        """Follow ``reference``, which begins at the time of the next reading, from whatever the arm is doing."""
        self._following, self._begin = Following(reference, self._agent, self._rest.tolerance), None
        self._rest.leave()

    def act(self, reading: Reading) -> NDArray[np.float64]:
        """Return the commands (joints, 2) after ``reading``, shares of the period for which a valve is open."""
        if self._following is None:
            raise UnusableInput("call reset(goal) or track(reference) before act(reading)")
        reading = checked(reading, self.spec)
        if self._fresh:
            self._tracker.reset()
            self._rest.forget_readings()
            if self._plans is not None:
                self._plans.reset()
            self._fresh = False
        if self._begin is None:
            self._begin = reading.time
        state = self._tracker.reading(reading)
        path = self._following.path(reading.time - self._begin, self._ahead)
        moves = np.ptp(path[: 3 + self._previews.max()], axis=0) > 0
        acts = self._rest.which_act(path[1], ~moves, reading.angle, state)
        wanted = path[1:-1] + np.where(
            moves, self._following.corrections(path, moves, reading.angle), self._rest.bias
        )
        plans = self._plans
        if self._actor is not None and plans is not None:
            off = path[1] - reading.angle
            plans = plans if self._following.is_planned(plans, moves, off, state, wanted) else None
        self._following.note_plan(reading.time, plans)
        if plans is not None:
            command = plans.pulses(state, wanted) if acts.any() else np.zeros((self.spec.joints, 2))
        else:
            assert self._actor is not None
            underway = ~moves & ~self._rest.calm & ~self._rest.active
            command = self._actor.pulses(state, wanted[self._previews], underway)
        command = self._rest.shaped(command, acts, reading.pressure, state)
        if self._spreading is not None:
            command = self._spreading(command)
        self._tracker.commanded(command)
        return command


def ready_controller(agent: Servo) -> ServoController:
    """Return a controller of ``agent`` that waits for nothing to be compiled."""
    controller = ServoController(agent)
    controller.reset(agent.goal_range.mean(axis=1))
    for reading in made_up_readings(agent.spec):
        controller.act(reading)
    return ServoController(agent)
