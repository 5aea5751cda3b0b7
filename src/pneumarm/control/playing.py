"""Many movements of a learning agent on a virtual arm, compiled as one loop.

The same as :meth:`BeginState.reach` and :func:`~.movement.move` with an :class:`~.agent.AgentController` behind the
guard, bit for bit: the same readings with their noise, the same late periods, the same limits of pressure and of
inflation. The rules of the guard, the cycle and the task are compiled from where they stand; what is written here
again is their order, because without Python between two periods a movement takes 1.4 instead of 8.9 ms of processor
time (``python -m benchmarks playing``, on two cores that others shared), and threads do not wait for each other: an
agent that learns on the arm alone needs 80,000 s of arm time. A test compares the two, lateness and two joints
included.

It is for virtual arms without faults or further sensors, and for agents of the thesis' kind; on other arms they are
moved by :mod:`~.turns`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import BeginState
from pneumarm.arm.cycle import missed_turns
from pneumarm.arm.guard import open_time, stays_closed
from pneumarm.arm.valves import VALVES, action_of
from pneumarm.arm.velocity import derived_velocity
from pneumarm.arm.virtual import VirtualArm
from pneumarm.arm.virtual.body import Body
from pneumarm.arm.virtual.passing import pass_for, pass_until
from pneumarm.arm.virtual.sensors import sense
from pneumarm.arm.virtual.valve import command
from pneumarm.errors import UnusableInput
from pneumarm.kernels import borrowed, inner, kernel, part
from pneumarm.learning.online.agent import Agent, begin_acting, learn_and_act
from pneumarm.learning.online.loop import Workspace, loop_workspace
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.settings import Exploration
from pneumarm.learning.online.values import ActionValues, learner
from pneumarm.random import random_state
from pneumarm.simulation.kernel import remember, shift, stops_by_angle
from pneumarm.simulation.layout import Layout, angle_at, layout_of, reading_at
from pneumarm.task.begin import draw_goal_near
from pneumarm.task.movements import Movements, movements
from pneumarm.task.noting import goes_on, note_action
from pneumarm.task.reward import RewardParameters, has_reached, is_switch, paid

Array = NDArray[np.float64]
_missed, _action, _velocity = part(missed_turns), part(action_of), part(derived_velocity)
_open_time, _stays_closed = part(open_time), part(stays_closed)


class _Guard(NamedTuple):
    """The guard: what was read, what is set, and for how long inlets have been open."""

    angle: Array
    """Shape (joints,) [counts]."""
    pressure: Array
    """Shape (joints, 2) [counts]."""
    applied: NDArray[np.int8]
    """Shape (joints, 2)."""
    asked: NDArray[np.int8]
    """Workspace, shape (joints, 2)."""
    open_for: Array
    """Shape (joints, 2) [s]."""
    blocked: NDArray[np.bool_]
    """Which inlets stay closed, shape (joints, 2)."""
    clock: Array
    """Time of the last reading, NaN before the first, shape (1,) [s]."""
    limit: float
    """[counts]"""
    longest: float
    """[s]"""
    period: float
    """[s]"""
    latency: float
    """[s]"""


class _Mind(NamedTuple):
    """The agent acting and learning."""

    learner: ActionValues
    x: NDArray[np.float32]
    sigma: NDArray[np.float32]
    """State window, shape (state_size,) [scaled]."""
    workspace: Workspace
    random: NDArray[np.uint64]
    layout: Layout
    offset: Array
    """Offset of the observations, shape (joints, 4) [sensor units]."""
    scale: Array
    """Shape (joints, 4) [sensor units]."""
    command_scale: Array
    """Shape (joints, 2)."""
    by_angle: NDArray[np.float32]
    """Change of stop operators by that of their angle, both scaled, shape (joints, remembered)."""
    command: NDArray[np.float32]
    """Workspace, shape (2 joints,) [scaled]."""


class _Rules(NamedTuple):
    """What is asked of the arm."""

    reward: RewardParameters
    cutoff: int
    deflate: float
    """[s]"""
    settle: float
    """[s]"""


class _Aims(NamedTuple):
    """Where to move."""

    goals: Array
    """Shape (n, joints) [counts]."""
    durations: Array
    """How long muscles are inflated before each movement, shape (n, joints, 2) [s]."""
    range: Array
    """Goals around the angle at the begin, drawn where the deviation is finite, lie in it, shape (joints, 2)."""
    weights: Array
    """Cumulative probabilities of the sub-intervals that they are drawn from, the farthest first."""
    random: NDArray[np.uint64]


class Player:
    """``agent`` making movements on ``arm``; learns by ``learning_rate``.

    Args:
        agent: of the thesis' kind; it is not changed.
        arm: where it moves. Others may use it between two calls of :meth:`play`, if they close its valves.
        learning_rate: 0 for an agent that does not learn.
        exploration: greedy without it.
        seed: of exploring, and of goals that are drawn near to where the arm stands.
        begin: how the arm gets to a begin state.

    Raises:
        UnusableInput: agent and arm do not fit, or the agent needs further sensors.

    """

    def __init__(
        self,
        agent: Agent,
        arm: VirtualArm,
        learning_rate: float = 0.0,
        exploration: Exploration | None = None,
        seed: int = 0,
        begin: BeginState = BeginState(),
    ) -> None:
        spec, window, scaling = arm.spec, agent.window, agent.scaling
        if window.joints != spec.joints or spec.angle_limits is not None:
            raise UnusableInput(
                f"{spec.name}: expected an arm of {window.joints} joint(s) without limits of the angle, got "
                f"{spec.joints} joint(s) and the limits {spec.angle_limits}"
            )
        self.agent, self.arm, self._begin = agent, arm, begin
        window.require((), "a compiled loop of movements")
        joints, layout = spec.joints, layout_of(window)
        self._schedule = _schedule(exploration)
        x = np.zeros(layout.size, np.float32)
        x[layout.one] = 1
        learns = learner(agent.weights(), agent.settings, learning_rate)
        self._mind = _Mind(
            learns,
            x,
            np.zeros(window.state_size, np.float32),
            loop_workspace(learns, joints),
            random_state(seed),
            layout,
            np.ascontiguousarray(window.of_joints(scaling.observation_offset), np.float64),
            np.ascontiguousarray(window.of_joints(scaling.observation_scale), np.float64),
            np.ascontiguousarray(scaling.command_scale.reshape(joints, 2), np.float64),
            stops_by_angle(window, scaling),
            np.zeros(2 * joints, np.float32),
        )
        both = joints, 2
        self._watched = _Guard(
            np.zeros(joints),
            np.zeros(both),
            np.zeros(both, np.int8),
            np.zeros(both, np.int8),
            np.zeros(both),
            np.zeros(both, bool),
            np.full(1, np.nan),
            float(spec.max_pressure_counts),
            float(spec.max_inflation),
            float(spec.period),
            float(spec.latency),
        )
        task = agent.settings
        reward = task.reward.on(spec).parameters
        self._rules = _Rules(reward, int(task.cutoff), float(begin.deflate), float(begin.settle))
        self._range = np.ascontiguousarray(agent.goal_range, np.float64)
        self._weights = np.cumsum(task.begin_weights) / np.sum(task.begin_weights)
        self._aim_random = random_state((seed, 1))
        self.performance = 0.0
        """Moving average of successes (thesis eq. 4.14) by the schedule of :meth:`play`."""

    def play(self, goals: Array, durations: Array, schedule: Schedule | None = None) -> Movements:
        """Make movements, each from a begin state of its own; ends early where the schedule's demand is met.

        Args:
            goals: shape (n, joints) [counts].
            durations: how long each muscle is inflated before a movement, shape (n, joints, 2) [s].
            schedule: of shaping: where its deviation is finite, goals are not those given but near to where the arm
                stands (thesis section 4.3.3), by the agent's weights of the sub-intervals of deviations.

        """
        goals, durations = np.ascontiguousarray(goals, np.float64), np.ascontiguousarray(durations, np.float64)
        record = movements(len(goals), goals.shape[1])
        aims = _Aims(goals, durations, self._range, self._weights, self._aim_random)
        count, self.performance = _play(
            self.arm.plain,
            self._watched,
            (self._mind, schedule or self._schedule),
            self._rules,
            aims,
            record,
            float(self.performance),
        )
        return record.part(slice(count))

    def visit(self, durations: Array) -> tuple[Array, Array]:
        """Bring the arm to rest once for each of ``durations`` (n, joints, 2) [s] and only look.

        Returns the angles (n, joints) and pressures (n, joints, 2) at rest [counts].
        """
        durations = np.ascontiguousarray(durations, np.float64)
        angle, pressure = np.zeros(durations.shape[:2]), np.zeros(durations.shape)
        _visit(self.arm.plain, self._watched, self._rules, durations, angle, pressure)
        return angle, pressure

    @property
    def time(self) -> float:
        """Time on the arm's clock [s]."""
        return self.arm.time

    @property
    def learned(self) -> Agent:
        """The agent as it is now."""
        return self.agent.with_weights(self._mind.learner.weights)


def _schedule(exploration: Exploration | None) -> Schedule:
    chosen = exploration or Exploration(0.0, 1.0)
    return Schedule(np.inf, float(chosen.epsilon), float(chosen.temperature), 0.0)


@inner
def _read(body: Body, watched: _Guard) -> float:
    """Read the sensors, and count for how long inlets have been open; return the time."""
    time: float = sense(body, watched.angle, watched.pressure)
    passed = 0.0 if np.isnan(watched.clock[0]) else time - watched.clock[0]
    watched.clock[0] = time
    for j in range(watched.applied.shape[0]):
        for m in range(2):
            valve = watched.applied[j, m]
            seconds = _open_time(watched.open_for[j, m], valve, passed)
            watched.open_for[j, m] = seconds
            watched.blocked[j, m] = _stays_closed(watched.blocked[j, m], valve, seconds, watched.longest)
    return time


@inner
def _set(body: Body, watched: _Guard) -> None:
    """Set the valves as asked, but for inlets of muscles at their limits."""
    for j in range(watched.applied.shape[0]):
        for m in range(2):
            valve = watched.asked[j, m]
            if valve > 0 and (watched.pressure[j, m] > watched.limit or watched.blocked[j, m]):
                valve = 0
            watched.applied[j, m] = valve
    command(body, watched.applied, watched.period)


@inner
def _wait(body: Body, watched: _Guard, seconds: float) -> None:
    """Let time pass, looking at the limits every period while an inlet is open."""
    while seconds > watched.period and (watched.applied > 0).any():
        pass_for(body, watched.period)
        seconds -= watched.period
        _read(body, watched)
        changes = False
        for j in range(watched.applied.shape[0]):
            for m in range(2):
                watched.asked[j, m] = watched.applied[j, m]
                over = watched.pressure[j, m] > watched.limit or watched.blocked[j, m]
                changes |= over and watched.applied[j, m] > 0
        if changes:
            _set(body, watched)
    pass_for(body, seconds)


@inner
def _reach(body: Body, watched: _Guard, rules: _Rules, durations: Array) -> None:
    """As :meth:`BeginState.reach`, with the ``durations`` (joints, 2) [s] given."""
    _read(body, watched)
    watched.asked[:] = -1
    _set(body, watched)
    _wait(body, watched, rules.deflate)
    passed = 0.0
    ends = np.sort(durations.copy().ravel())
    for k in range(ends.size + 1):
        end = ends[k - 1] if k > 0 else 0.0
        if end > passed:
            _wait(body, watched, end - passed)
            passed = end
        _read(body, watched)
        for j in range(durations.shape[0]):
            for m in range(2):
                watched.asked[j, m] = 1 if durations[j, m] > passed else 0
        _set(body, watched)
    _wait(body, watched, rules.settle)


@inner
def _push(mind: _Mind, watched: _Guard, velocity: Array, first: bool) -> None:
    """Put what was read into the state window, as :class:`~pneumarm.task.tracker.StateTracker` does."""
    sigma, layout = mind.sigma, mind.layout
    if first:
        sigma[:] = 0
    else:
        for j in range(velocity.size):
            angle = np.float32((watched.angle[j] - mind.offset[j, 0]) / mind.scale[j, 0])
            remember(layout, mind.by_angle, sigma, j, angle - sigma[angle_at(layout, 0, j)], np.float32(1.0))
        for j in range(velocity.size):
            for m in range(2):
                valve = np.float64(watched.applied[j, m]) / mind.command_scale[j, m]
                mind.command[2 * j + m] = np.float32(valve)
        shift(layout, sigma, mind.command)
    for j in range(velocity.size):
        for q in range(4):
            value = watched.angle[j] if q == 0 else (velocity[j] if q == 1 else watched.pressure[j, q - 2])
            scaled = np.float32((value - mind.offset[j, q]) / mind.scale[j, q])
            for lag in range(layout.history if first else 1):
                sigma[reading_at(layout, lag, j, q)] = scaled


@inner
def _begin(watched, mind, schedule, goal, velocity):  # type: ignore[no-untyped-def]
    """Begin a movement to ``goal`` in the state that was read."""
    for j in range(goal.size):
        velocity[j] = 0.0
        mind.x[mind.layout.goal + j] = np.float32((goal[j] - mind.offset[j, 0]) / mind.scale[j, 0])
    _push(mind, watched, velocity, True)
    for i in range(mind.layout.command):
        mind.x[i] = mind.sigma[i]
    begin_acting(mind.learner, schedule, mind.x, mind.workspace, mind.random)


@inner
def _judge(watched, rules, goal, velocity, turn, gained):  # type: ignore[no-untyped-def]
    """Set what each joint has ``gained`` by its last action, whether it switched and is there; return if all are."""
    is_reached = True
    for j in range(goal.size):
        is_there = has_reached(rules.reward, watched.angle[j], velocity[j], goal[j])
        turn.there[j] = is_there
        is_reached = is_reached and is_there
    for j in range(goal.size):
        action = _action(watched.applied[j, 0], watched.applied[j, 1])
        turn.switched[j] = 1 if is_switch(turn.last[j], action) else 0
        turn.last[j] = action
        gained[j] = paid(rules.reward, is_reached, turn.switched[j])
    return is_reached


class _Turn(NamedTuple):
    """The last actions as applied, whether they were switches, and who is at its goal, each of shape (joints,)."""

    last: NDArray[np.int64]
    switched: NDArray[np.int64]
    there: NDArray[np.bool_]


@inner
def _move(body, watched, mind, schedule, rules, goal, record, e):  # type: ignore[no-untyped-def]
    """Make movement ``e`` to ``goal``, as ``move`` does; return whether it succeeded."""
    joints = goal.size
    before, velocity, gained = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    turn = _Turn(np.full(joints, -1), np.zeros(joints, np.int64), np.zeros(joints, np.bool_))
    success, is_first, due, then = False, True, 0.0, 0.0
    while True:
        time = _read(body, watched)
        due = time if is_first else due
        due += (_missed(time - due, watched.period) + 1) * watched.period
        if is_first:
            record.time_start[e] = time
            record.goal[e], record.angle_begin[e] = goal, watched.angle
            _begin(watched, mind, schedule, goal, velocity)
        else:
            for j in range(joints):
                velocity[j] = _velocity(watched.angle[j], before[j], time - then)
            success = _judge(watched, rules, goal, velocity, turn, gained)
            note_action(rules.reward, turn.switched, success, record, e)
            _push(mind, watched, velocity, False)
            seen = gained, turn.there, mind.sigma
            learn_and_act(mind.learner, schedule, mind.x, mind.workspace, mind.random, seen, success)
            if not goes_on(rules, success, record, e):
                break
        for j in range(joints):
            before[j] = watched.angle[j]
        then, is_first = time, False
        if watched.latency > 0.0:
            _wait(body, watched, watched.latency)
        for j in range(joints):
            for m in range(2):
                watched.asked[j, m] = VALVES[mind.workspace.next_actions[j], m]
        _set(body, watched)
        pass_until(body, due)
    watched.asked[:] = 0
    _set(body, watched)
    record.time_end[e], record.success[e] = time, success
    record.angle_end[e], record.velocity_end[e] = watched.angle, velocity
    return success


@kernel
def _play(body, watched, mind_schedule, rules, aims, record, performance):  # type: ignore[no-untyped-def]
    """Fill ``record`` with movements; return how many, and the performance (thesis eq. 4.14) after them."""
    body, watched, rules, aims, record = borrowed((body, watched, rules, aims, record))
    mind, schedule = borrowed(mind_schedule)
    goal = np.zeros(aims.goals.shape[1])
    for e in range(aims.goals.shape[0]):
        _reach(body, watched, rules, aims.durations[e])
        for j in range(goal.size):
            goal[j] = aims.goals[e, j]
        if schedule.deviation < np.inf:
            _read(body, watched)
            draw_goal_near(aims.range, aims.weights, watched.angle, schedule.deviation, aims.random, goal)
        success = _move(body, watched, mind, schedule, rules, goal, record, e)
        performance += schedule.performance_rate * ((1.0 if success else 0.0) - performance)
        if performance >= schedule.enough:
            return e + 1, performance
    return aims.goals.shape[0], performance


@kernel
def _visit(body, watched, rules, durations, angle, pressure):  # type: ignore[no-untyped-def]
    for e in range(durations.shape[0]):
        _reach(body, watched, rules, durations[e])
        _read(body, watched)
        angle[e] = watched.angle
        pressure[e] = watched.pressure
