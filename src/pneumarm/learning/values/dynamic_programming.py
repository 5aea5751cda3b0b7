"""Dynamic programming on the simulation cut into cells: the reference for what is learned (section 4.2.3).

    let arms move in the simulation; note their states, and for each action the cell that it leads to and the reward
    repeat for all cells and actions, where the mean is over the states that were noted in a cell:
        Q(cell, a) = mean of r + gamma max_b Q(cell', b)
    until no value changes by more than a little
    let arms move by these values, exploring; note more states; repeat

These are full updates (thesis: "based on the values of all possible successor states"), of a model whose chances are
counted. Sources: Sutton and Barto, Reinforcement Learning, sections 4.4 and 9.3; R. E. Bellman, Dynamic Programming,
1957.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import borrowed, kernel
from pneumarm.learning.online.exploration import greedy
from pneumarm.learning.values.approximators.table import cell_of
from pneumarm.learning.values.learner import weigh
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.learning.values.td import foresee
from pneumarm.learning.values.view import see
from pneumarm.random import integer, uniform
from pneumarm.settings import PositiveFloat, PositiveInt, PythonOnly, Share
from pneumarm.task.environment import begin_episode, take
from pneumarm.task.reward import paid

_HELD = 0.8  # share of the random actions that are the one before: others cancel each other, and the arm stays


@dataclass(frozen=True)
class IterationSettings(ValueSettings):
    """Dynamic programming."""

    rule: Annotated[Literal["dynamic-programming"], PythonOnly] = "dynamic-programming"
    """Its name."""
    approximator: Annotated[Literal["table"], PythonOnly] = "table"
    """Cells are those of a table."""
    agents: Annotated[int, PythonOnly] = 1
    """Two would agree."""
    states: PositiveInt = 100_000
    """States noted in a round."""
    rounds: PositiveInt = 6
    """How often arms move and values are found."""
    random_share: Share = 0.1
    """Share of the actions that are random while states are noted; in the first round all are."""
    tolerance: PositiveFloat = 0.01
    """Largest change of a value with which a round ends, in units of reward."""


class NotedSteps(NamedTuple):
    """What each action led to in each of ``n`` states. Made by :func:`transitions`."""

    cell: NDArray[np.int64]
    """Shape (n,)."""
    next_cell: NDArray[np.int64]
    """Shape (n, choices); -1 where a goal was reached."""
    reward: NDArray[np.float64]
    """Shape (n, choices), without what a switch is paid."""


def part_of(noted: NotedSteps, first: int, last: int) -> NotedSteps:
    """Return the states from ``first`` to before ``last``, sharing their memory."""
    return NotedSteps(noted.cell[first:last], noted.next_cell[first:last], noted.reward[first:last])


def transitions(states: int, choices: int) -> NotedSteps:
    """Return room for so many states."""
    each = states, choices
    return NotedSteps(np.zeros(states, np.int64), np.zeros(each, np.int64), np.zeros(each))


@kernel
def sweep(noted, discount, switch, values, workspace):  # type: ignore[no-untyped-def]
    """Update all ``values`` (choices, cells) by :class:`NotedSteps`; return the largest change.

    The value of a cell that was never noted stays as it is. ``workspace`` has the shape (3, choices, cells).
    """
    sums, counts, ahead = workspace
    sums[:], counts[:] = 0.0, 0.0
    choices = values.shape[0]
    for cell in range(values.shape[1]):
        highest = values[greedy(values[:, cell]), cell] + switch
        for action in range(choices):
            ahead[action, cell] = max(highest, values[action, cell])
    for s in range(noted.cell.shape[0]):
        for action in range(choices):
            next_cell, target = noted.next_cell[s, action], noted.reward[s, action]
            if next_cell >= 0:
                target += discount * ahead[action, next_cell]
            sums[action, noted.cell[s]] += target
            counts[action, noted.cell[s]] += 1.0
    largest = 0.0
    for action in range(choices):
        for cell in range(values.shape[1]):
            if counts[action, cell] > 0.0:
                mean = np.float32(sums[action, cell] / counts[action, cell])
                largest = max(largest, abs(mean - values[action, cell]))
                values[action, cell] = mean
    return largest


@kernel
def note_state(learner, joint, x, before, z, noted, s):  # type: ignore[no-untyped-def]
    """Write the cell of the state ``x``, and what each action of ``joint`` leads to from there, as state ``s``."""
    model, cells = learner.model, learner.values.coding.cells
    see(learner.variables, joint, x, z)
    noted.cell[s] = cell_of(cells, z)
    for action in range(noted.reward.shape[1]):
        is_reached = foresee(model, x, before, joint, action)
        noted.reward[s, action] = paid(model.environment.task.reward, is_reached, 0)
        see(learner.variables, joint, model.episode.state.x, z)
        noted.next_cell[s, action] = -1 if is_reached else cell_of(cells, z)


@kernel
def note_states(environment, learner, episode, memory, random_share, joint, noted):  # type: ignore[no-untyped-def]
    """Fill ``noted`` with states of ``joint`` while arms move by the values or at random; return the episodes."""
    environment, learner, episode = borrowed(environment), borrowed(learner), borrowed(episode)
    memory, noted = borrowed(memory), borrowed(noted)
    x, random, before = episode.state.x, episode.state.random, episode.actions
    episodes, taken = 0, environment.task.cutoff
    for s in range(noted.cell.shape[0]):
        if taken >= environment.task.cutoff:
            begin_episode(environment, episode, np.inf, random)
            episodes, taken = episodes + 1, 0
        note_state(learner, joint, x, before, memory.z, noted, s)
        for agent in range(before.shape[0]):
            weigh(learner, agent, x, before, memory.z, memory.values)
            memory.chosen[agent] = greedy(memory.values)
            if uniform(random) < random_share:
                is_held = before[agent] >= 0 and uniform(random) < _HELD
                memory.chosen[agent] = before[agent] if is_held else integer(random, memory.values.shape[0])
        is_reached = take(environment, episode, memory.chosen)
        taken = environment.task.cutoff if is_reached else taken + 1
    return episodes
