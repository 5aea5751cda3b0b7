"""A board in pure Python behind a pseudo-terminal, in real time: for whoever has no hardware yet."""

import os
import pty
import select
import time
import tty
from collections.abc import Callable
from contextlib import suppress

from pneumarm.arm.seam import Arm
from pneumarm.arm.serial.board import EmulatedBoard

TURN = 0.5e-3
"""Longest time between two looks at the line [s]."""
MOST_BEHIND = 0.1
"""An arm farther behind real time than this [s] lets that time go, as after this computer slept."""


def serve(arm: Arm, opened: Callable[[str], None], stop: Callable[[], bool] = lambda: False) -> None:
    """Serve ``arm`` behind a new pseudo-terminal until interrupted, or until ``stop`` says so.

    Args:
        arm: an arm whose time passes only when it is asked to wait.
        opened: told the terminal's path.
        stop: asked every turn.

    """
    master, slave = pty.openpty()
    try:
        tty.setraw(slave)
        board = EmulatedBoard(arm)
        board.run_until(board.time + 0.2)  # compiles the physics before anyone counts the time
        opened(os.ttyname(slave))
        _serve(board, master, stop)
    finally:
        arm.close()
        os.close(master)
        os.close(slave)


def _serve(board: EmulatedBoard, master: int, stop: Callable[[], bool]) -> None:
    ahead = board.time - time.monotonic()
    while not stop():
        readable, _, _ = select.select([master], [], [], TURN)
        now = time.monotonic() + ahead
        if now - board.time > MOST_BEHIND:
            ahead -= now - board.time
            now = board.time
        board.run_until(now)
        if readable:
            with suppress(OSError):
                answer = board.receive(os.read(master, 4096))
                if answer:
                    os.write(master, answer)
