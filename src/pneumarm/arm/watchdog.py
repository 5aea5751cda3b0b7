"""The watchdog of decisions: it sees to the arm while a controller does not come back with one."""

import ctypes
import math
import signal
import sys
import weakref
from collections.abc import Callable
from contextlib import suppress
from threading import Lock, Thread, get_ident, main_thread
from time import monotonic, sleep
from typing import Protocol

from pneumarm.arm.seam import ArmSpec, Reading
from pneumarm.errors import ControllerFailure

PATIENCE = 60.0
"""After so long [s] without a decision a controller is stopped, even where an arm's clock stands still meanwhile."""
_AGAIN = 3.0
"""A controller that goes on when it is interrupted is interrupted again after this [s]."""
_ARRIVING = 1.0
"""An interruption that was sent arrives within this [s]."""
_SELDOM = 1.0
"""An arm that has not to be seen to is looked at this often [s]."""


class WatchedArm(Protocol):
    """The arm of a watchdog: a :class:`~pneumarm.arm.guard.GuardedArm`."""

    spec: ArmSpec

    def get_state(self) -> bytes | None:
        """Return the state of the arm, None where it has none and time passes while we compute."""

    def stand_in(self, reading: Reading) -> bool:
        """Do what is safe while there is no decision on ``reading`` yet; return whether that is needed."""

    def give_up(self, patience: float) -> ControllerFailure:
        """Vent everything and return the error for a controller that had not decided for ``patience`` [s]."""


class Watchdog:
    """Looks after one decision at a time, from a thread of its own.

    A decision is out from :meth:`begin` to :meth:`end`. Once it is out for longer than a control period, the arm is
    seen to every period by :meth:`WatchedArm.stand_in`; one that is out for too long is interrupted where it is. A
    decision in time costs what two assignments under a lock cost: nothing is told to the thread, which looks once a
    period by itself and ends when there is nothing to look at.

    Python is needed for that: a controller inside compiled code that does not let other threads run stops the
    watchdog too, and is left to the dead-man of the arm's own controller.
    """

    def __init__(self, arm: WatchedArm) -> None:
        self._arm = arm
        self._lock = Lock()  # held while the arm is seen to, so that the decider has to wait with moving it
        self._thread: Thread | None = None
        self._reading: Reading | None = None  # after which a decision is out; None while none is
        self._since = 0.0  # when it was asked for [s]
        self._seen = -1.0  # what that was at the last look
        self._patience = PATIENCE
        self._decider = 0
        self._stands_still: bool | None = None  # the arm's clock while we compute; None while that is not known
        self._needed = True  # whether the arm has to be seen to
        self._interrupted: float | None = None  # when the decider was [s]
        self._failure: Exception | None = None  # of the arm, while it was seen to

    def __reduce__(self) -> tuple[type["Watchdog"], tuple[WatchedArm]]:
        """Give the copy of an arm a watchdog of its own: no decision of its controller is out yet."""
        return Watchdog, (self._arm,)

    def begin(self, reading: Reading, patience: float = PATIENCE) -> None:
        """Look after the decision on ``reading``; the calling thread is interrupted after ``patience`` [s]."""
        with self._lock:
            self._since, self._patience, self._decider = monotonic(), patience, get_ident()
            self._needed, self._interrupted, self._failure = not self._stands_still, None, None
            self._reading = reading
            if self._thread is None:
                self._seen = -1.0
                self._thread = Thread(target=_look, args=(weakref.ref(self),), name="pneumarm watchdog", daemon=True)
                self._thread.start()

    def end(self) -> None:
        """Stop looking after the decision: it has come, or will never.

        Raises:
            ControllerFailure: the controller was stopped because it had not decided for too long; all is vented.
            Exception: what the arm raised while it was seen to, unless another error is on its way already.

        """
        leaving = sys.exc_info()[1]
        arrived = isinstance(leaving, KeyboardInterrupt)
        try:
            self._end()
        except KeyboardInterrupt:
            self._end()
            if self._interrupted is None:
                raise
            arrived = True
        if self._interrupted is not None:
            with suppress(KeyboardInterrupt):
                sleep(0.0 if arrived else _ARRIVING)  # here it harms nothing
            raise self._arm.give_up(self._patience)
        if self._failure is not None and leaving is None:
            failure, self._failure = self._failure, None
            raise failure

    def _end(self) -> None:
        with self._lock:
            self._reading = None

    def look(self) -> float | None:
        """Look once; return how long [s] there is nothing more to see, None where there is nothing to look at."""
        with self._lock:
            seen, self._seen = self._seen, self._since
            if self._reading is not None:
                return self._attend(self._reading)
            if self._since == seen:  # no decision was asked for since the last look
                self._thread = None
                return None
            return self._arm.spec.period

    def _attend(self, reading: Reading) -> float:
        """Do what the decision on ``reading`` needs by now; return for how long [s] it needs nothing more."""
        period, now = self._arm.spec.period, monotonic()
        out = now - self._since
        if out < min(period, self._patience):
            return min(period, self._patience) - out
        if out >= self._patience and now - (self._interrupted or -math.inf) >= _AGAIN:
            self._interrupted = now
            _interrupt(self._decider)
        if self._needed:
            try:
                if self._stands_still is None:
                    self._stands_still = self._arm.get_state() is not None
                self._needed = not self._stands_still and self._arm.stand_in(reading)
            except Exception as error:  # told when the decision comes: the arm may not say it twice
                self._needed, self._failure = False, error
        nap = period if self._needed else _SELDOM
        return min(nap, self._patience - out) if out < self._patience else nap


def _look(watchdog: "weakref.ref[Watchdog]") -> None:
    """Look while there is something to look at and somebody holds the arm: no dead-man is fed for nobody."""
    while (dog := watchdog()) is not None and (nap := dog.look()) is not None:
        del dog
        sleep(nap)


def _interrupt(thread: int) -> None:
    """Raise KeyboardInterrupt in ``thread``."""
    handler: Callable[..., object] | int | None = signal.getsignal(signal.SIGINT)
    if thread == main_thread().ident and callable(handler) and hasattr(signal, "pthread_kill"):
        signal.pthread_kill(thread, signal.SIGINT)  # ends waits and sleeps too
    else:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(KeyboardInterrupt))
