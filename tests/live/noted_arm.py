"""A virtual arm for a board in a process of its own, which writes down when all its muscles are vented.

``PNEUMARM_NOTES`` names the file. Each line is a time on the clock that all processes of this machine share [s], and
whether all valves let air out from then on.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, STDOUT, Popen
from sys import executable
from time import monotonic

import numpy as np

from pneumarm.arm.virtual import VirtualArm, draw_parameters

NOTES = "PNEUMARM_NOTES"


class Noted(VirtualArm):
    """The virtual arm number 3, with its notes."""

    def set_valves(self, valves):
        self._note(bool((np.asarray(valves) == -1).all()))
        super().set_valves(valves)

    def set_pulses(self, command):
        self._note(False)
        return super().set_pulses(command)

    def _note(self, vented):
        with open(os.environ[NOTES], "a") as notes:
            notes.write(f"{monotonic()} {int(vented)}\n")


def noted():
    return Noted(draw_parameters(3), seed=3, name="noted")


def vented_after(notes: Path, time: float) -> float | None:
    """Return how long after ``time`` [s] all muscles were vented for good; None where they are not."""
    rows = [(float(at), vented == "1") for at, vented in (line.split() for line in notes.read_text().splitlines())]
    first = None
    for at, vented in reversed(rows):
        if not vented:
            break
        first = at
    return None if first is None else max(first - time, 0.0)


@contextmanager
def board(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Serve the arm behind an emulated board, in real time; give the path of its port and that of its notes."""
    link, notes = folder / "arm.port", folder / "notes"
    notes.touch()
    command = [
        executable,
        "-m",
        "pneumarm",
        "arm",
        "emulate",
        "python:noted_arm:noted",
        "--link",
        str(link),
        "--json",
    ]
    environment = os.environ | {NOTES: str(notes)}
    with Popen(command, cwd=Path(__file__).parent, env=environment, stdout=PIPE, stderr=STDOUT, text=True) as process:
        try:
            assert process.stdout is not None
            said = ""
            while '{"port"' not in said:
                said = process.stdout.readline()
                assert said, "the board does not come up"
            yield link, notes
        finally:
            process.kill()
