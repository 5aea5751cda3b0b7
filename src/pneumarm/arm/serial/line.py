"""The seam between a link and whatever carries its bytes."""

from abc import ABC, abstractmethod


class Line(ABC):
    """Bytes to and from a board, and the clock by which the host waits for them.

    A line that is gone raises OSError from any of its methods.
    """

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send ``data``."""

    @abstractmethod
    def read(self, timeout: float) -> bytes:
        """Return what came, waiting up to ``timeout`` [s] for the first byte; empty if none came."""

    @abstractmethod
    def now(self) -> float:
        """Return the host's time [s]: it never jumps, whatever happens to the clock on the wall."""

    @abstractmethod
    def sleep_until(self, time: float) -> None:
        """Return at ``time`` [s] or a little later; at once if it is past."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the line. May be called twice."""

    def reopen(self) -> None:  # noqa: B027 - a line that never fails has nothing to do
        """Open the line again after it failed.

        Raises:
            OSError: it is still gone.

        """
