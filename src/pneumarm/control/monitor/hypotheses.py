"""What may be wrong with valves, air and hoses: each a different reading of the same commands.

A fault of a valve is a command that something else is done than was told: a stuck inlet is one that was never opened,
swapped muscles are each other's commands. So every hypothesis maps the commands of all muscles to those that were
carried out, and what predicts the pressures under the commands as told (the healthy arm) predicts them under these.
"""

import math
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import part

LEAKING = 0.015
"""Part of its pressure that a muscle with a large leak loses in a control period."""
HALF_SUPPLY = 0.5
"""Pressure of a low supply [bar gauge]; the other one is gone."""
_WHOLE = math.inf  # the supply of a healthy arm
_NEAR, _BACK = 0.35, 0.35  # bar below the supply in which the flow ceases; part of it that runs back above
_TOLD = (-1.0, 0.0, 1.0)


@dataclass(frozen=True)
class Hypothesis:
    """What may be wrong."""

    kind: str
    """As in :mod:`pneumarm.arm.virtual.faults`, or ``low-supply``."""
    detail: str
    """What it is in words."""
    joint: int | None = None
    """Joint from 1; None where it is about the whole arm."""
    muscle: int | None = None
    """Muscle 1 or 2 of the joint; of swapped muscles the first."""


class Readings(NamedTuple):
    """``n`` hypotheses for ``m`` muscles, joint after joint, as kernels take them."""

    source: NDArray[np.int64]
    """Whose command a muscle follows, shape (n, m)."""
    table: NDArray[np.float64]
    """What is carried out for out, closed, in; shape (n, m, 3)."""
    leak: NDArray[np.float64]
    """Part of its pressure that a muscle loses in a period besides, shape (n, m)."""
    supply: NDArray[np.float64]
    """Pressure of the supply [bar gauge]; inf where it is what it should be, shape (n,)."""


def hypotheses(joints: int) -> tuple[list[Hypothesis], Readings]:
    """Return what may be wrong with the valves of an arm; the first one is that nothing is."""
    muscles = 2 * joints
    found: list[Hypothesis] = []
    sources, tables, leaks, supplies = [], [], [], []

    def add(
        hypothesis: Hypothesis,
        change: dict[int, tuple[float, float, float]] | None = None,
        swap: tuple[int, int] | None = None,
        leaking: int | None = None,
        supply: float = _WHOLE,
    ) -> None:
        source, table, leak = np.arange(muscles), np.tile(_TOLD, (muscles, 1)), np.zeros(muscles)
        for muscle, carried_out in (change or {}).items():
            table[muscle] = carried_out
        if swap is not None:
            source[list(swap)] = swap[::-1]
        if leaking is not None:
            leak[leaking] = LEAKING
        found.append(hypothesis)
        sources.append(source)
        tables.append(table)
        leaks.append(leak)
        supplies.append(supply)

    add(Hypothesis("healthy", "nothing is wrong"))
    add(Hypothesis("low-supply", "the supply is low"), supply=HALF_SUPPLY)
    add(Hypothesis("low-supply", "the supply is gone"), supply=0.0)
    for m in range(muscles):
        joint, muscle = m // 2 + 1, m % 2 + 1
        for detail, carried_out in (
            ("the inlet is stuck closed", (-1.0, 0.0, 0.0)),
            ("the outlet is stuck closed", (0.0, 0.0, 1.0)),
            # With both open the outlet, which is wider, wins.
            ("the inlet is stuck open", (-1.0, 1.0, 1.0)),
            ("the outlet is stuck open", (-1.0, -1.0, -1.0)),
        ):
            add(Hypothesis("stuck-valve", detail, joint, muscle), {m: carried_out})
        add(Hypothesis("swapped-valves", "inlet and outlet are swapped", joint, muscle), {m: (1.0, 0.0, -1.0)})
        add(Hypothesis("leak", "a large leak", joint, muscle), leaking=m)
    for first, second in combinations(range(muscles), 2):
        other = f"the valves are those of joint {second // 2 + 1}, muscle {second % 2 + 1}"
        add(Hypothesis("swapped-muscles", other, first // 2 + 1, first % 2 + 1), swap=(first, second))
    return found, Readings(np.array(sources), np.array(tables), np.array(leaks), np.array(supplies))


@part
def carried_out(readings, h, m, told, bar):  # type: ignore[no-untyped-def]
    """Return what muscle ``m``, at a pressure of ``bar``, does under hypothesis ``h`` when ``told`` a command.

    During a pulse it does what it does when told to open, in the rest of the period what it does when told to close.
    """
    share = abs(told)
    done = share * readings.table[h, m, 2 if told > 0.0 else 0] + (1.0 - share) * readings.table[h, m, 1]
    if done > 0.0 and readings.supply[h] < math.inf:
        done *= supplied(readings.supply[h], bar)
    return done


@part
def supplied(supply, bar):  # type: ignore[no-untyped-def]
    """Return what an open inlet lets in from a low ``supply``, as a part of the usual; negative where air runs back.

    Choked flow falls with the absolute pressure before the valve; a straight line stands for the rest of ISO 6358.
    """
    return 0.5 * (1.0 + supply) * min(max((supply + 0.05 - bar) / _NEAR, -_BACK), 1.0)
