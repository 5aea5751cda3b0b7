"""Controllers to collect with that know no goal: a trajectory laid down beforehand, and a person at the keyboard.

Thesis section 3.2.2 names both, besides a controller that is to be improved and the learner itself.
"""

import os
import select
import sys
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import Reading
from pneumarm.arm.valves import Command
from pneumarm.errors import UnusableInput


class Trajectory:
    """Valves or pulses laid down beforehand, step by step; all closed once they are over."""

    def __init__(self, commands: ArrayLike) -> None:
        """Take the commands (steps, joints, 2) from -1 to +1; whole numbers are valves.

        Raises:
            UnusableInput: they are something else.

        """
        given = np.asarray(commands, np.float64)
        if given.ndim != 3 or given.shape[2] != 2 or not len(given) or not (np.abs(given) <= 1).all():
            raise UnusableInput(
                "a trajectory needs commands of shape (steps, joints, 2), each -1, 0 or +1 or a pulse in between, "
                f"got shape {given.shape}"
            )
        self.commands: Command = given.astype(np.int8) if np.isin(given, (-1, 0, 1)).all() else given
        self._step = 0

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin again; the goal is of no concern to a trajectory."""
        self._step = 0

    def act(self, reading: Reading) -> Command:
        """Return the next command (joints, 2)."""
        step, self._step = self._step, self._step + 1
        return self.commands[step] if step < len(self.commands) else np.zeros(self.commands.shape[1:], np.int8)


class Keyboard:
    """A person at the terminal; a context manager, which reads single keys while it is entered.

    Each muscle has three keys below each other, for air in, closed, and air out; they hold until the next key:

        joint 1: q a z and w s x        joint 2: e d c and r f v        joint 3: t g b and y h n
    """

    KEYS = ("qaz", "wsx", "edc", "rfv", "tgb", "yhn")

    def __init__(self, joints: int = 1, descriptor: int | None = None) -> None:
        """Listen for ``joints`` joints at a terminal's file ``descriptor``, by default that of standard input.

        Raises:
            UnusableInput: that is no terminal, or there are more joints than keys.

        """
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        if not os.isatty(self._descriptor):
            raise UnusableInput("the keyboard needs a terminal as standard input; run it without a pipe")
        if 2 * joints > len(self.KEYS):
            raise UnusableInput(f"the keyboard has keys for {len(self.KEYS) // 2} joints, this arm has {joints}")
        self._valves = np.zeros((joints, 2), np.int8)
        self._meaning = {
            key: (divmod(muscle, 2), 1 - row)
            for muscle, column in enumerate(self.KEYS[: 2 * joints])
            for row, key in enumerate(column)
        }

    def __enter__(self) -> Self:
        try:
            import termios
            import tty
        except ImportError as error:
            raise UnusableInput("single keys are read on Linux and macOS only; give another controller") from error
        self._before = termios.tcgetattr(self._descriptor)
        tty.setcbreak(self._descriptor)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        import termios

        termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin with all valves closed."""
        self._valves[:] = 0

    def act(self, reading: Reading) -> NDArray[np.int8]:
        """Return the valves (joints, 2) after the keys pressed since the last call."""
        while select.select([self._descriptor], [], [], 0)[0]:
            keys = os.read(self._descriptor, 100).decode(errors="replace")
            if not keys:
                break
            for key in keys:
                if key in self._meaning:
                    place, valve = self._meaning[key]
                    self._valves[place] = valve
        return self._valves.copy()
