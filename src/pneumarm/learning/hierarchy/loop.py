"""Two levels of agents: the upper one sets each joint a subgoal, the lower ones hold the valves (section 6.2).

    the upper agent chooses, in (angles, goals), the subgoals  g' = angle + way (goal - angle)
    repeat: lower agents act for g'; each learns by SARSA with g' in the place of its goal
    until all are at g' or ``period`` actions are over; then
        Q(s, g') of the upper agent moves towards  R + gamma^k Q(s', g'')

R is what all joints together earned in these k actions, each discounted. A lower agent is paid for reaching its
subgoal, what follows being worth nothing to it, and besides where the goal of all joints is reached. Both levels are
the action values of :mod:`pneumarm.learning.online`, and explore alike.

Sources: J. Morimoto and K. Doya, "Acquisition of stand-up behavior by a real robot using hierarchical reinforcement
learning", Robotics and Autonomous Systems 36, 2001 (the thesis' [15]), for subgoals in angles and an upper state of
low dimension; R. S. Sutton, D. Precup and S. Singh, "Between MDPs and semi-MDPs", Artificial Intelligence 112, 1999,
for the upper agent's update.

Differences from the first of them: the upper agent learns by SARSA in networks, and its subgoals lie on the way to
the goal.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.kernels import kernel, part
from pneumarm.learning.hierarchy.settings import HierarchySettings
from pneumarm.learning.online.loop import Workspace, decide, learn, look_ahead, loop_workspace, remember
from pneumarm.learning.online.values import ActionValues, forget_traces, learner, td_target, update
from pneumarm.simulation.kernel import UNIT_BLOCK
from pneumarm.simulation.layout import INPUT_BLOCK, Layout, angle_at, layout_of, padded, velocity_at
from pneumarm.simulation.simulation import Scaling
from pneumarm.task.environment import begin_episode, take
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end
from pneumarm.task.reward import RewardParameters, has_reached, paid
from pneumarm.transitions.window import Window
from pneumarm.vectors import LANES

_TAKEN, _GAINED, _DISCOUNT = 0, 1, 2


class Hierarchy(NamedTuple):
    """Both levels, and what is theirs to know. Made by :func:`hierarchy`."""

    upper: ActionValues
    lower: ActionValues
    """What it is paid for a goal is for a subgoal."""
    ways: NDArray[np.float64]
    """Shape (m,); the upper agent chooses among m^joints."""
    period: int
    reward: RewardParameters
    """Reward of the task."""
    unit: NDArray[np.float64]
    """Offset and scale of angle and velocity, shape (joints, 4): angle, angle, velocity, velocity."""
    layout: Layout
    """Of the state vector."""
    is_whole: bool
    """Whether the upper agent sees all of it."""


class LevelMemory(NamedTuple):
    """What both levels remember within an episode. Made by :func:`level_memory`."""

    low: Workspace
    high: Workspace
    seen: NDArray[np.float32]
    """What the upper agent saw when it chose, shape (its inputs,) [scaled]."""
    goal: NDArray[np.float64]
    """Goals of all joints, shape (joints,) [counts]."""
    aim: NDArray[np.float64]
    """Subgoals, shape (joints,) [counts]."""
    course: NDArray[np.float64]
    """Actions since these were chosen, what was earned by them, and the discount of what follows, shape (3,)."""


def upper_inputs(window: Window, settings: HierarchySettings) -> int:
    """Return the length of what the upper agent sees."""
    return layout_of(window).size if settings.upper_state == "whole" else padded(2 * window.joints + 1, INPUT_BLOCK)


def upper_shape(window: Window, settings: HierarchySettings) -> tuple[int, int, int]:
    """Return the shape of the upper agent's weights, see :class:`~pneumarm.learning.online.values.ActionValues`."""
    width = padded(settings.upper_hidden, LANES)
    units = len(settings.ways) ** window.joints * width
    return 1, upper_inputs(window, settings) + 2, padded(units, UNIT_BLOCK)


def hierarchy(
    weights: tuple[NDArray[np.float32], NDArray[np.float32]],
    spec: ArmSpec,
    window: Window,
    scaling: Scaling,
    settings: HierarchySettings,
    learning_rate: float | None = None,
) -> Hierarchy:
    """Return both levels, which change their ``weights`` (upper, lower) in place."""
    choices = len(settings.ways) ** window.joints
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    lower = learner(weights[1], settings, learning_rate)
    return Hierarchy(
        upper=learner(weights[0], replace(settings, hidden=settings.upper_hidden), learning_rate, choices),
        lower=lower._replace(reward=lower.reward._replace(goal=float(settings.subgoal))),
        ways=np.array(settings.ways, np.float64),
        period=int(settings.period),
        reward=settings.reward.on(spec).parameters,
        unit=np.ascontiguousarray(np.stack([offset[:, 0], scale[:, 0], offset[:, 1], scale[:, 1]], axis=1)),
        layout=layout_of(window),
        is_whole=settings.upper_state == "whole",
    )


def level_memory(levels: Hierarchy) -> LevelMemory:
    """Return workspace for both levels."""
    joints = len(levels.unit)
    return LevelMemory(
        low=loop_workspace(levels.lower, joints),
        high=loop_workspace(levels.upper, joints),
        seen=np.zeros(levels.upper.weights.shape[1] - 2, np.float32),
        goal=np.zeros(joints),
        aim=np.zeros(joints),
        course=np.zeros(3),
    )


@part
def see(levels, memory, x):  # type: ignore[no-untyped-def]
    """Set what the upper agent sees in the state ``x`` (inputs,)."""
    joints = memory.goal.shape[0]
    if levels.is_whole:
        for i in range(x.shape[0]):
            memory.seen[i] = x[i]
    first = levels.layout.goal if levels.is_whole else joints
    for joint in range(joints):
        memory.seen[first + joint] = np.float32((memory.goal[joint] - levels.unit[joint, 0]) / levels.unit[joint, 1])
        if not levels.is_whole:
            memory.seen[joint] = x[angle_at(levels.layout, 0, joint)]
    if not levels.is_whole:
        memory.seen[2 * joints] = np.float32(1.0)


@part
def set_subgoals(levels, schedule, memory, x, random):  # type: ignore[no-untyped-def]
    """Let the upper agent choose subgoals in the state ``x`` (inputs,), and the lower ones what to do for these."""
    see(levels, memory, x)
    decide(levels.upper, schedule, memory.seen, memory.high, random)
    left = memory.high.next_chosen[0]
    for joint in range(memory.goal.shape[0]):
        way = levels.ways[left % levels.ways.shape[0]]
        left //= levels.ways.shape[0]
        here = levels.unit[joint, 0] + levels.unit[joint, 1] * x[angle_at(levels.layout, 0, joint)]
        memory.aim[joint] = here + way * (memory.goal[joint] - here)
        scaled = (memory.aim[joint] - levels.unit[joint, 0]) / levels.unit[joint, 1]
        x[levels.layout.goal + joint] = np.float32(scaled)
    for agent in range(memory.low.chosen.shape[0]):
        forget_traces(levels.lower, agent)
    look_ahead(levels.lower, schedule, x, memory.low, random)
    memory.course[_TAKEN], memory.course[_GAINED], memory.course[_DISCOUNT] = 0.0, 0.0, 1.0


@kernel
def begin_levels(levels, schedule, memory, x, goal, random):  # type: ignore[no-untyped-def]
    """Begin an episode in the state ``x`` (inputs,) towards ``goal`` (joints,) [counts]."""
    for joint in range(goal.shape[0]):
        memory.goal[joint] = goal[joint]
    forget_traces(levels.upper, 0)
    set_subgoals(levels, schedule, memory, x, random)


@part
def arrive(levels, memory, x):  # type: ignore[no-untyped-def]
    """Note which joints are at their subgoals in the state ``x`` (inputs,); return whether all are."""
    are_all = True
    for joint in range(memory.aim.shape[0]):
        angle = levels.unit[joint, 0] + levels.unit[joint, 1] * x[angle_at(levels.layout, 0, joint)]
        velocity = levels.unit[joint, 2] + levels.unit[joint, 3] * x[velocity_at(levels.layout, 0, joint)]
        is_there = has_reached(levels.reward, angle, velocity, memory.aim[joint])
        memory.low.there[joint] = is_there
        are_all = are_all and is_there
    return are_all


@kernel
def go_on(levels, schedule, memory, x, random, is_reached):  # type: ignore[no-untyped-def]
    """Learn from the step to ``x`` (inputs,), for which ``memory.low.paid`` was paid, and choose what to do next."""
    course, joints = memory.course, memory.goal.shape[0]
    usual = levels.reward.goal if is_reached else levels.reward.action
    total = -(joints - 1) * usual  # the goal is paid for once, switches of all joints
    for joint in range(joints):
        total += memory.low.paid[joint]
    course[_TAKEN] += 1.0
    course[_GAINED] += course[_DISCOUNT] * total
    course[_DISCOUNT] *= levels.upper.discount
    is_over = arrive(levels, memory, x) or is_reached or course[_TAKEN] >= levels.period
    if not is_reached:
        look_ahead(levels.lower, schedule, x, memory.low, random)
    if levels.lower.rate > 0.0:
        for joint in range(joints):
            if is_reached and memory.low.there[joint]:
                memory.low.paid[joint] += levels.lower.reward.goal
        learn(levels.lower, memory.low, is_reached)
    if not is_over:
        return
    remember(memory.high, memory.seen)
    earned, discount = course[_GAINED], course[_DISCOUNT]
    if not is_reached:
        set_subgoals(levels, schedule, memory, x, random)
    if levels.upper.rate > 0.0:
        target = td_target(earned, discount, memory.high.next_values[0], is_reached)
        update(levels.upper, 0, memory.high.before, memory.high.chosen[0], target)
        if memory.high.cut[0]:
            forget_traces(levels.upper, 0)


@kernel
def train_levels(environment, levels, schedule, episode, memory, count, performance):  # type: ignore[no-untyped-def]
    """Run at most ``count`` episodes; return the performance (thesis eq. 4.14) after them, actions, and episodes."""
    x, random, steps = episode.state.x, episode.state.random, 0
    for e in range(count):
        begin_episode(environment, episode, schedule.deviation, random)
        begin_levels(levels, schedule, memory, x, episode.goal, random)
        is_reached = False
        for _ in range(environment.task.cutoff):
            remember(memory.low, x)
            is_reached = take(environment, episode, memory.low.next_actions)
            steps += 1
            for joint in range(episode.goal.shape[0]):
                memory.low.paid[joint] = paid(environment.task.reward, is_reached, episode.switched[joint])
            go_on(levels, schedule, memory, x, random, is_reached)
            if is_reached:
                break
        performance += schedule.performance_rate * ((1.0 if is_reached else 0.0) - performance)
        if performance >= schedule.enough:
            return performance, steps, e + 1
    return performance, steps, count


@kernel
def test_levels(environment, levels, schedule, episode, memory, randoms, record):  # type: ignore[no-untyped-def]
    """Fill ``record`` with episodes over all begin states and goals; nothing is learned.

    ``randoms`` decide begin states and goals, and what is chosen: noise is that of the episode alone, whoever acts.
    """
    task, x = environment.task, episode.state.x
    random, choices = randoms
    for e in range(record.actions.shape[0]):
        begin_episode(environment, episode, np.inf, random)
        note_begin(task, episode, record, e)
        begin_levels(levels, schedule, memory, x, episode.goal, choices)
        is_reached = False
        while goes_on(task, is_reached, record, e):
            is_reached = take(environment, episode, memory.low.next_actions)
            note_action(task.reward, episode.switched, is_reached, record, e)
            go_on(levels, schedule, memory, x, choices, is_reached)
        note_end(task, episode, is_reached, record, e)


test_levels.__test__ = False
