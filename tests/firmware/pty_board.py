"""Put a simulated board with a virtual arm behind a pseudo-terminal, in real time.

    python -m tests.firmware.pty_board --arm virtual:seed=1

It prints the terminal's path, for ``pneumarm run --arm serial:PATH``, and goes on until it is interrupted. With
``--program build/alone.hex``, from ``pneumarm deploy``, it is a board that drives alone: type lines at that terminal.
"""

import argparse
import os
import pty
import select
import sys
import tty
from contextlib import suppress
from pathlib import Path
from time import monotonic

from pneumarm.arm import open_arm
from pneumarm.arm.virtual import VirtualArm
from tests.firmware.board import SimulatedBoard, single_conversions

TURN = 0.25e-3
"""Real time between two looks at the terminal [s]."""
MOST_BEHIND = 0.1
"""A board farther behind real time than this [s] lets the time go, as a computer that was suspended does."""


def serve(board: SimulatedBoard, master: int) -> None:
    """Run the board in real time, its line at the pseudo-terminal ``master``, until the latter is closed."""
    begun, let_go, late = monotonic(), 0.0, 0
    while True:
        readable, _, _ = select.select([master], [], [], TURN)
        with suppress(BlockingIOError):
            if readable:
                board.write(os.read(master, 4096))
        behind = monotonic() - begun - let_go - board.time
        if behind > MOST_BEHIND:
            let_go += behind
            late += 1
            print(f"{behind:.1f} s behind real time, let go; {late} times so far", file=sys.stderr, flush=True)
            continue
        if behind > 0:
            board.wait(behind)
        if board.in_waiting:
            os.write(master, board.read(board.in_waiting, 0.0))


def main() -> None:
    """Serve until interrupted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arm", default="virtual", help="the virtual arm, as for pneumarm run")
    parser.add_argument("--seed", type=int, default=0, help="of the noise of its sensors")
    parser.add_argument("--program", type=Path, help="another program than the host's")
    options = parser.parse_args()
    arm = open_arm(options.arm, options.seed)
    if not isinstance(arm, VirtualArm):
        parser.error("a board needs a virtual arm")
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    with SimulatedBoard(single_conversions(arm, options.seed), options.program) as board:
        board.wait(0.1)  # compiles the physics before anyone counts the time
        print(os.ttyname(slave), flush=True)
        with suppress(KeyboardInterrupt):
            serve(board, master)


if __name__ == "__main__":
    main()
