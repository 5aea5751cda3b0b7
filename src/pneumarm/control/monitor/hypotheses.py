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

LEAKING = 0.45
"""Rate at which a muscle with a large leak loses its pressure [1/s]."""
TORN, OFF = 1.5, 4.0
"""... whose hose is torn, and whose hose is off [1/s]: much like one whose outlet is stuck open."""
DRAINS = "the outlet is stuck open, or the hose is off"
"""What is wrong with a muscle that loses its air as fast as it can."""
HALF_SUPPLY = 0.5
"""A low supply as a part of the usual one; the other one is gone."""
_WHOLE = math.inf  # the supply of a healthy arm
_NEAR, _BACK = 0.35, 0.35  # of the usual supply, over which the flow ceases; part of it that runs back above
_NEVER, _ALWAYS = (0, 0, 0), (1, 1, 1)
_FILLING, _EMPTYING = (0, 0, 1), (1, 0, 0)
_TOLD = (_FILLING, _EMPTYING)  # inlet and outlet: whether each is open when told to empty, to close, to fill


@dataclass(frozen=True)
class Hypothesis:
    """What may be wrong."""

    kind: str
    """As in :mod:`pneumarm.arm.virtual.faults`, or ``low-supply`` or ``torn-hose``."""
    detail: str
    """What it is in words. Hypotheses that cannot be told apart have all of this in common."""
    joint: int | None = None
    """Joint from 1; None where it is about the whole arm."""
    muscle: int | None = None
    """Muscle 1 or 2 of the joint; of swapped muscles the first."""


class Readings(NamedTuple):
    """``n`` hypotheses for ``m`` muscles, joint after joint, as kernels take them."""

    source: NDArray[np.int64]
    """Whose command a muscle follows, shape (n, m)."""
    open: NDArray[np.int64]
    """Whether inlet and outlet are open when told to empty, to close, to fill; shape (n, m, 2, 3)."""
    leak: NDArray[np.float64]
    """Rate at which a muscle loses its pressure besides, shape (n, m) [1/s]."""
    supply: NDArray[np.float64]
    """Pressure of the supply as a part of the usual; inf where it is what it should be, shape (n,)."""
    as_told: NDArray[np.bool_]
    """Whether a muscle takes and gives air as it is told, shape (n, m)."""

    def first(self, n: int) -> "Readings":
        """Return the first ``n``."""
        return Readings(self.source[:n], self.open[:n], self.leak[:n], self.supply[:n], self.as_told[:n])


def hypotheses(joints: int, of_each: int = 2) -> tuple[list[Hypothesis], Readings]:
    """Return what may be wrong with the valves of an arm; the first one is that nothing is.

    ``of_each`` joint so many muscles are there, of which something may be wrong.
    """
    muscles = 2 * joints
    there = [m for m in range(muscles) if m % 2 < of_each]
    found: list[Hypothesis] = []
    sources, opens, leaks, supplies = [], [], [], []

    def add(
        hypothesis: Hypothesis,
        change: tuple[int, tuple[tuple[int, int, int], tuple[int, int, int]]] | None = None,
        swap: tuple[int, int] | None = None,
        leaking: tuple[int, float] | None = None,
        supply: float = _WHOLE,
    ) -> None:
        source, valves, leak = np.arange(muscles), np.tile(_TOLD, (muscles, 1, 1)), np.zeros(muscles)
        if change is not None:
            valves[change[0]] = change[1]
        if swap is not None:
            source[list(swap)] = swap[::-1]
        if leaking is not None:
            leak[leaking[0]] = leaking[1]
        found.append(hypothesis)
        sources.append(source)
        opens.append(valves)
        leaks.append(leak)
        supplies.append(supply)

    add(Hypothesis("healthy", "nothing is wrong"))
    add(Hypothesis("low-supply", "the supply is low"), supply=HALF_SUPPLY)
    add(Hypothesis("low-supply", "the supply is gone"), supply=0.0)
    for m in there:
        joint, muscle = m // 2 + 1, m % 2 + 1
        for detail, inlet, outlet in (
            ("the inlet is stuck closed", _NEVER, _EMPTYING),
            ("the outlet is stuck closed", _FILLING, _NEVER),
            ("the inlet is stuck open", _ALWAYS, _EMPTYING),
            (DRAINS, _FILLING, _ALWAYS),
        ):
            add(Hypothesis("stuck-valve", detail, joint, muscle), (m, (inlet, outlet)))
        add(Hypothesis("swapped-valves", "inlet and outlet are swapped", joint, muscle), (m, _TOLD[::-1]))
        add(Hypothesis("leak", "a large leak", joint, muscle), leaking=(m, LEAKING))
        torn = "it loses its air, as if its hose were torn"
        add(Hypothesis("torn-hose", torn, joint, muscle), leaking=(m, TORN))
        add(Hypothesis("stuck-valve", DRAINS, joint, muscle), leaking=(m, OFF))  # called as that outlet is
    for first, second in combinations(there, 2):
        other = f"the valves are those of joint {second // 2 + 1}, muscle {second % 2 + 1}"
        add(Hypothesis("swapped-muscles", other, first // 2 + 1, first % 2 + 1), swap=(first, second))
    source, valves, leak, low = map(np.array, (sources, opens, leaks, supplies))
    as_told = (source == np.arange(muscles)) & (valves == _TOLD).all(axis=(2, 3)) & np.isinf(low)[:, None]
    return found, Readings(source, valves, leak, low, as_told)


@part
def leaked(rate, seconds, pressure, lowest, healthy):  # type: ignore[no-untyped-def]
    """Return what follows ``pressure`` if a muscle loses it at a ``rate`` [1/s], and otherwise ``healthy`` did."""
    lost = (1.0 - math.exp(-rate * seconds)) * max(0.0, pressure - lowest)
    return max(healthy - lost, min(healthy, lowest))


@part
def has_torn_hose(readings, h):  # type: ignore[no-untyped-def]
    """Return whether under hypothesis ``h`` a hose is torn or off."""
    torn = False
    for m in range(readings.leak.shape[1]):
        torn = torn or readings.leak[h, m] >= TORN
    return torn


@part
def carried_out(readings, h, m, told, level, both):  # type: ignore[no-untyped-def]
    """Return what muscle ``m`` at a ``level`` of the usual supply does under hypothesis ``h`` if ``told`` a command.

    During a pulse it does what it does when told to open, in the rest of the period what it does when told to close.
    While both of its valves are open it does ``both``.
    """
    share = abs(told)
    opened = position(readings, h, m, 2 if told > 0.0 else 0, both)
    done = share * opened + (1.0 - share) * position(readings, h, m, 1, both)
    if done > 0.0 and readings.supply[h] < math.inf:
        done *= supplied(readings.supply[h], level)
    return done


@part
def position(readings, h, m, told, both):  # type: ignore[no-untyped-def]
    """Return as a command what the valves of muscle ``m`` do when ``told`` to empty, to close, to fill (0, 1, 2).

    No command says that both are open: that is ``both``.
    """
    inlet, outlet = readings.open[h, m, 0, told], readings.open[h, m, 1, told]
    return both if inlet and outlet else -1.0 if outlet else 1.0 if inlet else 0.0


@part
def at_once(readings, h, m, told):  # type: ignore[no-untyped-def]
    """Return whether both valves of muscle ``m`` are open at once under hypothesis ``h`` if ``told`` a command."""
    valves, state = readings.open[h, m], 2 if told > 0.0 else 0
    opened = told != 0.0 and valves[0, state] and valves[1, state]
    return opened or (abs(told) < 1.0 and valves[0, 1] and valves[1, 1])


@part
def supplied(supply, level):  # type: ignore[no-untyped-def]
    """Return what an open inlet lets in from a low ``supply``, as a part of the usual; negative where air runs back.

    Supply and the ``level`` of the muscle's pressure are parts of the usual supply, which is taken to be about 1 bar:
    choked flow falls with the absolute pressure before the valve; a straight line stands for the rest of ISO 6358.
    """
    return 0.5 * (1.0 + supply) * choked_share(supply, level)


@part
def reduced(supply, level):  # type: ignore[no-untyped-def]
    """Return the same of a supply that has its ups and downs, of which a low one is to differ clearly."""
    return max(supply, 0.15) * choked_share(supply, level)


@part
def choked_share(supply, level):  # type: ignore[no-untyped-def]
    """Return how much of the choked flow from ``supply`` is left at a ``level``; negative where air runs back."""
    return min(max((supply + 0.05 - level) / _NEAR, -_BACK), 1.0)


@part
def time_open(readings, h, m, valve, told_in, told_out):  # type: ignore[no-untyped-def]
    """Return for which part of a time the inlet (0) or the outlet (1) of muscle ``m`` is open under hypothesis ``h``.

    It was told to fill for ``told_in`` of the time and to empty for ``told_out``.
    """
    states = readings.open[h, m, valve]
    return told_out * states[0] + max(0.0, 1.0 - told_in - told_out) * states[1] + told_in * states[2]


@part
def times_opened(readings, h, m, valve, fills, empties):  # type: ignore[no-untyped-def]
    """Return how often the inlet (0) or the outlet (1) of muscle ``m`` opened under hypothesis ``h``.

    It was told so many times to begin to fill and to empty.
    """
    states = readings.open[h, m, valve]
    return 0.0 if states[1] else fills * states[2] + empties * states[0]


@part
def independence(square, product):  # type: ignore[no-untyped-def]
    """Return how much an error says that the ones before it have not: 1 where errors do not last.

    ``square`` is the mean square of errors, ``product`` the mean product of one with the one before.
    """
    correlation = min(max(product / square, 0.0), 0.9)
    return (1.0 - correlation) / (1.0 + correlation)
