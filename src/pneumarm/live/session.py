"""The arm's own loop: it moves the arm in real time, in one thread, and does what is ordered at the next turn.

Whoever orders does so from another thread. A stop is a flag, so that no queue can be in its way; it vents at the next
turn, a control period later at most. While the page that controls the arm is not heard, a moving arm first stops
where it is, and is then vented.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from threading import Event
from time import monotonic, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ControlCycle, guarded
from pneumarm.arm.cycle import Step
from pneumarm.arm.reference import Reference
from pneumarm.arm.seam import Reading
from pneumarm.arm.serial.arm import SerialArm
from pneumarm.arm.valves import Command
from pneumarm.arm.virtual import VirtualArm
from pneumarm.arm.wrapper import unwrapped
from pneumarm.control import Monitor
from pneumarm.control.monitor.findings import Finding
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.live.choices import Mover
from pneumarm.live.faults import Switches
from pneumarm.live.figures import PlayFigures
from pneumarm.live.hand import Dragged, curve_reference
from pneumarm.live.lease import HOLD_AFTER, VENT_AFTER
from pneumarm.live.orders import Faults, FollowCurve, GoTo, Hold, Order, Relax, Release, Stop
from pneumarm.live.screen import Screen
from pneumarm.live.words import prevented, sentence
from pneumarm.task.reference import counts_of
from pneumarm.transitions.watch import warm_up_watch

_MOST_ORDERS = 200  # that wait for the next turn; then the oldest is forgotten
_FINDINGS = 6  # newest, that are told
_TELL = 0.3  # s between two looks at how things stand
_NAP = 0.05  # s between two looks of a loop that stands still
_BLIND = ("dead-potentiometer", "frozen-potentiometer")  # findings after which nobody knows where a joint is
_LOST = "holding: the controlling page lost its connection"


class Mode(StrEnum):
    """What the arm is doing."""

    OPENING = "opening"
    """Nothing yet: what it needs is being compiled, if this machine has not done so before."""
    RELAXED = "relaxed"
    """Everything is vented until somebody gives a goal."""
    MOVING = "moving"
    """A controller goes to a goal and holds it."""
    FOLLOWING = "following"
    """A controller follows a curve."""
    HOLDING = "holding"
    """A curve has ended, and a controller holds its end."""
    STOPPED = "stopped"
    """Everything is vented until somebody releases that."""
    FAILED = "failed"
    """The arm or the controller failed, and somebody has to look."""


_ACTING = (Mode.MOVING, Mode.FOLLOWING, Mode.HOLDING)  # a controller moves the arm


class Session:
    """An arm that is moved for people until they leave.

    Args:
        arm: it takes its time by itself or is :class:`~pneumarm.live.pace.Paced`.
        mover: what moves it; None where there is nothing yet, so that it can only be looked at.
        watch: says what is wrong with the arm.
        screen: where everything is shown.
        silence: says for how long [s] nobody who controls the arm has been heard.

    """

    def __init__(
        self, arm: Arm, mover: Mover | None, watch: Monitor, screen: Screen, silence: Callable[[], float]
    ) -> None:
        self.arm = guarded(arm)
        self.mode = Mode.RELAXED
        self.figures = PlayFigures()
        self._mover, self._watch, self._screen, self._silence = mover, watch, screen, silence
        self._orders: deque[Order | Mover] = deque(maxlen=_MOST_ORDERS)
        self._stop, self._leave = Event(), Event()
        virtual = unwrapped(arm, VirtualArm)
        self._switches = None if virtual is None else Switches(virtual)
        self._vent = np.full(self.arm.applied.shape, -1, np.int8)
        self._middle = np.full(arm.spec.joints, sum(arm.spec.angle_range) / 2)
        self._dragged = Dragged(self._middle)
        self._curve: Reference | None = None
        self._begun: float | None = None  # when the curve did [s]
        self._now: NDArray[np.float64] = self._middle  # angles last read
        self._time, self._told = 0.0, -np.inf
        self._why = ""
        self._missed = 0  # turns

    # ---- from other threads

    def order(self, order: Order | Mover) -> None:
        """Have ``order`` done at the next turn; a mover is the controller to go on with."""
        if isinstance(order, Stop):
            self._stop.set()
        else:
            self._orders.append(order)

    def leave(self) -> None:
        """End the loop at the next turn, with everything vented."""
        self._leave.set()

    # ---- the loop

    def run(self) -> None:
        """Move the arm until somebody leaves; it is vented then. Failures are shown, and wait for a release."""
        self._screen.tell(mode=Mode.OPENING, why="")
        warm_up_watch(self._watch, self.arm.spec)  # here and not before, so that the page can be looked at meanwhile
        try:
            while not self._leave.is_set():
                try:
                    self._move()
                except (PneumarmError, OSError) as error:
                    if not self._only_vented(str(error)):
                        self._fail(str(error))
                        self._wait_for_release()
        finally:
            self._tell()
            with suppress(PneumarmError, OSError):  # who is not heard is vented by the board
                self.arm.set_valves(self._vent)

    def _move(self) -> None:
        self.arm.make_ready()
        cycle = ControlCycle(self.arm)
        self._watch.begin(at_rest=False)
        before = self._missed
        for step in cycle.run(self._decide):
            self._watch.see(step.reading, step.valves)
            self._missed = before + cycle.missed_deadlines
            self._show(step)

    def _decide(self, reading: Reading) -> Command | None:
        self._time, self._now = reading.time, reading.angle
        while self._orders:
            try:
                self._do(self._orders.popleft())
            except PneumarmError as error:
                self._screen.tell(notice=str(error))
        if self._stop.is_set():
            self._stop.clear()
            self._vent_all(Mode.STOPPED, "stopped by hand: everything is vented until somebody releases it")
        self._mind_silence()
        self._mind_sensors()
        if self._leave.is_set():
            return None
        if self._mover is None or self.mode not in _ACTING:
            return self._vent
        self._begun = reading.time if self._begun is None else self._begun
        self._end_curve(reading.time)
        self._see_error(reading)
        return self._mover.controller.act(reading)

    def _see_error(self, reading: Reading) -> None:
        wanted = self._wanted(reading.time)
        if wanted is not None and self._mover is not None:
            error = (reading.angle - wanted) / self.arm.spec.counts_per_degree
            self.figures.see(self._mover.choice.name, reading.time, error)

    def _wanted(self, time: float) -> NDArray[np.float64] | None:
        """Return the angles (joints,) [counts] wanted at ``time`` [s]; None while nothing is."""
        if self.mode is Mode.MOVING:
            return self._dragged.goal
        if self.mode not in (Mode.FOLLOWING, Mode.HOLDING) or self._curve is None or self._begun is None:
            return None
        return self._curve.at(time - self._begun)

    def _end_curve(self, time: float) -> None:
        """Hold the end of a curve that is over at ``time`` [s]."""
        if self.mode is not Mode.FOLLOWING or self._curve is None or self._begun is None or self._mover is None:
            return
        if self._curve.duration is not None and time - self._begun > self._curve.duration:
            self.mode = Mode.HOLDING
            self.figures.end_curve(self._mover.choice.name)

    def _mind_silence(self) -> None:
        """Stop a moving arm where it is when nobody who controls it is heard, then vent it."""
        silence = self._silence()
        if silence < HOLD_AFTER or self.mode not in _ACTING:
            return
        if silence >= VENT_AFTER:
            self._vent_all(Mode.RELAXED, "vented: the page that controlled the arm is gone")
        elif self._why != _LOST:
            self._go(self._now)
            self._why = _LOST

    @property
    def _blind(self) -> list[int]:
        """Joints, from 1, whose angle is not known, because its sensor is dead or frozen."""
        return sorted({one.joint for one in self._watch.now if one.kind in _BLIND and one.joint is not None})

    def _mind_sensors(self) -> None:
        """Stop a moving arm that nobody knows the angle of."""
        if self.mode in _ACTING and (blind := self._blind):
            joints = " and ".join(map(str, blind))
            self._vent_all(Mode.STOPPED, f"stopped: where joint {joints} is, nobody knows; see to its angle sensor")

    # ---- orders

    def _do(self, order: Order | Mover) -> None:
        if isinstance(order, Mover):
            self._change(order)
        elif isinstance(order, Faults):
            self._switch(order)
        elif isinstance(order, Relax):
            if self.mode is not Mode.STOPPED:
                self._vent_all(Mode.RELAXED, "")
        elif isinstance(order, Release):
            if self.mode is Mode.STOPPED:
                self._vent_all(Mode.RELAXED, "")
        elif self.mode is Mode.STOPPED:
            raise UnusableInput("the arm is stopped; release it first")
        elif self._mover is None:
            raise UnusableInput("nothing can move the arm yet; let it learn first")
        elif isinstance(order, GoTo):
            self._go(counts_of(order.degrees, self.arm.spec))
        elif isinstance(order, Hold):
            self._go(self._now)
        elif isinstance(order, FollowCurve):
            self._follow(order, self._mover)

    def _go(self, goal: NDArray[np.float64]) -> None:
        """Go to ``goal`` (joints,) [counts], as far as the controller knows goals there, and hold it."""
        if self._mover is None:
            return
        goal = self._within(goal, self._mover)
        self._why = ""
        if self.mode is not Mode.MOVING:
            self.mode = Mode.MOVING
            self._dragged = Dragged(goal)
            self._begin(self._dragged.reference)
        self._dragged.goal = goal
        self.figures.new_goal(self._time, (self._now - goal) / self.arm.spec.counts_per_degree)

    def _follow(self, order: FollowCurve, mover: Mover) -> None:
        angles = self._within(counts_of(order.degrees, self.arm.spec), mover)
        self._curve = curve_reference(order.seconds, angles, self._now)
        self.mode, self._why = Mode.FOLLOWING, ""
        self.figures.new_curve()
        self._begin(self._curve)

    def _begin(self, reference: Reference) -> None:
        """Have the controller follow ``reference`` from wherever the arm is."""
        assert self._mover is not None
        self._begun = None
        self._mover.controller.reset(self._within(self._now, self._mover))
        self._mover.controller.track(reference)

    def _within(self, angle: NDArray[np.float64], mover: Mover) -> NDArray[np.float64]:
        return np.clip(angle, mover.goal_range[:, 0], mover.goal_range[:, 1])

    def _change(self, mover: Mover) -> None:
        self._mover = mover
        self.figures.forget()
        if self.mode in _ACTING:
            self.mode = Mode.RELAXED  # so that the new one begins afresh
            self._go(self._now)

    def _switch(self, order: Faults) -> None:
        if self._switches is None:
            raise UnusableInput("only a virtual arm has faults that can be switched on")
        self._switches.switch(order.kind, order.joint, order.muscle, order.on)

    def _vent_all(self, mode: Mode, why: str) -> None:
        self.mode, self._why = mode, why
        self.figures.forget()

    # ---- failing

    def _fail(self, why: str) -> None:
        self._vent_all(Mode.FAILED, why)
        with suppress(PneumarmError, OSError):
            self.arm.set_valves(self._vent)
        self._tell()

    def _only_vented(self, why: str) -> bool:
        """Take up an arm again that its board has vented because this computer was too slow to be heard.

        Who has stopped it meant that it stays so.
        """
        board = unwrapped(self.arm, SerialArm)
        if board is None:
            return False
        try:
            board.make_ready()
        except (PneumarmError, OSError):
            return False
        if self.mode is not Mode.STOPPED:
            self._vent_all(Mode.RELAXED, why)
        return True

    def _wait_for_release(self) -> None:
        while self.mode is Mode.FAILED and not self._leave.is_set():
            while self._orders:
                if isinstance(self._orders.popleft(), Release):
                    self._try_again()
            sleep(_NAP)
        self._stop.clear()

    def _try_again(self) -> None:
        """Take up the arm again: somebody has looked at it."""
        board = unwrapped(self.arm, SerialArm)
        try:
            if board is not None:
                board.rearm()
            self._vent_all(Mode.RELAXED, "")
        except (PneumarmError, OSError) as error:
            self._fail(str(error))

    # ---- what is shown

    def _show(self, step: Step) -> None:
        self._screen.show(self.arm.spec, step.reading, self._wanted(step.reading.time), step.valves)
        self._screen.tell(mode=self.mode, why=self._why)
        if monotonic() - self._told >= _TELL:
            self._tell()

    def _tell(self) -> None:
        self._told = monotonic()
        air, wrong = self.arm.air_used(), self._watch.now
        self._screen.tell(
            mode=self.mode,
            why=self._why,
            controller=None if self._mover is None else self._mover.choice.name,
            figures={name: goals.results() for name, goals in self.figures.by_controller.items()},
            wrong=[self._told_of(one) for one in wrong],
            was_wrong=[self._told_of(one) for one in self._watch.findings[-_FINDINGS:] if one.until is not None],
            familiar=self._watch.familiar,
            guard=prevented(self.arm.interventions),
            missed=self._missed,
            blind=self._blind,
            air=None if air is None else round(air, 2),
            faults=None if self._switches is None else self._switches.on,
        )

    def _told_of(self, found: Finding) -> list[Any]:
        """Return what was found, in words, when it was noticed and when it was over [s]."""
        return [sentence(found, self.arm.spec), found.noticed, found.until]
