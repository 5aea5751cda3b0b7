"""An arm behind the emulated board, over a line on which everything can go wrong, in lock-step."""

from dataclasses import dataclass, replace

import numpy as np
from tests.firmware import wire
from tests.firmware.mutations import is_request

from pneumarm.arm import Arm
from pneumarm.arm.serial import BoardLine, EmulatedBoard, FaultyLine, SerialArm
from pneumarm.arm.serial.arm import LOSSES
from pneumarm.arm.serial.protocol import VERSION
from pneumarm.arm.virtual import VirtualArm, draw_parameters

DELAY = 0.5e-3
"""Time that bytes take each way [s], about that of the real board."""


class WatchedArm(VirtualArm):
    """Keeps the valves as the board sets them, with their times."""

    def __init__(self, seed: int) -> None:
        super().__init__(replace(draw_parameters(seed), jitter=0.0), seed=seed)
        self.set: list[tuple[float, list[list[int]]]] = []

    def set_valves(self, valves):
        super().set_valves(valves)
        if hasattr(self, "set"):
            self.set.append((self.time, np.asarray(valves).tolist()))


class WatchedLine(BoardLine):
    """Counts what the board does with requests that are stale by the page."""

    def __init__(self, board: EmulatedBoard, arm: WatchedArm) -> None:
        super().__init__(board, DELAY)
        self.stale = 0
        self.stale_applied = 0
        self._newest: int | None = None
        receive = board.receive

        def watched(data: bytes) -> bytes:
            answers = b""
            for chunk in data.split(b"\0")[:-1]:
                before = len(arm.set)
                answers += receive(chunk + b"\0")
                content = is_request(chunk)
                if content is not None and self._is_stale(content):
                    self.stale += 1
                    self.stale_applied += len(arm.set) > before
            return answers

        board.receive = watched  # type: ignore[method-assign]

    def _is_stale(self, content: bytes) -> bool:
        sequence = int.from_bytes(content[1:3], "little")
        if content[0] == wire.REQUEST["CONNECT"] or self._newest is None:
            self._newest = sequence
            return False
        if not 1 <= (sequence - self._newest) & 0xFFFF <= 0x7FFF:
            return True
        self._newest = sequence
        return False


@dataclass
class Wired:
    """All parts of an arm on a line."""

    muscles: WatchedArm
    board: EmulatedBoard
    wire: WatchedLine
    line: FaultyLine
    arm: SerialArm

    @property
    def applied(self) -> list[list[int]]:
        """The valves as they are."""
        return self.muscles.set[-1][1]

    @property
    def is_vented(self) -> bool:
        return all(valve == -1 for joint in self.applied for valve in joint)


def wired(
    seed: int = 1,
    period: float = 1 / 30,
    version: int = VERSION,
    cut_off: float | None = None,
    losses: int = LOSSES,
) -> Wired:
    muscles = WatchedArm(seed)
    board = EmulatedBoard(muscles, version)
    line = WatchedLine(board, muscles)
    faulty = FaultyLine(line)
    arm = SerialArm(faulty, replace(muscles.spec, period=period), cut_off=cut_off, losses=losses)
    return Wired(muscles, board, line, faulty, arm)


def all_valves(arm: Arm, value: int) -> np.ndarray:
    return np.full((arm.spec.joints, 2), value, np.int8)


def stalling(w: Wired, stall: float) -> None:
    """Have the board do nothing with what comes for ``stall`` [s] from now; it answers all of it then."""
    until, receive, kept = w.line.now() + stall, w.board.receive, []

    def late(data: bytes) -> bytes:
        kept.append(data)
        if w.line.now() < until:
            return b""
        w.board.receive = receive  # type: ignore[method-assign]
        return receive(b"".join(kept))

    w.board.receive = late  # type: ignore[method-assign]
