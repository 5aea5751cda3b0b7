"""An arm of a user's own, whose calls are checked: what its code raises, and what its clock does.

What goes wrong in it is a failure of that arm, with the place in its code, and never taken for an error of pneumarm.
Its valves are closed first.
"""

import math
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from time import monotonic
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.passed_on import PassedOn
from pneumarm.arm.seam import Arm, ArmSpec, Reading, checked
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput

STILL = 0.25
"""A clock that has not advanced in waits of so long together [s] stands still; a board's dead-man is as patient."""
FEWEST_WAITS = 3
"""... but not after fewer waits: a slow sensor gives the same time twice."""
LEAP = 1.0
"""By so much [s] more than twice what passed a clock may advance: reading and setting valves may take their time."""
_LONGEST = 400  # letters of an error of theirs: it is told in a line


class OwnArm(PassedOn):
    """``arm``, with its calls and its clock checked; see :func:`owned`.

    A clock may be late or early, and may give a time again. It fails when it advances by less than half of what was
    waited, over :data:`FEWEST_WAITS` waits of :data:`STILL` together, and when it leaps ahead. One that goes back is
    noticed by the guard. Waits are compared with the computer's clock only where the arm runs in real time.
    """

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm)
        inner = arm
        while isinstance(inner, PassedOn) and _is_ours(inner):
            inner = inner.arm
        self._kind = type(inner)
        self._begin_clock()

    def read(self) -> Reading:
        """Return what the sensors say.

        Raises:
            ArmFailure: the arm's code failed, gave no reading, or its clock stands still or leapt.

        """
        reading: Reading = self._call("read", check=lambda given: checked(given, self.spec))
        time, now = reading.time, monotonic()
        if self._last is not None:
            passed = now - self._read_at + (0.0 if self.real_time else self._waited_since)
            if time - self._last > 2 * passed + LEAP:
                raise self._clock_failed(f"leapt ahead by {time - self._last:.6g} s while {passed:.3g} s passed")
            if self._waits >= FEWEST_WAITS and self._waited >= STILL and 0 <= time - self._from < self._waited / 2:
                raise self._clock_failed(
                    f"stands still: it advanced by {time - self._from:.3g} s in {self._waits} waits of "
                    f"{self._waited:.3g} s together"
                )
        if self._last is None or not 0 <= time - self._from < self._waited / 2:
            self._from, self._waited, self._waits = time, 0.0, 0
        self._last, self._read_at, self._waited_since = time, now, 0.0
        return reading

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves."""
        self._call("set_valves", valves)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses, if the arm can time them."""
        return bool(self._call("set_pulses", command))

    def wait(self, seconds: float) -> None:
        """Let time pass [s].

        Raises:
            ArmFailure: the arm's code failed, or the wait of an arm that runs in real time was far too long.

        """
        self._wait("wait", seconds, seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s]; errors as of :meth:`wait`."""
        left = 0.0 if self._last is None else time - self._last - self._waited_since
        self._wait("wait_until", time, max(left, 0.0))

    def air_used(self) -> float | None:
        """Return the air that the arm has used."""
        used = self._call("air_used", check=lambda given: None if given is None else float(given))
        return used if used is None or math.isfinite(used) else None

    def make_ready(self) -> None:
        """Prepare to move after a pause, in which anything may have happened to the clock."""
        self._begin_clock()
        self._call("make_ready")

    def link_counts(self) -> dict[str, int]:
        """Return what has happened on the link to the arm."""

        def as_counts(given: Mapping[str, int]) -> dict[str, int]:
            return {str(name): int(count) for name, count in given.items()}

        counts: dict[str, int] = self._call("link_counts", check=as_counts)
        return counts

    def get_state(self) -> bytes | None:
        """Return the state of the arm."""
        state: bytes | None = self._call("get_state", check=lambda given: None if given is None else memoryview(given))
        return None if state is None else bytes(state)

    def set_state(self, state: bytes) -> None:
        """Restore the state of the arm."""
        self._begin_clock()
        self._call("set_state", state)

    def close(self) -> None:
        """Close the arm."""
        self._call("close")

    def _call(self, method: str, *values: object, check: Callable[[Any], Any] | None = None) -> Any:
        """Return what ``method`` of the arm returns, as ``check`` makes it.

        Raises:
            ArmFailure: it raised anything, or what it returned is none of what it should; an error that is raised on
                purpose, and an interruption, stay what they are.

        """
        returned = False
        try:
            given = getattr(self.arm, method)(*values)
            returned = True
            return given if check is None else check(given)
        except (KeyboardInterrupt, UnusableInput):
            raise
        except BaseException as error:  # SystemExit too: no arm ends the program
            self._shut()
            if isinstance(error, PneumarmError) and not returned:
                raise
            what = "returned nothing that can be used" if returned else "failed"
            text = " ".join("".join(traceback.format_exception_only(error)).split())
            text = str(error) if isinstance(error, PneumarmError) else text
            called = f"{self._kind.__module__}.{self._kind.__qualname__}.{method}"
            raise ArmFailure(
                f"{self.spec.name}: {called} {what}: {text[:_LONGEST]} ({self._place(method, error)}); mend this arm's "
                "code or its hardware"
            ) from error

    def _place(self, method: str, error: BaseException) -> str:
        """Return the file and line of the arm's code at which ``error`` was raised, else where ``method`` begins."""
        frame = last_line(error, self._kind.__module__)
        if frame is not None:
            return frame
        code = getattr(getattr(self._kind, method, None), "__code__", None)
        return f"{code.co_filename}:{code.co_firstlineno}" if code is not None else f"{self._kind.__module__}"

    def _wait(self, method: str, value: float, seconds: float) -> None:
        begun = monotonic()
        self._call(method, value)
        took = monotonic() - begun
        self._waited += seconds
        self._waited_since += seconds
        self._waits += seconds > 0
        if self.real_time and took > 2 * seconds + LEAP:
            raise self._clock_failed(f"and its waits disagree with the computer's: {seconds:.3g} s took {took:.3g} s")

    def _begin_clock(self) -> None:
        """Compare the clock with nothing before the next reading."""
        self._last: float | None = None  # time of the last reading [s]
        self._read_at = 0.0  # when that was by the computer's clock [s]
        self._waited_since = 0.0  # since then [s]
        self._from = 0.0  # the last time that had advanced as it should [s]
        self._waited, self._waits = 0.0, 0  # since then [s]

    def _clock_failed(self, what: str) -> ArmFailure:
        self._shut()
        self._begin_clock()
        return ArmFailure(
            f"{self.spec.name}: its clock {what}; Reading.time must be in seconds of one clock that only advances, and "
            f"wait must let it (see {self._kind.__module__}.{self._kind.__qualname__})"
        )

    def _shut(self) -> None:
        """Close all valves, if that still works: the first failure is the one to tell of."""
        with suppress(Exception, SystemExit):
            self.arm.set_valves(np.zeros((self.spec.joints, 2), np.int8))


def owned(arm: Arm) -> Arm:
    """Return ``arm``, behind an :class:`OwnArm` where any of its code is not pneumarm's.

    Raises:
        UnusableInput: it has no spec; it is closed then.

    """
    try:
        spec: object = arm.spec
    except Exception as error:
        spec = error
    if not isinstance(spec, ArmSpec):
        with suppress(Exception, SystemExit):
            arm.close()
        kind = type(arm)
        raise UnusableInput(
            f"{kind.__module__}.{kind.__qualname__}: expected a pneumarm.arm.ArmSpec as its spec, got {spec!r:.80}; "
            "set self.spec where the arm is made"
        )
    inner, foreign = arm, not _is_ours(arm)
    while isinstance(inner, PassedOn) and not isinstance(inner, OwnArm):
        inner = inner.arm
        foreign = foreign or not _is_ours(inner)
    return OwnArm(arm) if foreign and not isinstance(inner, OwnArm) else arm


def _is_ours(arm: Arm) -> bool:
    return type(arm).__module__.startswith("pneumarm.")


def last_line(error: BaseException, module: str) -> str | None:
    """Return the last line of ``module`` in the traceback of ``error``: file:line, in function; None if none is."""
    found: tuple[FrameType, int] | None = None
    for frame, line in traceback.walk_tb(error.__traceback__):
        if frame.f_globals.get("__name__") == module:
            found = frame, line
    if found is None:
        return None
    return f"{found[0].f_code.co_filename}:{found[1]}, in {found[0].f_code.co_name}"
