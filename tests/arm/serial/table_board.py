"""The emulated board on a table, as the firmware's tests want a chip: cycles, bytes, counts, levels of pins."""

from contextlib import contextmanager
from typing import Any

import numpy as np
from tests.firmware import wire
from tests.firmware.chip import FREQUENCY, HIGHEST_COUNT, Change
from tests.firmware.host import Host

from pneumarm.arm import Arm, ArmSpec, Reading
from pneumarm.arm.serial import EmulatedBoard
from pneumarm.arm.serial.protocol import JOINTS, Cause, pack_valves

SENSORS = 3
"""Of a joint: angle and two pressures."""


class TableArm(Arm):
    """An arm without muscles: its sensors read what the test sets, its valves are lights."""

    def __init__(self, joints: int = JOINTS) -> None:
        self.spec = ArmSpec(joints=joints, name="table")
        self.counts = np.zeros((joints, SENSORS))
        self.time = 0.0
        self.changes: list[Change] = []

    def read(self) -> Reading:
        return Reading(self.time, self.counts[:, 0].copy(), self.counts[:, 1:].copy())

    def set_valves(self, valves):
        self.changes.append(Change(round(self.time * FREQUENCY), wire.pins_of(pack_valves(valves))))

    def wait(self, seconds: float) -> None:
        self.time += seconds

    def close(self) -> None:
        self.set_valves(np.full((self.spec.joints, 2), -1, np.int8))


class EmulatedChip:
    """What :class:`tests.firmware.chip.Chip` is, as far as tests of the protocol ask it."""

    def __init__(self) -> None:
        self.arm = TableArm()
        self.board = EmulatedBoard(self.arm)
        self.resets: list[int] = []
        self._sent: list[tuple[int, int]] = []

    @property
    def cycle(self) -> int:
        return round(self.board.time * FREQUENCY)

    @property
    def changes(self) -> list[Change]:
        return self.arm.changes

    @property
    def valve_pins(self) -> int:
        return self.changes[-1].pins

    def run(self, seconds: float) -> None:
        self.board.run_until(self.board.time + seconds)
        self.resets += [self.cycle] * (self.board.boots - 1 - len(self.resets))

    def run_until(self, cycle: int) -> None:
        self.run(max(cycle / FREQUENCY - self.board.time, 0.0))

    def write(self, data: bytes) -> None:
        self._sent += [(self.cycle, byte) for byte in self.board.receive(data)]

    def received(self) -> list[tuple[int, int]]:
        sent, self._sent = self._sent, []
        return sent

    def set_count(self, channel: int, count: int) -> None:
        assert 0 <= count <= HIGHEST_COUNT
        self.arm.counts[divmod(channel, SENSORS)] = count

    def reset(self) -> None:
        self.board.reset(Cause.EXTERNAL)

    def hang(self) -> None:
        self.board.hang()


@contextmanager
def armed(**configuration: int) -> Any:
    """Give a host with an armed board, all valves closed, nothing at its inputs."""
    yield Host(EmulatedChip()).ready(**configuration)
