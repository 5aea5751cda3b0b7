"""The best plan: valve sequences with few switches, cheapest first, on any world that can be rolled out.

Every action costs, and every switch costs more (thesis eq. 4.2, section 5.4.1), so the plan of the highest reward is
the shortest path to the goal, found by uniform-cost search (Dijkstra):

    take the cheapest entry from the queue
        repeat the last action for one period                                 (cost of an action)
        or switch one joint to each of its other actions                      (cost of an action and of a switch)
        or switch two joints, three ...
    until an entry costs as much as the best plan that reached the goal

A node is simulated once, from its parent's state, so that plans with the same beginning share it; switches from a
node wait in the queue until they are due, by the number of joints, as one entry and one copy of its state. Where a
search ends for want of room, no plan of at most ``switches`` switches costs less than the cheapest entry left.

Where it is known how fast joints are, entries also cost what the rest of the way takes at least (A*; with a guess in
place of a bound, what is found may cost a little more than the best). A second search without that guess, for what
is cheaper, tells by how much at most.

Only what the guard would let through is planned: an action with an inlet into a muscle that reads over its limit is
not taken. So what is planned is what is applied, and switches are counted as they are on an arm.
"""

import heapq
import math
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS, VALVES, possible_actions
from pneumarm.errors import UnusableInput
from pneumarm.kernels import borrowed, kernel, part
from pneumarm.planning.world import advance, copy
from pneumarm.settings import NonNegativeFloat, NonNegativeInt, PositiveInt, Settings
from pneumarm.task.reward import Reward

_UNLIKELY = 0.05
"""A plan that is less likely to succeed is none."""


@dataclass(frozen=True)
class PlanSettings(Settings):
    """Which plans are considered, and how long they are sought."""

    switches: NonNegativeInt = 3
    """Most switches of a plan, the first action being none."""
    cutoff: PositiveInt = 100
    """Most actions of a plan (thesis section 5.4.2: 100)."""
    nodes: PositiveInt = 100_000
    """Most states kept at a time; when they do not suffice, the best plan is not proven to be so."""
    failure_cost: NonNegativeFloat = 12.0
    """What it costs to miss the goal at the end of a plan and to plan again, in units of reward; where the model is
    uncertain, plans end where the odds are better."""


class Uncertainty(NamedTuple):
    """Standard deviation of what is read at the end of a plan from what was planned."""

    angle: float
    """[counts]"""
    velocity: float
    """[counts/ms]"""


CERTAIN = Uncertainty(0.0, 0.0)


class Agility(NamedTuple):
    """How fast joints can be, by which a search knows how long the rest of a plan takes at least."""

    speed: NDArray[np.float64]
    """At which joints move at most, shape (joints,) [counts a period]; infinite where that is unknown."""
    acceleration: NDArray[np.float64]
    """Likewise, shape (joints,) [counts a period, a period]."""
    period: float
    """[ms]"""


def unknown_agility(joints: int) -> Agility:
    """Return that nothing is known of how fast so many ``joints`` are."""
    return Agility(np.full(joints, math.inf), np.full(joints, math.inf), 1.0)


class PlanProblem(NamedTuple):
    """What is sought. Made by :func:`problem`."""

    commands: NDArray[np.int8]
    """Valves by action of the whole arm, shape (9**joints, joints, 2); 3**joints of one with one muscle a joint."""
    switched: NDArray[np.int64]
    """Joints that switch between two actions, shape (9**joints + 1, 9**joints); none from the last row: the begin."""
    goal: NDArray[np.float64]
    """Shape (joints,) [counts]."""
    angle_tolerance: float
    """[counts]"""
    velocity_tolerance: float
    """[counts/ms]"""
    angle_std: float
    """[counts]"""
    velocity_std: float
    """[counts/ms]"""
    agility: Agility
    failure_cost: float
    action_cost: float
    switch_cost: float
    switches: int
    cutoff: int


class Tree(NamedTuple):
    """Workspace for a search. Made by :func:`tree`."""

    depth: NDArray[np.int64]
    """Actions to each node, shape (nodes,)."""
    switches: NDArray[np.int64]
    """Switches to each node, shape (nodes,)."""
    ahead: NDArray[np.float64]
    """Periods that at least are needed from each node to the goal, shape (nodes,)."""
    cost: NDArray[np.float64]
    """Shape (nodes,)."""
    held: NDArray[np.int64]
    """What was done from which step on, shape (nodes, holds, 2): action, first step."""
    holds: NDArray[np.int64]
    """How many of these there are, shape (nodes,)."""
    free: NDArray[np.int64]
    """Nodes that are not used, shape (nodes,)."""
    plan: NDArray[np.int64]
    """The plan that was found, shape (cutoff,)."""


class Plan(NamedTuple):
    """What a search found."""

    actions: NDArray[np.int64]
    """Actions of the whole arm, one a period; where the goal cannot be reached, those that lead nearest to it."""
    cost: float
    """Cost of the actions and switches, infinite where the goal is not reached."""
    reached: bool
    least: float
    """No plan within the settings costs less; 0 where a guess of the rest of the way was all there was."""
    simulated: int
    """Control periods that were simulated."""

    @property
    def proven(self) -> bool:
        """Whether no plan within the settings is cheaper."""
        return self.least >= self.cost


def problem(
    goal: NDArray[np.float64],
    reward: Reward,
    settings: PlanSettings,
    uncertainty: Uncertainty = CERTAIN,
    muscles: int = 2,
    agility: Agility | None = None,
) -> PlanProblem:
    """Return the problem of moving to ``goal`` (joints,) [counts] for ``reward``, with so many ``muscles`` a joint.

    Raises:
        UnusableInput: an action or a switch is rewarded.

    """
    if reward.action >= 0 or reward.switch > 0:
        raise UnusableInput("planning needs actions that cost something and switches that are not rewarded")
    actions = np.array(list(product(np.flatnonzero(possible_actions(muscles)), repeat=len(goal))))
    switched = (actions[:, None] != actions[None]).sum(axis=2)
    begin = np.zeros((1, len(actions)), np.int64)
    return PlanProblem(
        commands=np.ascontiguousarray(VALVES[actions]),
        switched=np.concatenate([switched, begin]),
        goal=np.array(goal, np.float64),
        angle_tolerance=float(reward.angle_tolerance),
        velocity_tolerance=float(reward.velocity_tolerance),
        angle_std=uncertainty.angle,
        velocity_std=uncertainty.velocity,
        agility=agility or unknown_agility(len(goal)),
        failure_cost=float(settings.failure_cost),
        action_cost=-float(reward.action),
        switch_cost=-float(reward.switch),
        switches=settings.switches,
        cutoff=settings.cutoff,
    )


def tree(settings: PlanSettings, joints: int) -> Tree:
    """Return workspace for searches; ``settings.nodes`` and one expansion more."""
    n, holds = workspace_of(settings, joints), settings.switches + 2
    return Tree(
        depth=np.empty(n, np.int64),
        switches=np.empty(n, np.int64),
        ahead=np.empty(n),
        cost=np.empty(n),
        held=np.empty((n, holds, 2), np.int64),
        holds=np.empty(n, np.int64),
        free=np.empty(n, np.int64),
        plan=np.empty(settings.cutoff, np.int64),
    )


def halved(workspace: Tree, actions: int) -> Tree:
    """Return ``workspace`` with half of its states, enough to try each of the ``actions`` of the arm once."""
    return workspace._replace(free=workspace.free[: max(len(workspace.free) // 2, actions + 1)])


def workspace_of(settings: PlanSettings, joints: int) -> int:
    """Return how many states a search needs workspace for."""
    return settings.nodes + int(ACTIONS**joints) + 1


def find(
    world: Any,
    states: Any,
    sought: PlanProblem,
    workspace: Tree,
    last: int = -1,
    may_hold: bool = True,
    known: Plan | None = None,
) -> Plan:
    """Return the best plan from state 0 of ``states``, after the action ``last`` (-1 at the begin of a movement).

    Unless it ``may_hold``, the plan begins with another action than ``last``. Where a plan is ``known``, it is
    returned unless a cheaper one is found, with what all plans cost at least.
    """
    begin = len(sought.commands) if last < 0 else last
    most = known.cost if known is not None else math.inf
    length, cost, least, simulated = search(world, states, sought, workspace, begin, may_hold, most)
    if np.isfinite(sought.agility.speed).any():  # a guess
        least = 0.0
    if known is not None and (length == 0 or not cost < most):
        return known._replace(least=max(least, known.least), simulated=known.simulated + simulated)
    return Plan(workspace.plan[:length].copy(), cost, math.isfinite(cost), least, simulated)


@part
def permitted(world, states, i, sought, action):  # type: ignore[no-untyped-def]
    """Return whether the guard would set the valves of ``action`` as they are in state ``i``."""
    for j in range(sought.commands.shape[1]):
        for m in range(2):
            if sought.commands[action, j, m] > 0 and states.pressure[i, j, m] > world.limit:
                return False
    return True


@part
def misses(states, i, sought):  # type: ignore[no-untyped-def]
    """Return by how much state ``i`` misses the goal, in tolerances; 1 or less is success (thesis eq. 5.1, 5.2)."""
    worst = 0.0
    for j in range(sought.goal.shape[0]):
        worst = max(worst, abs(states.angle[i, j] - sought.goal[j]) / sought.angle_tolerance)
        worst = max(worst, abs(states.velocity[i, j]) / sought.velocity_tolerance)
    return worst


@part
def within(value, tolerance, std):  # type: ignore[no-untyped-def]
    """Return the probability that a normal deviate around ``value`` is not farther from 0 than ``tolerance``."""
    if std == 0.0:
        return 1.0 if abs(value) <= tolerance else 0.0
    scale = 1.0 / (math.sqrt(2.0) * std)
    return 0.5 * (math.erf((tolerance - value) * scale) + math.erf((tolerance + value) * scale))


@part
def success(states, i, sought):  # type: ignore[no-untyped-def]
    """Return the probability that the goal is reached in state ``i``."""
    probability = 1.0
    for j in range(sought.goal.shape[0]):
        away = states.angle[i, j] - sought.goal[j]
        probability *= within(away, sought.angle_tolerance, sought.angle_std)
        probability *= within(states.velocity[i, j], sought.velocity_tolerance, sought.velocity_std)
    return probability


@part
def fewest_periods(way, speed, slow, fastest, sharpest):  # type: ignore[no-untyped-def]
    """Return a lower bound of the periods in which a joint gets to its goal and slow.

    It goes at full acceleration, at full speed, and at full deceleration; a period less, as speeds are means over
    periods.

    Args:
        way: to the goal, without the tolerance [counts].
        speed: towards the goal [counts a period].
        slow: speed at which it may arrive.
        fastest: highest speed.
        sharpest: highest acceleration [counts a period, a period].

    """
    if math.isinf(fastest):
        return 0.0
    if way <= 0.0:
        needed = (abs(speed) - slow) / sharpest
    else:
        peak = math.sqrt(max(sharpest * way + 0.5 * (speed * speed + slow * slow), 0.0))
        if speed > peak or slow > peak:
            needed = max((speed - slow) / sharpest, way / max(fastest, speed))
        elif peak <= fastest:
            needed = (2.0 * peak - speed - slow) / sharpest
        else:
            while_changing = (2.0 * fastest * fastest - speed * speed - slow * slow) / (2.0 * sharpest)
            needed = (2.0 * fastest - speed - slow) / sharpest + (way - while_changing) / fastest
    return max(math.ceil(needed) - 1.0, 0.0)


@part
def at_least(states, i, sought):  # type: ignore[no-untyped-def]
    """Return a lower bound of the periods from state ``i`` to the goal."""
    agility, most = sought.agility, 0.0
    for j in range(sought.goal.shape[0]):
        off = sought.goal[j] - states.angle[i, j]
        towards = states.velocity[i, j] * agility.period * (1.0 if off > 0.0 else -1.0)
        way, slow = abs(off) - sought.angle_tolerance, sought.velocity_tolerance * agility.period
        most = max(most, fewest_periods(way, towards, slow, agility.speed[j], agility.acceleration[j]))
    return most


@part
def last_action(workspace, i):  # type: ignore[no-untyped-def]
    """Return the action that led to node ``i``."""
    return workspace.held[i, workspace.holds[i] - 1, 0]


@part
def begin_node(states, sought, workspace, i, parent, action):  # type: ignore[no-untyped-def]
    """Make node ``i`` that of ``action`` after ``parent``, which may be the same, in the state before the action."""
    if i != parent:
        copy(states, i, parent)
        for k in range(workspace.holds[parent]):
            workspace.held[i, k, 0], workspace.held[i, k, 1] = (
                workspace.held[parent, k, 0],
                workspace.held[parent, k, 1],
            )
        workspace.holds[i] = workspace.holds[parent]
    before = last_action(workspace, parent)
    switched = sought.switched[before, action]
    if action != before:
        workspace.held[i, workspace.holds[i], 0], workspace.held[i, workspace.holds[i], 1] = (
            action,
            workspace.depth[parent],
        )
        workspace.holds[i] += 1
    workspace.depth[i] = workspace.depth[parent] + 1
    workspace.switches[i] = workspace.switches[parent] + switched
    workspace.cost[i] = workspace.cost[parent] + sought.action_cost + sought.switch_cost * switched


@part
def due(sought, workspace, i, changed):  # type: ignore[no-untyped-def]
    """Return what a plan costs at least that goes on from node ``i`` with switches of so many joints."""
    periods = max(workspace.ahead[i], 1.0)
    return workspace.cost[i] + sought.action_cost * periods + sought.switch_cost * changed


@part
def write_plan(workspace, i):  # type: ignore[no-untyped-def]
    """Write the actions that led to node ``i`` into the plan; return how many they are."""
    for k in range(1, workspace.holds[i]):
        end = workspace.held[i, k + 1, 1] if k + 1 < workspace.holds[i] else workspace.depth[i]
        for n in range(workspace.held[i, k, 1], end):
            workspace.plan[n] = workspace.held[i, k, 0]
    # The first hold is what was done before the plan; it goes on until the first switch.
    end = workspace.held[i, 1, 1] if workspace.holds[i] > 1 else workspace.depth[i]
    for n in range(end):
        workspace.plan[n] = workspace.held[i, 0, 0]
    return workspace.depth[i]


@kernel
def search(world, states, sought, workspace, begin, may_hold, most):  # type: ignore[no-untyped-def]
    """Seek the best plan from state 0 after the action ``begin``, which goes on only if it ``may_hold``.

    Returns the length of the plan in ``workspace.plan``, its cost, what all plans cost at least, and the periods
    simulated. Plans that cost at least ``most`` are none.
    """
    world, states, sought, workspace = borrowed((world, states, sought, workspace))
    count = workspace.free.shape[0]
    actions = sought.commands.shape[0]
    for k in range(count):
        workspace.free[k] = count - 1 - k
    left = count - 1  # node 0 is the begin, and stays as it is
    workspace.depth[0], workspace.switches[0], workspace.cost[0], workspace.holds[0] = 0, 0, 0.0, 1
    workspace.held[0, 0, 0], workspace.held[0, 0, 1] = begin, 0
    # Entries are cost, a number that settles ties, and which children of which node are due: those that `changed`
    # joints switch to. An entry costs as much as these children.
    kinds = sought.goal.shape[0] + 1
    changed = 0 if may_hold or begin == actions else 1
    workspace.ahead[0] = at_least(states, 0, sought)
    queue = [(due(sought, workspace, 0, changed), 0, changed)]
    order, simulated, length, best, nearest = 1, 0, 0, most, math.inf
    least = math.inf
    while len(queue) > 0:
        cost, _, entry = heapq.heappop(queue)
        if cost >= best:
            break
        if left < actions:
            least = cost
            break
        i, changed = entry // kinds, entry % kinds
        before = last_action(workspace, i)
        goes_on = changed + 1 < kinds and workspace.switches[i] + changed < sought.switches and before < actions
        if goes_on:
            heapq.heappush(queue, (due(sought, workspace, i, changed + 1), order, entry + 1))
            order += 1
        for action in range(actions):
            if sought.switched[before, action] != changed or not permitted(world, states, i, sought, action):
                continue
            left -= 1
            child = workspace.free[left]
            begin_node(states, sought, workspace, child, i, action)
            advance(world, states, child, sought.commands[action])
            miss = misses(states, child, sought)
            simulated += 1
            probability = success(states, child, sought)
            expected = workspace.cost[child] + sought.failure_cost * (1.0 - probability)
            if probability > _UNLIKELY and expected < best:
                best = expected
                length = write_plan(workspace, child)
            elif best == math.inf and miss < nearest:
                nearest = miss
                length = write_plan(workspace, child)
            if expected <= workspace.cost[child] or workspace.depth[child] == sought.cutoff:
                workspace.free[left] = child
                left += 1
            else:
                workspace.ahead[child] = at_least(states, child, sought)
                child_cost = due(sought, workspace, child, 0)
                if child_cost < best:
                    heapq.heappush(queue, (child_cost, order, kinds * child))
                    order += 1
                else:
                    workspace.free[left] = child
                    left += 1
        if not goes_on and i > 0:
            workspace.free[left] = i
            left += 1
    return length, best, min(least, best), simulated
