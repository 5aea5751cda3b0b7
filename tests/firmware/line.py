"""The line of a simulated board: what lets pneumarm's own driver talk to the real firmware in lock-step."""

from pneumarm.arm.serial import Line
from tests.firmware.board import SimulatedBoard


class SimulatedLine(Line):
    """A line to ``board``, whose time is the chip's: it passes only while the host waits for something."""

    def __init__(self, board: SimulatedBoard) -> None:
        self.board = board

    def write(self, data: bytes) -> None:
        """Put ``data`` on the line."""
        self.board.write(data)

    def read(self, timeout: float) -> bytes:
        """Return what came, waiting up to ``timeout`` [s] of the chip's time for the first byte."""
        first = self.board.read(1, timeout)
        return first + self.board.read(self.board.in_waiting, 0.0)

    def now(self) -> float:
        """Return the chip's time [s]."""
        return self.board.time

    def sleep_until(self, time: float) -> None:
        """Let the chip's time pass until ``time`` [s]."""
        self.board.wait_until(time)

    def close(self) -> None:
        """Leave the board without power: nothing can be asked of it any more."""
        self.board.close()
