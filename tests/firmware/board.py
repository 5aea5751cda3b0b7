"""The simulated microcontroller wired to a virtual arm, in lock-step: the whole board but for the soldering.

The chip goes first, by a step of :data:`STEP`; then the arm follows over the same time with every valve at the very
cycle of its pin, and its sensors give the voltages for the chip's next step. An arm without valves is a board on a
table: analog inputs are what the test sets.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm
from pneumarm.arm.seam import measured
from pneumarm.arm.virtual import VirtualArm
from tests.firmware.chip import FREQUENCY, VALVE_PINS, Chip

STEP = 0.25e-3
"""Time for which a voltage is held [s]: about one sweep of the converter, so that each conversion has its noise."""
_FIRST_EXTRA = 6  # channels of the converter before it are of angles and pressures
_STEP_CYCLES = round(STEP * FREQUENCY)
_SLICE = 800
"""Cycles between two looks at the line while something waits for it."""


def single_conversions(arm: VirtualArm, seed: int = 0) -> VirtualArm:
    """Return the same arm with single conversions: the medians are the board's business."""
    sensors = replace(arm.parameters.sensors, conversions=1)
    further = {"velocity_sensor": arm.spec.velocity_sensor, "sensors": arm.spec.sensors}
    return VirtualArm(replace(arm.parameters, sensors=sensors), seed=seed, name=arm.spec.name, **further)


def valves_of(pins: int, joints: int) -> NDArray[np.int8]:
    """Return what the levels of D4 to D11 do to the valves (joints, 2).

    Raises:
        AssertionError: an inlet and its exhaust are open together, which no level may ever do.

    """
    valves = np.zeros((joints, 2), np.int8)
    for muscle in range(2 * joints):
        inlet, exhaust_closed = pins >> 2 * muscle & 1, pins >> 2 * muscle & 2
        assert exhaust_closed or not inlet, f"muscle {muscle + 1}: inlet and exhaust are open, pins {pins:010b}"
        valves[muscle // 2, muscle % 2] = 1 if inlet else 0 if exhaust_closed else -1
    return valves


class SimulatedBoard:
    """A board with the real firmware and an arm on it; bytes in, bytes out, and time that passes only when asked.

    Args:
        arm: what is moved, for example from :func:`single_conversions`; None for a board without an arm.
        firmware: the .hex; built where it is not given.

    """

    def __init__(self, arm: Arm | None = None, firmware: Path | None = None) -> None:
        self.chip = Chip(firmware)
        self.arm = arm
        self._told = 0
        self._next_step = 0
        self._behind = 0.0
        self._waiting = bytearray()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Take the board off its supply: all pins low."""
        self.chip.close()
        if self.arm is not None:
            self.arm.close()

    @property
    def time(self) -> float:
        """The board's time since power-on [s]."""
        return self.chip.time

    @property
    def in_waiting(self) -> int:
        """Number of bytes that can be read without waiting."""
        return len(self._waiting)

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        self._run_until(self.chip.cycle + round(seconds * FREQUENCY))

    def wait_until(self, time: float) -> None:
        """Let time pass until ``time`` [s]."""
        self._run_until(round(time * FREQUENCY))

    def write(self, data: bytes) -> int:
        """Put bytes on the line to the board; they take their time there, 20 us each."""
        self.chip.write(bytes(data))
        return len(data)

    def read(self, size: int, timeout: float) -> bytes:
        """Return ``size`` bytes from the board, or those that came within ``timeout`` [s] of the board's time."""
        end = self.chip.cycle + math.ceil(timeout * FREQUENCY)  # never less, or who waits on would wait for ever
        while len(self._waiting) < size and self.chip.cycle < end:
            self._run_until(min(end, self.chip.cycle + _SLICE))
        data = bytes(self._waiting[:size])
        del self._waiting[:size]
        return data

    def discard(self) -> None:
        """Forget what came and was not read."""
        self._waiting.clear()

    def reset(self, cause: str = "EXTERNAL") -> None:
        """Reset the chip for a cause of the page."""
        self.chip.reset(cause)

    def _run_until(self, cycle: int) -> None:
        while self._next_step <= cycle and self.arm is not None:
            self.chip.run_until(self._next_step)
            self._follow()
            self._next_step += _STEP_CYCLES
        self.chip.run_until(cycle)
        self._waiting += bytes(byte for _, byte in self.chip.received())

    def _follow(self) -> None:
        """Bring the arm up to the chip's time, and its sensors onto the chip's inputs."""
        arm = self.arm
        assert arm is not None
        for change in self.chip.changes[self._told :]:
            self._pass(change.cycle)
            arm.set_valves(valves_of(change.pins & VALVE_PINS, arm.spec.joints))
        self._told = len(self.chip.changes)
        self._pass(self.chip.cycle)
        reading = arm.read()
        for joint in range(arm.spec.joints):
            sensors = (reading.angle[joint], *reading.pressure[joint])
            for channel, count in enumerate(sensors, start=len(sensors) * joint):
                self.chip.set_count(channel, int(count))
        further = arm.spec.sensors
        for one, value in zip(further, measured(reading, (one.name for one in further)), strict=True):
            self.chip.set_count(_FIRST_EXTRA + (one.channel or 1) - 1, round(one.counts(value)))

    def _pass(self, cycle: int) -> None:
        assert self.arm is not None
        seconds = cycle / FREQUENCY - self._behind
        if seconds > 0:
            self.arm.wait(seconds)
            self._behind = cycle / FREQUENCY
