"""Movements made better command by command, on any world that can be rolled out: what settling and tracking allow.

A plan is a command for every control period. A change of a few commands next to each other is tried, with the world
rolled out from there for as long as it matters; the best of many replaces what was there. So the cost falls until
nothing that is tried is better: random local search (J. C. Spall, Introduction to Stochastic Search and Optimization,
2003, chapter 2). What comes out can be achieved; that nothing better can is likely, not proven.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.planning.world import advance, copy
from pneumarm.task.price import PriceParameters

Array = NDArray[np.float64]

_MATTERS = 0.8  # s after a change for which the world is rolled out
_WIDTH = 2 / 15  # s; commands of so long that are next to each other are changed together at most
_TRIED = 48  # changes at a place, before the next place
_SIZES = 0.1, 0.5  # standard deviations of small changes and of large ones, in periods
_CLOSED = 0.2  # share of changes in which a valve is closed, or open all along, instead


class Wanted(NamedTuple):
    """What is asked of a movement."""

    reference: Array
    """Shape (steps, joints): the angles wanted after each command [counts]."""
    tolerance: Array
    """Shape (joints,) [counts]."""
    prices: PriceParameters
    """Of errors in tolerances; valves are free."""
    shortest: float
    """Shortest pulse [periods]."""
    period: float
    """Control period [s]."""


@inner
def cost_of_reading(wanted, angle, step):  # type: ignore[no-untyped-def]
    """Return what the ``angle`` (joints,) after the command ``step`` costs, in the prices that a servo learns by."""
    total = 0.0
    for j in range(angle.shape[0]):
        size = abs(angle[j] - wanted.reference[step, j]) / wanted.tolerance[j]
        beyond = max(size - wanted.prices.flat, 0.0) / wanted.prices.precision
        total += 0.5 * np.log(1.0 + beyond * beyond) + wanted.prices.far * size
    return total


@inner
def play(world, states, wanted, plan, first, last, place, limit, command):  # type: ignore[no-untyped-def]
    """Play ``plan`` (steps, joints, 2) from ``first`` to before ``last`` in the state ``place``; return the cost.

    Stops where that is ``limit`` or more. ``command`` (joints, 2) is workspace.
    """
    total = 0.0
    for step in range(first, last):
        for j in range(command.shape[0]):
            for m in range(2):
                share = plan[step, j, m]
                if share > 0.0 and states.pressure[place, j, m] > world.limit:  # as the guard does
                    share = 0.0
                command[j, m] = share
        advance(world, states, place, command)
        total += cost_of_reading(wanted, states.angle[place], step)
        if total >= limit:
            break
    return total


@kernel
def keep_states(world, states, wanted, plan, first, command):  # type: ignore[no-untyped-def]
    """Put the states after each command from ``first`` on into their places 1 to steps; place 0 is the begin."""
    for step in range(first, plan.shape[0]):
        copy(states, step + 1, step)
        play(world, states, wanted, plan, step, step + 1, step + 1, np.inf, command)


@kernel
def best_change(world, states, wanted, plan, first, changes, command):  # type: ignore[no-untyped-def]
    """Put the best of ``changes`` (n, width, joints, 2) into ``plan`` from ``first`` on; return what it gains.

    The last place of ``states`` is workspace.
    """
    scratch = states.angle.shape[0] - 1
    last = min(first + changes.shape[1] + round(_MATTERS / wanted.period), plan.shape[0])
    copy(states, scratch, first)
    before = play(world, states, wanted, plan, first, last, scratch, np.inf, command)
    least, best, width = before, -1, min(changes.shape[1], plan.shape[0] - first)
    kept = plan[first : first + width].copy()
    for number in range(changes.shape[0]):
        for step in range(width):
            plan[first + step] = changes[number, step]
        copy(states, scratch, first)
        cost = play(world, states, wanted, plan, first, last, scratch, least, command)
        if cost < least:
            least, best = cost, number
    for step in range(width):
        plan[first + step] = kept[step] if best < 0 else changes[best, step]
    if best >= 0:
        keep_states(world, states, wanted, plan, first, command)
    return before - least


def refined(world: Any, states: Any, wanted: Wanted, plan: Array, sweeps: int, random: np.random.Generator) -> Array:
    """Return ``plan`` (steps, joints, 2) made better in ``sweeps`` from its begin to its end.

    ``states`` of ``world`` need steps + 2 places; the first holds where the movement begins. Afterwards places 1 to
    steps hold the movement.
    """
    plan, command = plan.copy(), np.zeros(plan.shape[1:])
    widest = max(round(_WIDTH / wanted.period), 1)
    keep_states(world, states, wanted, plan, 0, command)
    for _ in range(sweeps):
        for first in range(len(plan)):
            width = int(random.integers(1, widest + 1))
            changes = _changes(plan[first : first + width], wanted.shortest, random)
            best_change(world, states, wanted, plan, first, changes, command)
    return plan


def _changes(commands: Array, shortest: float, random: np.random.Generator) -> Array:
    """Return changes (n, width, joints, 2) of ``commands`` (width, joints, 2), as valves can make them."""
    shape = (_TRIED, *commands.shape)
    sizes = np.where(random.random((_TRIED, 1, 1, 1)) < 0.5, *_SIZES)
    drawn = commands + sizes * random.standard_normal(shape)
    drawn = np.where(random.random(shape) < _CLOSED, random.choice([-1.0, 0.0, 0.0, 1.0], shape), drawn)
    size = np.minimum(np.abs(drawn), 1.0)
    size = np.where(size < shortest / 2, 0.0, np.where(size > 1 - shortest / 2, 1.0, np.maximum(size, shortest)))
    made: Array = np.sign(drawn) * size
    return made
