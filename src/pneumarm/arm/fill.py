"""How full the muscles of an arm without pressure sensors are, estimated from what its valves were told.

Air is let in from a supply at its full pressure, or out into the atmosphere, by the law of ISO 6358 with a critical
ratio of 0, whose differential equations have solutions. With a the absolute pressure of a muscle and A that of the
supply in atmospheres, and r a rate,

    filling   da/dt =  r sqrt(A^2 - a^2),   a = A sin(asin(a_0 / A) + r t)
    emptying  da/dt = -r sqrt(a^2 - 1),     a = cosh(acosh(a_0) - r t)

Both end after a finite time, and whatever was wrong with the estimate ends with them. It takes the place of the
measured pressures in every reading behind the guard, so that state, filter, simulation, agents and classical
controllers need to know of no other kind of arm. It knows nothing of leaks, of air that a joint compresses, or of how
one muscle differs from another: a simulation learns what that means for the angle, since it sees angles and commands.

Estimates that stand for the whole past of the valves are worth more than any window of it; see
docs/decisions/arm.md.
"""

import math
import struct
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm, ArmSpec, Reading, checked
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.errors import UnusableInput

_ATMOSPHERE = 1.01325  # bar


class PressureEstimate:
    """Estimated pressures of the muscles of an arm, and what its valves do; at first all are vented.

    In plain Python: for the handful of muscles of an arm that is several times faster than NumPy.
    """

    def __init__(self, spec: ArmSpec) -> None:
        filling, emptying = spec.fill_times
        self._full = 1.0 + spec.max_pressure / _ATMOSPHERE
        self._counts, self._highest = spec.counts_per_bar * _ATMOSPHERE, spec.max_pressure_counts
        self._period = spec.period
        self._inflow = (math.pi / 2 - math.asin(1.0 / self._full)) / filling
        self._outflow = math.acosh(self._full) / emptying
        muscles = 2 * spec.joints
        self._levels = [1.0] * muscles  # absolute [atmospheres]
        self._valves = [0] * muscles
        self._left = [math.inf] * muscles  # for how long each is still open [s]
        self.time: float | None = None
        """The arm's clock up to which this goes [s]; None before its first reading."""

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Gauge pressures, shape (joints, 2) [counts]."""
        return np.minimum((np.array(self._levels).reshape(-1, 2) - 1.0) * self._counts, self._highest)

    def command(self, command: NDArray[np.int8] | NDArray[np.float64]) -> None:
        """Set valves or pulses (joints, 2)."""
        shares = command.ravel().tolist()
        self._valves = [(share > 0) - (share < 0) for share in shares]
        self._left = [math.inf if abs(share) >= 1 else abs(share) * self._period for share in shares]

    def pass_until(self, time: float) -> None:
        """Let time pass until the arm's clock shows ``time`` [s]; a clock that began anew is followed."""
        seconds, self.time = 0.0 if self.time is None else time - self.time, time
        if seconds <= 0.0:
            return
        for i, valve in enumerate(self._valves):
            if valve == 0 or self._left[i] <= 0.0:
                continue
            open_for, level = min(seconds, self._left[i]), self._levels[i]
            self._left[i] -= open_for
            if valve > 0:
                phase = math.asin(min(level / self._full, 1.0)) + self._inflow * open_for
                self._levels[i] = self._full * math.sin(min(phase, math.pi / 2))
            else:
                self._levels[i] = math.cosh(max(math.acosh(max(level, 1.0)) - self._outflow * open_for, 0.0))

    def get_state(self) -> bytes:
        """Return all that its future depends on."""
        time = math.nan if self.time is None else self.time
        return self._format.pack(time, *self._levels, *self._valves, *self._left)

    def set_state(self, state: bytes) -> None:
        """Take up what :meth:`get_state` returned."""
        time, *kept = self._format.unpack(state)
        muscles = len(self._levels)
        self._levels, self._left = kept[:muscles], kept[2 * muscles :]
        self._valves = [int(valve) for valve in kept[muscles : 2 * muscles]]
        self.time = None if math.isnan(time) else time

    @property
    def state_size(self) -> int:
        """Bytes of a state."""
        return self._format.size

    @property
    def _format(self) -> struct.Struct:
        return struct.Struct(f"<{1 + 3 * len(self._levels)}d")


_ESTIMATES: "WeakKeyDictionary[Arm, PressureEstimate]" = WeakKeyDictionary()
"""Estimates of the arms that are open: a guard that comes later goes on with those of the one before."""


class EstimatedArm(ArmWrapper):
    """``arm``, which measures no pressures, with estimates in their place."""

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm)
        while isinstance(arm, ArmWrapper):
            arm = arm.arm
        self._estimate = _ESTIMATES.setdefault(arm, PressureEstimate(self.spec))

    def read(self) -> Reading:
        """Return what the sensors say, with the estimated pressures."""
        reading = checked(self.arm.read(), self.spec)
        self._estimate.pass_until(reading.time)
        return replace(reading, pressure=self._estimate.pressure)

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves."""
        self.arm.set_valves(valves)
        self._estimate.command(valves)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses, if the arm can time them."""
        done = self.arm.set_pulses(command)
        if done:
            self._estimate.command(command)
        return done

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        self.arm.wait(seconds)
        if self._estimate.time is not None:
            self._estimate.pass_until(self._estimate.time + seconds)

    def regain(self) -> None:
        """Take up the arm again, which was vented meanwhile."""
        self.arm.regain()
        self._estimate.command(np.full((self.spec.joints, 2), -1.0))
        self.read()
        self._estimate.command(np.zeros((self.spec.joints, 2)))

    def close(self) -> None:
        """Close the arm, and its valves with it."""
        self.arm.close()
        self._estimate.command(np.zeros((self.spec.joints, 2)))

    def get_state(self) -> bytes | None:
        """Return the state of the arm and of the estimates."""
        state = self.arm.get_state()
        return None if state is None else self._estimate.get_state() + state

    def set_state(self, state: bytes) -> None:
        """Restore both.

        Raises:
            UnusableInput: the arm has no state, or this is none of it.

        """
        size = self._estimate.state_size if self.arm.get_state() is not None else 0
        if len(state) < size:
            raise UnusableInput(f"{self.spec.name}: expected the saved state of an arm without pressure sensors")
        self.arm.set_state(state[size:])
        self._estimate.set_state(state[:size])


def estimated_pressures(
    spec: ArmSpec, times: NDArray[np.float64], command: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the pressures (n, joints, 2) [counts] of muscles that were vented at first, as they are estimated.

    ``command`` (n, joints, 2) was applied at ``times`` (n,) [s], and none, NaN, after the last.
    """
    fill, found = PressureEstimate(spec), []
    for now, applied in zip(times.tolist(), np.clip(np.nan_to_num(command), -1, 1), strict=True):
        fill.pass_until(now)
        found.append(fill.pressure)
        fill.command(applied)
    return np.array(found)
