"""What only a person can know of an arm, asked for while the arm is held still."""

import math
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from queue import Empty, Queue
from threading import Thread

import numpy as np

from pneumarm.arm import GuardedArm
from pneumarm.checkup import ArmCalibration, Checkup, Known, calibrate, ends, fill_alone
from pneumarm.console import ERRORS, say
from pneumarm.errors import UnusableInput
from pneumarm.progress import Display, progress

SUPPLY = (0.1, 10.0)
"""Pressures that a supply can have [bar gauge]."""
PER_BAR = (1.0, 1000.0)
"""Counts of a pressure sensor per bar that are possible."""
_BAR = 24  # letters of a bar
_TURN = 0.05  # s between two looks at the keyboard
_HELD = 60.0  # s for which a muscle is kept full while nobody answers
_TURNED = (-360.0, 360.0)  # degrees that a protractor can show


Bars = Sequence[tuple[str, float, str]]
"""Names, shares of their ranges, and values in words, of what is shown as bars."""
Meanwhile = Callable[[], object]
"""What an arm needs while somebody thinks."""
Range = tuple[float, float]


def nothing() -> None:
    """Do nothing."""


class Person(ABC):
    """Who is told and asked; what an arm needs meanwhile is done until the answer is there."""

    display: Display = staticmethod(progress)
    """Shows how far long work is."""

    @abstractmethod
    def say(self, text: str) -> None:
        """Tell ``text``."""

    @abstractmethod
    def show(self, bars: Bars) -> None:
        """Show what sensors read now; nothing where there are no ``bars``."""

    @abstractmethod
    def line(
        self, question: str, meanwhile: Meanwhile = nothing, choices: Sequence[str] = (), numbers: bool = False
    ) -> str:
        """Return the answer to ``question``; ``meanwhile`` is called over and over until it is there.

        Where there are ``choices`` or ``numbers`` are wanted, that is how it is asked; any answer may come. Raises
        UnusableInput where nobody will answer any more.
        """

    def number(
        self, question: str, between: Range, meanwhile: Meanwhile = nothing, usual: float | None = None
    ) -> float:
        """Return the number answered, asked for again until it is ``between`` two; ``usual`` for an empty line."""
        low, high = between
        while True:
            answer = self.line(question, meanwhile, numbers=True)
            if not answer and usual is not None:
                return usual
            value = as_number(answer)
            if low <= value <= high:
                return value
            what = "is not a number" if math.isnan(value) else "is not possible"
            self.say(f"{answer!r} {what}: a number from {low:g} to {high:g} is needed.")

    def choice(self, question: str, choices: Sequence[str], meanwhile: Meanwhile = nothing) -> str:
        """Return which of ``choices`` was answered, whole or by its first letter; it is asked again until one was."""
        while True:
            answer = self.line(question, meanwhile, choices=choices).lower()
            found = [word for word in choices if answer in (word[0], word)]
            if found:
                return found[0]
            self.say(f"{answer!r} is none of these.")


class AtTerminal(Person):
    """Who answers on standard input, a line each."""

    def __init__(self) -> None:
        self._lines: Queue[str | None] = Queue()
        Thread(target=self._read, args=(sys.stdin.fileno(),), name="pneumarm answers", daemon=True).start()

    def say(self, text: str) -> None:
        """Print ``text``."""
        say(text)

    def show(self, bars: Bars) -> None:
        """Show ``bars`` in a line that is written over; nothing where that is no terminal."""
        drawn = (f"{name} {('█' * round(_BAR * share)).ljust(_BAR, '░')} {value}" for name, share, value in bars)
        if ERRORS.is_terminal:
            print(f"\r{'   '.join(drawn)}", end="" if bars else "\n", file=sys.stderr, flush=True)

    def _read(self, descriptor: int) -> None:
        """Put what is typed into the queue; in the end None."""
        rest = b""
        with suppress(OSError):  # a terminal that was closed
            while data := os.read(descriptor, 4096):
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    self._lines.put(line.decode(errors="replace").strip())
        if rest:
            self._lines.put(rest.decode(errors="replace").strip())
        self._lines.put(None)

    def line(
        self, question: str, meanwhile: Meanwhile = nothing, choices: Sequence[str] = (), numbers: bool = False
    ) -> str:
        """Return the line that is typed; on a terminal what was typed before the question is no answer to it."""
        while sys.stdin.isatty() and not self._lines.empty():
            self._lines.get()
        told = ", ".join(f"{word[0]} = {word}" for word in choices)
        say(f"{question} ({told})" if choices else question)
        while True:
            meanwhile()
            with suppress(Empty):
                answer = self._lines.get(timeout=_TURN)
                break
        if answer is None:
            self._lines.put(None)
            raise UnusableInput("no answer came; call the command again at a terminal, or give options instead")
        return answer


def as_number(answer: str) -> float:
    """Return the number in ``answer``, with a point or a comma; NaN where it is none."""
    try:
        value = float(answer.replace(",", "."))
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def resting(guard: GuardedArm) -> Meanwhile:
    """Return what is to be called over and over while an arm stands still: hardware knows by it that we are there."""
    return lambda: guard.despite_losses(lambda: guard.wait(0.0))


def vent(guard: GuardedArm) -> None:
    """Open all exhausts."""
    guard.despite_losses(lambda: guard.set_valves(np.full_like(guard.applied, -1)))


def missing_of(arm: str, known: Known) -> list[str]:
    """Return the options that must say what the counts of ``arm`` mean: a serial port cannot tell."""
    if not arm.startswith("serial:") or ",spec=" in arm:
        return []
    angle = [] if known.angles or known.counts_per_degree else ["--angles or --counts-per-degree"]
    pressure = [] if known.supply or known.counts_per_bar else ["--supply or --counts-per-bar"]
    return angle + pressure


def asked_for(
    guard: GuardedArm,
    checkup: Checkup,
    known: Known,
    person: Person,
    keep: Callable[[Known], object] = lambda known: None,
) -> Known:
    """Return what is known with what a person says who has protractor and manometer before them.

    What is known of the angles of some joints is for the first ones; ``keep`` is called after each answer.
    """
    if not known.counts_per_degree:
        for joint in range(len(known.angles), guard.spec.joints):
            known = replace(known, angles=(*known.angles, _protractor(guard, checkup, joint, person)))
            keep(known)
    vent(guard)
    if not (known.supply or known.counts_per_bar):
        question = "What does the manometer of the supply show [bar]?"
        known = replace(known, supply=person.number(question, SUPPLY, resting(guard)))
        keep(known)
    return known


def calibrated(checkup: Checkup, known: Known, person: Person, meanwhile: Meanwhile) -> tuple[ArmCalibration, Known]:
    """Return the calibration by what is ``known``, and that; where pressures tell nothing, their scale is asked for.

    Raises:
        UnusableInput: something has to be mended, and the arm to be checked again.

    """
    while True:
        try:
            return calibrate(checkup, known), known
        except UnusableInput as error:
            if known.supply is None:
                raise
            person.say(f"{error}. What was measured is kept.")
            question = "Counts per bar of the pressure sensors, by their data sheet? (Enter if it has to be mended)"
            per_bar = person.number(question, PER_BAR, meanwhile, usual=0.0)
            if not per_bar:
                raise
            known = replace(known, supply=None, counts_per_bar=per_bar)


def _protractor(guard: GuardedArm, checkup: Checkup, joint: int, person: Person) -> tuple[float, float]:
    """Return the angles [degrees] of ``joint`` at the ends of the check-up, from those that it is held at now."""
    while True:
        at_end = [guard.despite_losses(partial(_at_end, guard, checkup, joint, m, person)) for m in (1, 0)]
        said, counts = zip(*at_end, strict=True)
        if said[0] < said[1] and counts[0] < counts[1]:
            break
        person.say(
            f"That is not possible: muscle 1 turns joint {joint + 1} to the higher angle, but you said {said[1]:g} "
            f"degrees for muscle 1 and {said[0]:g} for muscle 2. Both are asked for again."
        )
    per_degree = (counts[1] - counts[0]) / (said[1] - said[0])
    then = ends(checkup.joints[joint])  # it has crept a little since
    low, high = (s + (float(t) - c) / per_degree for s, t, c in zip(said, then, counts, strict=True))
    return low, high


def _at_end(guard: GuardedArm, checkup: Checkup, joint: int, muscle: int, person: Person) -> tuple[float, float]:
    """Hold ``joint`` with one muscle full and return its angle by the protractor [degrees], and its counts then.

    After a minute without an answer the air is let out; an empty line has it filled again.
    """
    question = (
        f"Joint {joint + 1} stands with muscle {muscle + 1} full. Its angle by the protractor [degrees]? (Enter "
        "moves it there again)"
    )
    while True:
        fill_alone(guard, joint, muscle, checkup.settings)
        begun, counts, vented = guard.read().time, math.nan, False

        def hold(begun: float = begun) -> None:
            nonlocal counts, vented
            guard.wait(0.0)
            if vented:
                return
            reading = guard.read()
            counts = float(reading.angle[joint])
            if reading.time - begun > _HELD:
                guard.set_valves(np.full_like(guard.applied, -1))
                vented = True
                person.say("The air is let out meanwhile.")

        angle = person.number(question, _TURNED, hold, usual=math.inf)
        if math.isfinite(angle):
            return angle, counts
