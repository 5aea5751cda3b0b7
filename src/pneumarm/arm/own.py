"""An arm of a user's own, whose calls are checked: what its code raises or returns, and what its clock does.

What goes wrong in it is a failure of that arm, told with the place in its code, and its valves are closed first.
"""

import traceback
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any

import numpy as np

from pneumarm.arm.seam import Arm, ArmSpec, Reading, checked
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput

STILL = 0.25
"""A clock that has not advanced in waits of so long together [s] stands still; a board's dead-man is as patient."""
FEWEST_WAITS = 3
"""... but not after fewer waits: a slow sensor gives the same time twice."""
LEAP = 1.0
"""A clock may advance by so much [s] more than twice what passed: reading and setting valves may take their time."""
_LONGEST = 400  # letters that are told of an error of theirs


class _Clock:
    """Compares what a clock shows with what was waited; one that goes back is noticed by the guard."""

    def __init__(self) -> None:
        self._last: float | None = None  # time of the last reading [s]
        self._read_at = 0.0  # when that was by the computer's clock [s]
        self.since = 0.0  # what was waited since then [s]
        self._from = 0.0  # the last time that had advanced as it should [s]
        self._waited, self._waits = 0.0, 0  # since then [s]

    def left(self, time: float) -> float:
        """Return how long it is until ``time`` [s]; 0 before the first reading."""
        return 0.0 if self._last is None else max(time - self._last - self.since, 0.0)

    def wait(self, seconds: float) -> None:
        """Note that ``seconds`` [s] were waited."""
        self.since += seconds
        self._waited += seconds
        self._waits += seconds > 0

    def wrong(self, time: float, real_time: bool) -> str | None:
        """Take a reading's ``time`` [s]; return what is wrong with it, None where nothing is."""
        now, last, since = monotonic(), self._last, self.since
        passed = now - self._read_at + (0.0 if real_time else since)
        self._last, self._read_at, self.since = time, now, 0.0
        advanced = time - self._from
        if last is not None and time - last > 2 * passed + LEAP:
            return f"leapt ahead by {time - last:.6g} s while {passed:.3g} s passed"
        if last is None or not 0 <= advanced < self._waited / 2:
            self._from, self._waited, self._waits = time, 0.0, 0
        elif self._waits >= FEWEST_WAITS and self._waited >= STILL:
            return f"stands still: it advanced by {advanced:.3g} s in {self._waits} waits of {self._waited:.3g} s"
        return None


def _checked(method: str, check: Callable[[Any], Any] | None = None) -> Callable[..., Any]:
    """Return a method of :class:`OwnArm` that calls that of the arm."""
    return lambda self, *values: self._call(method, *values, check=check)


class OwnArm(ArmWrapper):
    """``arm``, with its calls and its clock checked; see :func:`owned`.

    Whatever a method raises, except on purpose (PneumarmError) or by Ctrl-C, is an ArmFailure that says where, and so
    is what it returns that nobody can use. A clock fails that leaps ahead, or that advances by less than half of what
    was waited over some waits. Where the arm runs in real time, waits are measured by the computer's clock too.
    """

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm)
        while isinstance(arm, ArmWrapper) and _is_ours(arm):
            arm = arm.arm
        self._kind, self._clock = type(arm), _Clock()
        self._named = f"{self._kind.__module__}.{self._kind.__qualname__}"

    def read(self) -> Reading:
        """Return what the sensors say."""
        reading: Reading = self._call("read", check=lambda given: checked(given, self.spec) and given)
        wrong = self._clock.wrong(float(reading.time), self.real_time)
        if wrong is not None:
            raise self._clock_failed(wrong)
        return reading

    set_valves, close = _checked("set_valves"), _checked("close")
    make_ready, regain, set_state = _checked("make_ready"), _checked("regain"), _checked("set_state")
    set_pulses, link_counts = _checked("set_pulses", bool), _checked("link_counts", dict)
    air_used = _checked("air_used", lambda given: None if given is None or not np.isfinite(given) else float(given))
    get_state = _checked("get_state", lambda given: None if given is None else memoryview(given).tobytes())

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        self._wait("wait", seconds, seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s]."""
        self._wait("wait_until", time, self._clock.left(time))

    def _wait(self, method: str, value: float, seconds: float) -> None:
        begun = monotonic()
        self._call(method, value)
        took = monotonic() - begun
        self._clock.wait(seconds)
        if self.real_time and took > 2 * seconds + LEAP:
            raise self._clock_failed(f"is not the computer's: a wait of {seconds:.3g} s took {took:.3g} s")

    def _call(self, method: str, *values: object, check: Callable[[Any], Any] | None = None) -> Any:
        """Return what ``method`` of the arm returns, as ``check`` makes it."""
        returned = False
        if method in ("make_ready", "regain", "set_state"):
            self._clock = _Clock()  # any time may pass in it
        try:
            given = getattr(self.arm, method)(*values)
            returned = True
            return given if check is None else check(given)
        except (KeyboardInterrupt, UnusableInput):
            raise
        except BaseException as error:  # SystemExit too: no arm ends the program
            self._close_valves()
            told = " ".join("".join(traceback.format_exception_only(error)).split())
            if isinstance(error, PneumarmError):
                if not returned:
                    raise
                told = str(error).removeprefix(f"{self.spec.name}: ")
            code = getattr(getattr(self._kind, method, None), "__code__", None)
            begins = f"{code.co_filename}:{code.co_firstlineno}" if code is not None else "no line of it"
            raise ArmFailure(
                f"{self.spec.name}: {self._named}.{method} {'returned nothing usable' if returned else 'failed'}: "
                f"{told[:_LONGEST]} ({last_line(error, self._kind.__module__) or begins}); correct its code or check "
                "its hardware, and run the same command again"
            ) from error

    def _clock_failed(self, what: str) -> ArmFailure:
        self._close_valves()
        self._clock = _Clock()
        return ArmFailure(
            f"{self.spec.name}: its clock {what}; the time of a reading must be in seconds of a clock that only "
            f"advances, as long as {self._named}.wait waits"
        )

    def _close_valves(self) -> None:
        """Close all valves, if that still works: the first failure is the one to tell of."""
        with suppress(Exception, SystemExit):
            self.arm.set_valves(np.zeros((self.spec.joints, 2), np.int8))


def owned(arm: Arm) -> Arm:
    """Return ``arm``, behind an :class:`OwnArm` where any of its code is not pneumarm's.

    Raises:
        UnusableInput: it has no spec; it is closed then.

    """
    spec: object = None
    with suppress(Exception):
        spec = arm.spec
    if not isinstance(spec, ArmSpec):
        with suppress(Exception, SystemExit):
            arm.close()
        raise UnusableInput(
            f"{type(arm).__module__}.{type(arm).__qualname__}: expected a pneumarm.arm.ArmSpec as its spec, got "
            f"{type(spec).__name__}; set self.spec where the arm is made"
        )
    inner = arm
    while _is_ours(inner) and isinstance(inner, ArmWrapper) and not isinstance(inner, OwnArm):
        inner = inner.arm
    return arm if _is_ours(inner) else OwnArm(arm)


def _is_ours(arm: Arm) -> bool:
    return type(arm).__module__.startswith("pneumarm.")


def last_line(error: BaseException, module: str) -> str | None:
    """Return the last line of ``module`` in the traceback of ``error``, else the first that is not pneumarm's."""
    found = None
    for frame, line in traceback.walk_tb(error.__traceback__):
        name = str(frame.f_globals.get("__name__"))
        if name == module or (found is None and not name.startswith("pneumarm.")):
            found = f"{frame.f_code.co_filename}:{line}, in {frame.f_code.co_name}"
    return found
