"""One movement on an arm: from where it stands to a goal, counted as the thesis counts an episode (5.1, 5.2)."""

from collections.abc import Callable
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ControlCycle, Controller, Reading, Step
from pneumarm.arm.valves import Command
from pneumarm.errors import ArmFailure
from pneumarm.task import Movement, Reward
from pneumarm.transitions.rows import Recorded, broken_off
from pneumarm.transitions.watch import Watch, watched

MOVEMENT = "episode"
"""Kind of the sequence that a movement is."""
BROKEN = "broken episode"
"""Kind of one that broke off, with the arm or the link."""


@runtime_checkable
class LearningController(Controller, Protocol):
    """A controller that also learns from what its actions led to."""

    def observe(self, reading: Reading, applied: Command, reward: NDArray[np.float64], terminal: bool) -> None:
        """Learn from ``reading``, to which the valves as ``applied`` (joints, 2) led with ``reward`` (joints,).

        ``terminal`` says that the goal is reached; a movement that is merely cut off is not terminal.
        """


def move(
    cycle: ControlCycle,
    controller: Controller,
    goal: NDArray[np.float64],
    reward: Reward,
    cutoff: int = 100,
    watch: Watch | None = None,
    broken: Callable[[Recorded], None] | None = None,
    velocity: Literal["derived", "measured"] = "derived",
) -> Movement:
    """Move the arm, at rest with closed valves, until ``goal`` is reached or the movement is cut off.

    Args:
        cycle: the control cycle of the arm.
        controller: what acts; a :class:`LearningController` also learns.
        goal: shape (joints,) [counts].
        reward: what is paid for an action, and when the goal is reached.
        cutoff: actions after which a movement that has not reached its goal ends (thesis section 5.4.2: 100).
        watch: sees every reading, such as a :class:`~pneumarm.control.Monitor`.
        broken: given what there is of a movement that breaks off, of the kind :data:`BROKEN`, before that is raised.
        velocity: whether a goal is reached by the velocity derived from the angles, or by that of the arm's sensor.

    """

    def keep(steps: list[Step], why: BaseException) -> None:
        info = {"goal": count.goal.tolist()}
        recorded = broken_off(steps, cycle.arm.spec, why, kind=BROKEN, at_rest=True, info=info)
        if recorded is not None and broken is not None:
            broken(recorded)

    count = _Count(cycle, controller, np.asarray(goal, np.float64), reward, cutoff, velocity == "measured")
    controller.reset(count.goal)
    steps = watched(cycle.run(count.decide), watch, at_rest=True, broken=keep)
    recorded = Recorded.from_steps(steps, cycle.arm.spec, kind=MOVEMENT, at_rest=True)
    return Movement(count.goal, len(steps) - 1, count.switches, count.total, count.success, count.velocity, recorded)


def velocity_of(reading: Reading, before: Reading, *, measured: bool) -> NDArray[np.float64]:
    """Return the velocity (joints,) at ``reading``, as a sensor has measured it or since ``before`` [counts/ms]."""
    if not measured:
        return (reading.angle - before.angle) / (1e3 * (reading.time - before.time))
    if reading.velocity is None:
        raise ArmFailure("a reading must hold a velocity by which this agent's goals are reached, this has none")
    return reading.velocity


class _Count:
    """Decides turn by turn, counting actions, switches and reward alike in simulation and on the arm."""

    def __init__(
        self,
        cycle: ControlCycle,
        controller: Controller,
        goal: NDArray[np.float64],
        reward: Reward,
        cutoff: int,
        measures: bool,
    ) -> None:
        self.measures = measures
        self.cycle, self.controller, self.goal = cycle, controller, goal
        self.reward, self.cutoff = reward, cutoff
        self.learner = controller if isinstance(controller, LearningController) else None
        self.before: Reading | None = None
        self.actions = 0
        self.switches = np.zeros(goal.shape, np.int64)
        self.velocity = np.zeros(goal.shape)
        self.total = 0.0
        self.success = False
        self._last_applied: Command | None = None

    def decide(self, reading: Reading) -> Command | None:
        """Count what the last action led to; then return the valves of the next, or None at the end."""
        if self.before is not None:
            gained = self._count(self.before, reading)
            if self.learner is not None:
                self.learner.observe(reading, self.cycle.applied, gained, self.success)
            if self.success or self.actions == self.cutoff:
                return None
        self.before = reading
        self.actions += 1
        return self.controller.act(reading)

    def _count(self, before: Reading, reading: Reading) -> NDArray[np.float64]:
        """Return what each joint is paid for the action between two readings."""
        applied = self.cycle.applied
        switched = np.zeros(len(self.switches), bool)
        if self._last_applied is not None:
            switched = (applied != self._last_applied).any(axis=1)
        self._last_applied = applied
        self.switches += switched
        self.velocity = velocity_of(reading, before, measured=self.measures)
        self.success = self.reward.reached(reading.angle, self.velocity, self.goal)
        self.total += self.reward.goal if self.success else self.reward.action
        self.total += self.reward.switch * int(switched.sum())
        return self.reward.of(self.success, switched)
