"""A line that loses, doubles, delays and spoils frames, as real ones do (thesis A.1.4), or is pulled out."""

import math
from dataclasses import dataclass

import numpy as np

from pneumarm.arm.serial.line import Line
from pneumarm.settings import Settings, Share

CLAIMED_EMPTY = 0.005
"""For so long a driver says that nothing came [s], once it does."""


@dataclass(frozen=True)
class LineFaults(Settings):
    """How often what happens to a frame, in both directions; shares of 1."""

    dropped: Share = 0.0
    doubled: Share = 0.0
    """The frame comes again at once."""
    late: Share = 0.0
    """The frame comes ``lateness`` later, after newer ones."""
    corrupted: Share = 0.0
    """Some bytes of the frame are changed, cut or inserted."""
    claims_empty: Share = 0.0
    """Share of reads for which the driver says that nothing came, though something did (thesis A.1.4)."""
    lateness: float = 0.05
    """[s]"""
    seed: int = 0


class FaultyLine(Line):
    """``line`` with faults. They may be changed at any time by assigning to ``faults``, which seeds their chance."""

    def __init__(self, line: Line, faults: LineFaults | None = None) -> None:
        self.line = line
        self.faults = faults or LineFaults()
        self.unplugged = False
        """Whether the plug is out: every use fails, as with a port that is gone."""
        self.cut = False
        """Whether the wire is cut: nothing arrives, and nobody is told."""
        self.sent_late = 0
        """Requests that were delivered after their time."""
        self._late_out: list[tuple[float, bytes]] = []
        self._late_in: list[tuple[float, bytes]] = []
        self._rest = b""

    @property
    def faults(self) -> LineFaults:
        """What happens to frames from now on."""
        return self._faults

    @faults.setter
    def faults(self, faults: LineFaults) -> None:
        self._faults = faults
        self._random = np.random.default_rng(faults.seed)

    def write(self, data: bytes) -> None:
        """Send what is left of ``data``."""
        self._check()
        self._deliver_late()
        for frame in data.split(b"\0")[:-1]:
            for whole in self._treated(frame + b"\0", self._late_out):
                self.line.write(whole)

    def read(self, timeout: float) -> bytes:
        """Return what is left of what came, waiting up to ``timeout`` [s] for it."""
        until = self.now() + timeout
        while True:
            self._check()
            self._deliver_late()
            came = self._arrived(self.line.read(max(min(until, self._next_late()) - self.now(), 0.0)))
            if came or self.now() >= until:
                self._check()
                return came

    def _arrived(self, data: bytes) -> bytes:
        """Return what arrives now, given what the line behind gave."""
        if data and self._random.random() < self.faults.claims_empty:
            self._late_in.append((self.now() + CLAIMED_EMPTY, data))  # it is still there, for another time
            data = b""
        *frames, self._rest = (self._rest + data).split(b"\0")
        came = b"".join(b"".join(self._treated(frame + b"\0", self._late_in)) for frame in frames)
        due = self._due(self._late_in)
        return came if self.cut else came + b"".join(due)

    def now(self) -> float:
        """Return the host's time [s]."""
        return self.line.now()

    def sleep_until(self, time: float) -> None:
        """Let time pass; what is late arrives in it."""
        while (late := min((at for at, _ in self._late_out), default=time)) < time:
            self.line.sleep_until(late)
            self._deliver_late()
        self.line.sleep_until(time)
        self._deliver_late()

    def reopen(self) -> None:
        """Open the line behind again, if the plug is in.

        Raises:
            OSError: it is not.

        """
        self._check()
        self.line.reopen()

    def close(self) -> None:
        """Close the line."""
        self.line.close()

    def _check(self) -> None:
        if self.unplugged:
            raise OSError("no such device")

    def _next_late(self) -> float:
        """Return when the next late frame arrives, on either side [s]."""
        return min((time for time, _ in self._late_out + self._late_in), default=math.inf)

    def _due(self, late: list[tuple[float, bytes]]) -> list[bytes]:
        """Return the frames in ``late`` whose time has come, and take them out."""
        now = self.now()
        due = [frame for time, frame in late if time <= now]
        late[:] = [(time, frame) for time, frame in late if time > now]
        return due

    def _deliver_late(self) -> None:
        for frame in self._due(self._late_out):
            if not self.cut and not self.unplugged:
                self.sent_late += 1
                self.line.write(frame)

    def _treated(self, frame: bytes, late: list[tuple[float, bytes]]) -> list[bytes]:
        """Return what arrives now of ``frame``: nothing, itself, itself twice, or something spoilt."""
        faults, chance = self.faults, self._random.random
        if self.cut or chance() < faults.dropped:
            return []
        if chance() < faults.late:
            late.append((self.line.now() + faults.lateness, frame))
            return []
        if chance() < faults.corrupted:
            frame = spoilt(frame, self._random)
        return [frame, frame] if chance() < faults.doubled else [frame]


def spoilt(frame: bytes, random: np.random.Generator) -> bytes:
    """Return ``frame`` with one to four bytes changed, inserted or cut; it never stays as it is."""
    while True:
        data = bytearray(frame)
        for _ in range(random.integers(1, 4, endpoint=True)):
            place = int(random.integers(len(data))) if data else 0
            what = random.integers(4)
            if what == 0 and data:
                data[place] ^= 1 << int(random.integers(8))
            elif what == 1 and data:
                data[place] = int(random.integers(256))
            elif what == 2:
                data.insert(place, int(random.integers(256)))
            elif data:
                del data[place : place + int(random.integers(1, 4, endpoint=True))]
        if bytes(data) != frame:
            return bytes(data)
