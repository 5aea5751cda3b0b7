"""The cloud of states from which a goal can be reached, found by going back from it (thesis section 4.4).

    the frontier is states at rest at the goal
    repeat: for each state of the frontier and each action that can have led to it, what was before
        keep one state in each cell of a grid in which there is none yet; of these so many, drawn, are the frontier
    to act: of the nearest states in the cloud, the action of the one with the fewest steps left

Differences from the thesis:

1. It counts 9 + 9^2 + ... paths; here each cell of a grid is filled once, by one of the shortest.
2. It means the cloud to teach action values; here the cloud acts itself.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS, CLOSED, VALVES
from pneumarm.settings import NonNegativeFloat, PositiveFloat, PositiveInt, PythonOnly
from pneumarm.simulation.inverse import InverseSimulation, nearest
from pneumarm.task.settings import TaskSettings


@dataclass(frozen=True)
class InverseSettings(TaskSettings):
    """How far back clouds go, and how they are used."""

    depth: PositiveInt = 30
    """Steps back from a goal."""
    width: PositiveInt = 1000
    """States of each step that are kept."""
    cell: Annotated[PositiveFloat, PythonOnly] = 0.1
    """Side of a grid's cell, of which one state is kept [scaled]."""
    resting: Annotated[PositiveInt, PythonOnly] = 50
    """States at rest that a cloud begins with, those recorded nearest to its goal."""
    neighbours: Annotated[PositiveInt, PythonOnly] = 16
    """Nearest states of the cloud that are considered."""
    far: Annotated[NonNegativeFloat, PythonOnly] = 20.0
    """Steps that a distance of 1 [scaled] counts as."""
    hold: Annotated[NonNegativeFloat, PythonOnly] = 4.0
    """Steps that another action than the last one counts as (a switch is paid as 8 actions, which makes it
    hold on for too long where it is wrong about the way)."""


class Cloud(NamedTuple):
    """States on the way to a goal."""

    states: Any
    """k-d tree of scaled observations, shape (n, observation_size)."""
    actions: NDArray[np.int64]
    """What to do there, shape (n,)."""
    steps: NDArray[np.int64]
    """Steps to the goal, shape (n,)."""


def cloud_of(
    inverse: InverseSimulation,
    goal: float,
    resting: NDArray[np.float64],
    settings: InverseSettings,
    random: np.random.Generator,
) -> Cloud:
    """Return the cloud of ``goal`` [counts]; ``resting`` are observations at rest (n, observation_size)."""
    near = np.argsort(np.abs(resting[:, 0] - goal), kind="stable")[: settings.resting]
    frontier = resting[near].copy()
    frontier[:, 0], frontier[:, 1] = goal, 0.0
    states, actions, steps = [inverse.scaled(frontier)], [np.full(len(near), CLOSED)], [np.zeros(len(near), np.int64)]
    filled: set[tuple[int, ...]] = set()
    for step in range(1, settings.depth + 1):
        before, led = _all_before(inverse, frontier)
        kept = _of_new_cells(inverse.scaled(before), filled, settings, random)
        if not kept:
            break
        frontier = before[kept]
        states.append(inverse.scaled(frontier))
        actions.append(led[kept])
        steps.append(np.full(len(kept), step))
    return Cloud(nearest(np.concatenate(states)), np.concatenate(actions), np.concatenate(steps))


def _all_before(
    inverse: InverseSimulation, frontier: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return what can have been before the ``frontier``, and the actions that led on from there."""
    found, led = [frontier[:0]], [np.zeros(0, np.int64)]
    for action in range(ACTIONS):
        valves = VALVES[action].astype(np.float64)
        possible = frontier[inverse.is_possible(frontier, valves)]
        if len(possible):
            found.append(inverse.before(possible, valves))
            led.append(np.full(len(possible), action))
    return np.concatenate(found), np.concatenate(led)


def _of_new_cells(
    scaled: NDArray[np.float64],
    filled: set[tuple[int, ...]],
    settings: InverseSettings,
    random: np.random.Generator,
) -> list[int]:
    """Return which states (n, observation_size) are the first in their cells, drawn; these are ``filled`` then."""
    kept = list[int]()
    cells = np.floor(scaled / settings.cell).astype(np.int64)
    for place in random.permutation(len(cells)).tolist():
        cell = tuple(cells[place].tolist())
        if cell not in filled:
            filled.add(cell)
            kept.append(place)
            if len(kept) == settings.width:
                break
    return kept
