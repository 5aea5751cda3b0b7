"""The control cycle of thesis section 2.4.3 on any arm, and bringing the arm to rest at a random begin state."""

from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass, field
from time import monotonic
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm.guard import GuardedArm
from pneumarm.arm.seam import Reading
from pneumarm.arm.valves import Command
from pneumarm.arm.watchdog import PATIENCE
from pneumarm.errors import PneumarmError
from pneumarm.settings import Settings

Decide = Callable[[Reading], Command | None]


class Step(NamedTuple):
    """One turn of the cycle: what was read and the command as applied, None where the decision was to stop."""

    reading: Reading
    valves: Command | None


@dataclass
class ControlCycle:
    """Read, decide, let the latency pass, set the valves, wait for the period to end; over and over.

    Turns are due on a grid of control periods from the first reading on. One that comes late does not move it: the
    next is due when it would have been, or, after a turn more than half a period late, at the first point of the grid
    more than half a period away. So no two turns are nearer to each other than that, and the rate is kept.

    The valves stay as they are between reading and acting, or are closed then (thesis figure 2.8). A decision that
    cannot be used, that raises, or that took longer than a period on the arm's clock is replaced by the guard; while
    one does not come at all, the guard stands in for it.
    """

    arm: GuardedArm
    close_while_computing: bool = False
    patience: float = PATIENCE
    """Time [s] after which a controller that does not decide is stopped."""
    missed_deadlines: int = field(default=0, init=False)
    """Points of the grid that passed without a turn within half a period."""
    applied: Command = field(init=False)
    """The command of the last turn as applied, shape (joints, 2); what they led to is read in the next turn."""
    due: float = field(default=0.0, init=False)
    """When the turn after the last reading is to end on the arm's clock [s]."""
    _reading: Reading = field(init=False)
    _asked: float = field(default=0.0, init=False)  # when the last decision was asked for [s]

    def __post_init__(self) -> None:
        self.applied = np.zeros_like(self.arm.applied)

    def run(self, decide: Decide) -> Generator[Step, None, None]:
        """Yield the turns until ``decide`` returns None; that last turn's valves are None, and all are closed.

        The valves are closed on every way out.

        Raises:
            PneumarmError: whatever ``decide`` raises on purpose.
            ControllerFailure: too many decisions in a row had to be replaced, or one did not come at all.

        """
        arm = self.arm
        closed = np.zeros(arm.applied.shape, np.int8)
        try:
            reading = self.start()
            while True:
                if self.close_while_computing:
                    arm.set_valves(closed)
                raised = None
                try:
                    self.ask(self.patience)
                    command = decide(reading)
                except PneumarmError:
                    raise
                except Exception as error:
                    command, raised = arm.applied, error
                finally:
                    arm.watchdog.end()
                if command is None:
                    yield Step(reading, None)
                    break
                self.act(command, raised)
                yield Step(reading, arm.applied)
                reading = self.finish()
        except Exception:
            with suppress(PneumarmError, OSError):  # the first failure is the one to tell of
                arm.set_valves(closed)
            raise
        except BaseException:
            arm.set_valves(closed)
            raise
        else:
            arm.set_valves(closed)

    def start(self) -> Reading:
        """Return a reading, from which on turns are due."""
        self._reading = reading = self.arm.read()
        self.due = reading.time + self.arm.spec.period
        return reading

    def ask(self, patience: float) -> None:
        """Have the arm looked after from now on until a decision is there, for up to ``patience`` [s]."""
        self._asked = monotonic()
        self.arm.watchdog.begin(self._reading, patience)

    def act(self, command: Command, raised: Exception | None = None) -> None:
        """Let the latency pass and set the valves by ``command`` (joints, 2), or as is safe where one came too late.

        ``raised`` is what a controller raised that has given none.
        """
        arm, spec = self.arm, self.arm.spec
        late = arm.lateness(self._reading) if monotonic() - self._asked > spec.period else 0.0
        if spec.latency:
            arm.wait(spec.latency)
        if raised is not None:
            arm.replace("raised", f"{type(raised).__name__}: {raised}", max(late, 1.0), raised)
        elif late > 1:
            arm.replace("late", f"{late:.1f} periods after its reading", late)
        else:
            arm.decide(command)
        self.applied = arm.applied
        arm.end_pulses(self.due)  # before anybody is given the turn, who may take his time

    def finish(self) -> Reading:
        """Let the rest of the turn pass and return the reading after it."""
        self.arm.wait_until(self.due)
        self._reading = reading = self.arm.read()
        missed = missed_turns(reading.time - self.due, self.arm.spec.period)
        self.missed_deadlines += missed
        self.due += (missed + 1) * self.arm.spec.period
        return reading


def missed_turns(late: float, period: float) -> int:
    """Return how many turns of the grid a turn has missed that is ``late`` [s]; the next is due after these.

    The compiled loop of :mod:`pneumarm.control.playing` is made of it too, by :func:`pneumarm.kernels.part`.
    """
    return max(round(late / period), 0)


@dataclass(frozen=True)
class BeginState(Settings):
    """How the arm is brought to a random begin state at rest (thesis sections 3.2.2 and 5.5)."""

    deflate: Annotated[float, Meta(ge=0, le=600)] = 2.0
    """Time that all muscles are vented [s] (thesis section 5.5: two seconds)."""
    inflate: Annotated[float, Meta(ge=0, le=600)] = 1.5
    """Longest time that a muscle is inflated again [s] (1.2 while collecting, 1.5 between episodes)."""
    settle: Annotated[float, Meta(ge=0, le=600)] = 1.0
    """Time in which the oscillations damp out, all valves closed [s]."""

    def reach(self, arm: GuardedArm, random: np.random.Generator) -> None:
        """Vent, inflate every muscle for a time uniform in 0..``inflate``, and wait."""
        self.inflated(arm, random.uniform(0.0, self.inflate, arm.applied.shape))

    def inflated(self, arm: GuardedArm, duration: NDArray[np.float64]) -> None:
        """Vent, inflate every muscle for its ``duration`` (joints, 2) [s], and wait."""
        valves = np.full(arm.applied.shape, -1, np.int8)
        arm.make_ready()
        arm.read()
        arm.set_valves(valves)
        arm.wait(self.deflate)
        passed = 0.0
        for end in [0.0, *np.sort(duration, axis=None)]:
            if end > passed:
                arm.wait(end - passed)
                passed = end
            arm.read()
            arm.set_valves(np.where(duration > passed, 1, 0))
        arm.wait(self.settle)
