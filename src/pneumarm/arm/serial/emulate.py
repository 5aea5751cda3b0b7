"""A board in pure Python behind a pseudo-terminal, in real time: for whoever has no hardware yet."""

import os
import select
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneumarm.arm.seam import Arm
from pneumarm.arm.serial.board import EmulatedBoard
from pneumarm.errors import UnusableInput

TURN = 5e-3
"""Longest time between two looks at the line [s]; what comes there is answered at once."""
MOST_BEHIND = 0.1
"""A board farther behind real time than this [s] lets that time go, as after this computer slept."""


@dataclass
class Served:
    """What happened while a board was served."""

    requests: int = 0
    """Times that something came from the host."""
    let_go: int = 0
    """Times that the board was too far behind real time and let that time go: its arm stood still meanwhile."""


def serve(
    arm: Arm,
    opened: Callable[[str], None],
    stop: Callable[[], bool] = lambda: False,
    *,
    link: Path | None = None,
) -> Served:
    """Serve ``arm`` behind a new pseudo-terminal until interrupted, or until ``stop`` says so.

    Args:
        arm: an arm whose time passes only when it is asked to wait; it is closed in the end.
        opened: told the terminal's path, or ``link``, once whatever comes there is answered.
        stop: asked every turn, at least every 5 ms.
        link: where a symbolic link to the terminal is to lie as long, for a name that stays the same.

    Raises:
        UnusableInput: the link cannot be made, or the arm has more joints than the board.

    """
    try:
        import pty
        import tty
    except ImportError as error:
        raise UnusableInput(
            "a serial port is emulated on Linux and macOS only; emulated:ARM emulates the board in one process"
        ) from error
    with arm:
        board = EmulatedBoard(arm)
        _warm_up(board)
        master, slave = pty.openpty()
        try:
            tty.setraw(slave)
            with _linked(os.ttyname(slave), link) as path:
                opened(path)
                return _serve(board, master, stop)
        finally:
            os.close(master)
            os.close(slave)


def _warm_up(board: EmulatedBoard) -> None:
    """Have the physics compiled, of every valve, before anyone counts the time."""
    arm = board.arm
    for value in (1, 0, -1):
        arm.set_valves(np.full((arm.spec.joints, 2), value, np.int8))
        board.run_until(board.time + 0.05)


@contextmanager
def _linked(terminal: str, link: Path | None) -> Iterator[str]:
    """Have ``link`` lead to ``terminal``; give the path to be told."""
    if link is None:
        yield terminal
        return
    try:
        if link.is_symlink() and not link.exists():
            link.unlink()  # of one who was killed
        link.symlink_to(terminal)
    except OSError as error:
        raise UnusableInput(f"{link}: cannot be made a link ({error.strerror}); give another path") from error
    try:
        yield str(link)
    finally:
        with suppress(OSError):
            link.unlink()


def _serve(board: EmulatedBoard, master: int, stop: Callable[[], bool]) -> Served:
    served = Served()
    ahead = board.time - time.monotonic()
    while not stop():
        readable, _, _ = select.select([master], [], [], TURN)
        now = time.monotonic() + ahead
        if now - board.time > MOST_BEHIND:
            served.let_go += 1
            ahead -= now - board.time
            now = board.time
        board.run_until(now)
        if readable:
            with suppress(OSError):
                served.requests += 1
                answer = board.receive(os.read(master, 4096))
                if answer:
                    os.write(master, answer)
    return served
