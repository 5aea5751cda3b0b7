"""Movements on an arm: from where it stands to a goal, counted as the thesis counts an episode (5.1, 5.2)."""

from collections.abc import Callable, Iterable, Iterator
from typing import Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm import Arm, BeginState, ControlCycle, Controller, Reading, Step, guarded
from pneumarm.arm.controller import TrackingController
from pneumarm.arm.reference import Reference, constant
from pneumarm.arm.valves import Command
from pneumarm.arm.velocity import derived_velocity
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.task import Movement, Movements, TaskSettings
from pneumarm.task.movements import of_rows
from pneumarm.task.tally import Tally
from pneumarm.transitions.goals import Goals
from pneumarm.transitions.rows import Recorded, broken_off
from pneumarm.transitions.watch import Watch, act_until

MOVEMENT = "episode"
"""Kind of the sequence that a movement is."""
BROKEN = "broken episode"
"""Kind of one that broke off, with the arm or the link."""
BEGIN = BeginState()
"""How the arm gets to a begin state between movements (thesis section 5.5)."""


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
    goal: ArrayLike | Reference,
    task: TaskSettings = TaskSettings(),
    watch: Watch | None = None,
    broken: Callable[[Recorded], None] | None = None,
    velocity: Literal["derived", "measured"] = "derived",
    hold: float = 0.0,
) -> Movement:
    """Move the arm, at rest with closed valves, until ``goal`` is reached or the movement is cut off.

    Args:
        cycle: the control cycle of the arm.
        controller: what acts; a :class:`LearningController` also learns.
        goal: shape (joints,) [counts]; or one that moves, for a :class:`~pneumarm.arm.controller.TrackingController`.
        task: what is paid for an action, when the goal is reached, and when the movement is cut off.
        watch: sees every reading, such as a :class:`~pneumarm.control.Monitor`.
        broken: given what there is of a movement that breaks off, of the kind :data:`BROKEN`, before that is raised.
        velocity: whether a goal is reached by the velocity derived from the angles, or by that of the arm's sensor.
        hold: for how long the controller goes on, from when the goal was given [s]. What it does after the end of
            the movement is recorded and not counted.

    """

    def keep(steps: list[Step], why: BaseException) -> None:
        info = {"goal": attempt.goal.tolist()}
        recorded = broken_off(steps, cycle.arm.spec, why, kind=BROKEN, at_rest=True, info=info)
        if recorded is not None and broken is not None:
            broken(recorded)

    attempt = _Attempt(cycle, controller, goal, task, velocity == "measured", hold)
    recorded = act_until(cycle, controller, attempt.is_over, kind=MOVEMENT, at_rest=True, watch=watch, broken=keep)
    made = attempt.tally
    return Movement(
        attempt.goal, made.actions, made.switches, made.reward, made.reached, attempt.velocity, recorded, made.actions
    )


class _Attempt:
    """Counts turn by turn what comes of a movement, and has a controller learn from it."""

    def __init__(
        self,
        cycle: ControlCycle,
        controller: Controller,
        goal: ArrayLike | Reference,
        task: TaskSettings,
        measures: bool,
        hold: float,
    ) -> None:
        self.cycle, self.measures, self.hold = cycle, measures, hold
        self.learner = controller if isinstance(controller, LearningController) else None
        self.reference = goal if isinstance(goal, Reference) else constant(goal)
        self.goal = self.reference.at(0.0)
        self.velocity = np.zeros(self.goal.shape)
        self.tally = Tally(task, cycle.arm.spec)
        self.began = 0.0
        self.before: Reading | None = None
        if not isinstance(goal, Reference):
            controller.reset(self.goal)
        elif isinstance(controller, TrackingController):
            controller.track(goal)
        else:
            raise UnusableInput("a goal that moves needs a controller that follows references, with a method track")

    def is_over(self, reading: Reading) -> bool:
        """Count what the last action led to; return whether it was the last one."""
        if self.before is None:
            self.began = reading.time
        elif not self.tally.over:
            gained = self._count(self.before, reading)
            if self.learner is not None:
                self.learner.observe(reading, self.cycle.applied, gained, self.tally.reached)
        self.before = reading
        return self.tally.over and reading.time - self.began > self.hold - self.cycle.arm.spec.period / 2

    def _count(self, before: Reading, reading: Reading) -> NDArray[np.float64]:
        """Return what each joint is paid for the action between two readings."""
        if self.measures and reading.velocity is None:
            raise ArmFailure("a reading must hold a velocity by which this agent's goals are reached, this has none")
        self.goal = self.reference.at(reading.time - self.began)
        if self.measures and reading.velocity is not None:
            self.velocity = reading.velocity
        else:
            self.velocity = derived_velocity(reading.angle, before.angle, reading.time - before.time)
        return self.tally.count(self.cycle.applied, reading.angle, self.velocity, self.goal)


class Draw(NamedTuple):
    """A movement to be made."""

    goal: NDArray[np.float64]
    """Shape (joints,) [counts]."""
    random: np.random.Generator
    """Of the way to its begin state, and whatever else is drawn on the way."""


def draw_movement(goals: Goals | NDArray[np.float64], seed: int, test: bool, number: int) -> Draw:
    """Return movement ``number``, its goal one of ``goals``, or within a range of them (joints, 2) [counts].

    The movements of a ``test`` are others than those while learning. Both tests of a transfer use the same begin
    states and goals, and so does every baseline with the same seed.
    """
    random = np.random.default_rng([seed, 0 if test else 1, number])
    return Draw(Goals.of(goals).draw(random, 1)[0], random)


def drawn(
    goals: Goals | NDArray[np.float64], seed: int, numbers: Iterable[int], *, test: bool = True
) -> Iterator[Draw]:
    """Yield the movements of these ``numbers``, see :func:`draw_movement`."""
    return (draw_movement(goals, seed, test, number) for number in numbers)


def make_movements(
    arm: Arm | ControlCycle,
    controller: Controller,
    task: TaskSettings,
    draws: Iterable[Draw],
    *,
    watch: Watch | None = None,
    velocity: Literal["derived", "measured"] = "derived",
) -> Iterator[Movement]:
    """Make the movements ``draws`` on ``arm``, any of them, and yield each; the arguments are those of :func:`move`.

    Before each the arm is brought to a random begin state.
    """
    cycle = arm if isinstance(arm, ControlCycle) else ControlCycle(guarded(arm))
    for draw in draws:
        BEGIN.reach(cycle.arm, draw.random)
        yield move(cycle, controller, draw.goal, task, watch, velocity=velocity)


def evaluate(
    arm: Arm | ControlCycle,
    controller: Controller,
    task: TaskSettings,
    draws: Iterable[Draw],
    *,
    watch: Watch | None = None,
    velocity: Literal["derived", "measured"] = "derived",
) -> Movements:
    """Return the record of the movements ``draws`` of ``controller`` on ``arm``, see :func:`make_movements`."""
    cycle = arm if isinstance(arm, ControlCycle) else ControlCycle(guarded(arm))
    made = make_movements(cycle, controller, task, draws, watch=watch, velocity=velocity)
    return of_rows((one.row() for one in made), cycle.arm.spec.joints)
