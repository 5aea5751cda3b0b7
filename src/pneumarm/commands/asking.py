"""What only a person can know of an arm, asked for while the arm is held still."""

import math
import select
import sys
from dataclasses import replace

from pneumarm.arm import GuardedArm
from pneumarm.checkup import Checkup, Known, ends, fill_alone
from pneumarm.console import say
from pneumarm.errors import UnusableInput

_TURN = 0.05  # s between two looks at the keyboard


def missing_of(arm: str, known: Known) -> list[str]:
    """Return the options that must say what the counts of ``arm`` mean: a serial port cannot tell."""
    if not arm.startswith("serial:") or ",spec=" in arm:
        return []
    angle = [] if known.angles or known.counts_per_degree else ["--angles or --counts-per-degree"]
    pressure = [] if known.supply or known.counts_per_bar else ["--supply or --counts-per-bar"]
    return angle + pressure


def asked_for(guard: GuardedArm, checkup: Checkup, known: Known) -> Known:
    """Return what is known with what a person says who has protractor and manometer before them."""
    if not (known.angles or known.counts_per_degree):
        known = replace(known, angles=tuple(_protractor(guard, checkup, j) for j in range(guard.spec.joints)))
    if not (known.supply or known.counts_per_bar):
        known = replace(known, supply=_answer(guard, "What does the manometer of the supply show [bar]?"))
    return known


def _protractor(guard: GuardedArm, checkup: Checkup, joint: int) -> tuple[float, float]:
    """Return the angles [degrees] of ``joint`` at the ends of the check-up, from those that it is held at now."""
    said, counts = [], []
    for muscle in (1, 0):
        fill_alone(guard, joint, muscle, checkup.settings)
        question = f"Joint {joint + 1} stands with muscle {muscle + 1} full. Its angle by the protractor [degrees]?"
        said.append(_answer(guard, question))
        counts.append(float(guard.read().angle[joint]))
    if not (said[0] < said[1] and counts[0] < counts[1]):
        raise UnusableInput(f"{guard.spec.name}: muscle 1 must turn the joint to the higher angle, got {said}")
    per_degree = (counts[1] - counts[0]) / (said[1] - said[0])
    then = ends(checkup.joints[joint])  # it has crept a little since
    low, high = (s + (float(t) - c) / per_degree for s, t, c in zip(said, then, counts, strict=True))
    return low, high


def _answer(guard: GuardedArm, question: str) -> float:
    """Return the number that a person answers; meanwhile the arm stays as it is."""
    while True:
        say(question)
        while not select.select([sys.stdin], [], [], 0.0)[0]:
            guard.wait(_TURN)
        line = sys.stdin.readline()
        if not line:
            raise UnusableInput("no answer came; give --angles and --supply instead")
        try:
            value = float(line.replace(",", "."))
        except ValueError:
            value = float("nan")
        if math.isfinite(value):
            return value
        say(f"{line.strip()!r} is not a number.")
