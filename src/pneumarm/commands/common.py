"""What the commands share."""

import math
import os
import shlex
import sys
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from time import monotonic
from typing import Annotated, Any, TextIO

import numpy as np
from cyclopts import Parameter, Token
from numpy.typing import NDArray
from rich.status import Status

from pneumarm.address import Address, address_of
from pneumarm.arm import ArmSpec, Reading
from pneumarm.console import ERRORS
from pneumarm.control.monitor.settings import Mode
from pneumarm.moving.movement import Seen

Json = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON object on stdout and nothing else.")
]
"""The flag that every command has."""


def _place(_: Any, tokens: Sequence[Token]) -> Address:
    return address_of(tokens[0].value)


AnyStore = Annotated[Address, Parameter(converter=_place, n_tokens=1, accepts_keys=False)]
"""Where a store is: a path, or the address of a database on a server."""
Settings = Parameter(name="*")
"""Marks a dataclass of settings whose fields become options."""
Measuring = Parameter(name="measure")
"""Marks how a check-up measures: options such as --measure.fill, which --help-all shows."""
OwnMethod = Annotated[str | None, Parameter(name="--method")]
"""The option of commands that open an agent: MODULE:NAME of the method that trained it, whose code may run."""
Monitoring = Annotated[
    Mode,
    Parameter(
        name="--monitor",
        help="What to do about faults of the arm.\n\n"
        "stop: mark what a fault spoils, and give up where it lasts; warn: only tell; off: do not look.",
    ),
]
"""What is done about faults of an arm that are found while it moves."""
_EXAMPLE = 10.0  # degrees
_LOOK = 0.1  # s between two lines that a person can read


def move_command(controller: Path, arm: str, spec: ArmSpec, goal_range: Any) -> str:
    """Return what a person can call next: `pneumarm move` to a goal within ``goal_range`` (joints, 2) [counts]."""
    angles = (_EXAMPLE if low <= _EXAMPLE <= high else (low + high) / 2 for low, high in spec.degrees(goal_range))
    goal = ",".join(f"{angle:.3g}deg" for angle in angles)
    return f"`{shlex.join(['pneumarm', 'move', str(controller), '--arm', arm, goal])}`"


def open_page(address: str, wanted: bool | None, said_on: TextIO) -> None:
    """Open ``address`` in the browser if that is ``wanted``, or by default if somebody is there to see it.

    That is where there is a screen, what is ``said_on`` is a terminal, and no CI runs this.
    """
    graphical = sys.platform in ("win32", "darwin") or "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    if wanted or (wanted is None and graphical and said_on.isatty() and "CI" not in os.environ):
        webbrowser.open(address)


@contextmanager
def live(spec: ArmSpec) -> Iterator[Seen]:
    """Show on stderr where an arm is and where it should be while the block runs; nothing where that is no terminal.

    Gives what is to be called with every reading.
    """
    with Status("", console=ERRORS) if ERRORS.is_terminal else nullcontext() as status:
        shown = -math.inf

        def see(reading: Reading, goal: NDArray[np.float64]) -> None:
            nonlocal shown
            now = monotonic()
            if status is None or now - shown < _LOOK:
                return
            shown = now
            joints = zip(spec.degrees(reading.angle), spec.degrees(goal), spec.bar(reading.pressure), strict=True)
            angles = [f"{at:z6.1f}° of {to:z6.1f}°  {p[0]:z.2f} {p[1]:z.2f} bar" for at, to, p in joints]
            status.update(f"{reading.time:8.1f} s  {'   '.join(angles)}")

        yield see
