"""Leaving in good order: whatever ends the program, arms are closed and files are whole.

A signal is raised as an exception in the main thread, so that everything leaves through the doors of ``with`` and
``finally``. Only ``kill -9`` and the end of the power do not: the dead-man of the microcontroller is for these.
"""

import atexit
import ctypes
import os
import signal
import sys
from threading import Timer, main_thread
from time import monotonic
from types import FrameType
from typing import Any

_HANG_UP = getattr(signal, "SIGHUP", None)  # Windows has none
SIGNALS = tuple(one for one in (signal.SIGINT, signal.SIGTERM, _HANG_UP) if one is not None)
_PATIENCE = 2.0
"""For so long [s] after a first signal others are ignored: whoever presses Ctrl-C twice means it once."""
_PARENT_GONE: Any = getattr(signal, "SIGUSR2", None)
_GONE = 1
"""The number of SIGHUP."""
_CALLBACKS = "_raw_object_cache_notify", "_raw_object_cache_getbuffer"
"""What LLVM calls while it compiles. An exception is printed there and forgotten, and there it would be raised, since
no other Python is executed while LLVM works."""
_AGAIN = 0.05
"""So much later [s] it is tried once more."""
_PR_SET_PDEATHSIG = 1  # from linux/prctl.h


class Interrupted(KeyboardInterrupt):
    """The program was asked to end by a signal, or lost its parent."""

    def __init__(self, number: int, reason: str) -> None:
        super().__init__(reason)
        self.exit_code = 128 + number
        """What a shell reports of a program that a signal ended: 130 for SIGINT, 143 for SIGTERM."""


def signals_as_exceptions() -> None:
    """Have signals, and on Linux the end of the parent process, raise :class:`Interrupted` in the main thread.

    A signal that is ignored stays so: ``nohup`` means what it says, also for the end of the parent.
    """
    first: float | None = None
    parent = os.getppid()

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal first
        gone = number == _PARENT_GONE
        if gone and os.getppid() == parent:
            return  # the kernel means the thread that started us; the process of which it was one goes on
        now = monotonic()
        if first is not None and now - first < _PATIENCE:
            return
        if _is_called_back(frame):
            again = Timer(_AGAIN, _raise_in_main_thread, (number,))
            again.daemon = True
            again.start()
            return
        if first is None:
            # While the interpreter ends it forgets its handlers, but not what it ignores.
            atexit.register(ignore)
        first = now
        if gone:
            raise Interrupted(_GONE, "the process that started it has ended")
        raise Interrupted(number, signal.Signals(number).name)

    def ignore() -> None:
        for number in wanted:
            signal.signal(number, signal.SIG_IGN)

    wanted = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    for number in wanted:
        signal.signal(number, interrupt)
    if sys.platform == "linux" and _HANG_UP in wanted:
        signal.signal(_PARENT_GONE, interrupt)
        try:
            ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, int(_PARENT_GONE))
        except (OSError, AttributeError):
            return  # a C library without it: the other ways remain
        if os.getppid() != parent:
            raise Interrupted(_GONE, "the process that started it has ended")


def _raise_in_main_thread(number: int) -> None:
    """Raise a signal where exceptions are raised, so that it also ends a wait there."""
    main = main_thread().ident
    if sys.platform == "win32" or main is None:
        signal.raise_signal(number)
    else:
        signal.pthread_kill(main, number)


def _is_called_back(frame: FrameType | None) -> bool:
    """Return whether LLVM waits for what is executed in ``frame``."""
    while frame is not None:
        if frame.f_code.co_name in _CALLBACKS:
            return True
        frame = frame.f_back
    return False
