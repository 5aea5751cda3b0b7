"""Model predictive control: at every turn the commands of the next half second, made better in the simulation.

    u = (u_k, ..., u_{k+H-1}),   s_{i+1} = simulation(s_i, u_i),   cost = sum_i price(s_{i+1}, r_{i+1}, u_i, u_{i-1})
    u <- clip(u - rate Adam(d cost / d u), -1, 1);   u_k of the cheapest plan is given, and the next turn plans anew

Prices are those that a servo learns by, but the cheapest plan is found with valve changes counted, not by their
smooth stand-in. Several plans are made better side by side, since there are many local minima: what is left of the
plan of the turn before, what the policy would do (where there is one), and both with random changes.

Receding horizon: J. B. Rawlings, D. Q. Mayne and M. M. Diehl, Model Predictive Control, 2nd edition, 2017; the
gradient: A. E. Bryson and Y.-C. Ho, Applied Optimal Control, 1975, chapter 7.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import borrowed, inner, kernel, part
from pneumarm.learning.servo.commands import rounded
from pneumarm.learning.servo.gradient import (
    ServoTask,
    Trainable,
    errors_of,
    go_sooner,
    move_forward,
    note_free,
    price_of_a_step,
    prices_of_pressures,
    tape,
)
from pneumarm.learning.servo.settings import USUAL_PERIOD
from pneumarm.networks.tansig import FASTMATH
from pneumarm.simulation.gradient import step_all
from pneumarm.simulation.layout import angle_at, command_at, pressure_at
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.changes import changes
from pneumarm.task.price import price_of_one_error
from pneumarm.vectors import put

_changes = part(changes)
_HORIZON = 0.55  # s
PLANS = 8
"""Plans that are made better side by side: as many as go into one vector instruction."""
_RATE = 0.15  # of Adam at the beginning [periods]; falls linearly
_CHANGES = 0.05, 0.6  # standard deviations of random changes, of the plan changed least and most [periods]
_STEEPEST = 400.0  # where derivatives are cut off, at the usual period; see ServoTask
_ONE, _ZERO = np.float32(1.0), np.float32(0.0)
_MEAN, _SQUARE, _TINY = np.float32(0.8), np.float32(0.95), np.float32(1e-4)  # of Adam


class Plans(NamedTuple):
    """``n`` plans of some ``steps``, and what makes them better."""

    commands: NDArray[np.float32]
    """As wished for, before they are rounded to what valves can do, shape (steps, 2 joints, n) [periods]."""
    gradient: NDArray[np.float32]
    """Same shape."""
    mean: NDArray[np.float32]
    """Adam's average of the gradient, same shape."""
    square: NDArray[np.float32]
    """Adam's average of its square, same shape."""
    cost: NDArray[np.float32]
    """Shape (n,)."""
    best: NDArray[np.float32]
    """The cheapest commands of each so far, shape (steps, 2 joints, n)."""
    least: NDArray[np.float32]
    """Their costs, shape (n,)."""
    there: NDArray[np.float32]
    """1 for a muscle that is there, else 0, shape (2 joints,)."""


def plans_of(steps: int, there: NDArray[np.float32], n: int) -> Plans:
    """Return room for ``n`` plans of ``steps`` for the muscles that are ``there`` (2 joints,)."""
    shape = steps, there.size, n
    commands, gradient, mean, square, best = (np.zeros(shape, np.float32) for _ in range(5))
    return Plans(commands, gradient, mean, square, np.zeros(n, np.float32), best, np.zeros(n, np.float32), there)


@inner(fastmath=FASTMATH)
def play(task, plans, tape):  # type: ignore[no-untyped-def]
    """Play the commands from ``tape.x[0]`` on."""
    simulation, how = task.simulation, task.commands
    first, commanded = simulation.layout.command, simulation.layout.commanded
    shortest, step, leak = np.float32(how.shortest), np.float32(how.step), np.float32(how.leak)
    for t in range(plans.commands.shape[0]):
        x = tape.x[t]
        for c in range(commanded):
            place, limit = pressure_at(simulation.layout, 0, c // 2, c % 2), how.inlet[c // 2, c % 2]
            for e in range(x.shape[1]):
                wished = plans.commands[t, c, e] * plans.there[c]
                stopped = wished > _ZERO and x[place, e] > limit
                pulse = _ZERO if stopped else rounded(abs(wished), shortest, step)
                x[first + c, e] = pulse if wished > _ZERO else -pulse
                tape.slope[t, c, e] = leak if stopped else plans.there[c]
        step_all(simulation, x, tape.x[t + 1], tape.work)
        put(tape.hidden[t], tape.work.hidden)
        note_free(task, tape, t)


@inner(fastmath=FASTMATH)
def price(task, plans, tape):  # type: ignore[no-untyped-def]
    """Set ``plans.cost`` to what the movements on ``tape`` cost; valve changes are counted."""
    simulation, cost = task.simulation, plans.cost
    layout = simulation.layout
    first, commanded, before = layout.command, layout.commanded, command_at(layout, 1)
    change = np.float32(task.prices.change)
    cost[:] = _ZERO
    for t in range(tape.slope.shape[0]):
        for joint in range(layout.joints):
            scale, angle = task.inputs.tolerances[joint], angle_at(layout, 0, joint)
            prices_of_pressures(task, tape, t + 1, joint, tape.row)
            for e in range(cost.shape[0]):
                error = (tape.x[t + 1, angle, e] - tape.reference[t + 1, joint, e]) * scale
                cost[e] += price_of_one_error(task.prices, error)[0] + tape.row[0, e]
        for c in range(commanded):
            for e in range(cost.shape[0]):
                now = tape.x[t, first + c, e]
                cost[e] += change * _changes(now, tape.x[t, before + c, e] if layout.history > 1 else _ZERO)


@inner(fastmath=FASTMATH)
def slopes_by_commands(task, plans, tape):  # type: ignore[no-untyped-def]
    """Set ``plans.gradient`` to the derivatives of what the movements on ``tape`` cost, after :func:`play`."""
    simulation = task.simulation
    first, commanded = simulation.layout.command, simulation.layout.commanded
    steps = tape.slope.shape[0]
    tape.later[:] = _ZERO
    for back in range(steps):
        t = steps - 1 - back
        price_of_a_step(task, tape, t, _ONE)
        for c in range(commanded):
            for e in range(tape.slope.shape[2]):
                plans.gradient[t, c, e] = tape.sooner[first + c, e] * tape.slope[t, c, e]
                tape.sooner[first + c, e] = _ZERO
        go_sooner(task, tape, _ONE)


@inner
def copy_plan(to, e, source, number):  # type: ignore[no-untyped-def]
    """Make plan ``e`` of ``to`` plan ``number`` of ``source``."""
    for t in range(to.shape[0]):
        for c in range(to.shape[1]):
            to[t, c, e] = source[t, c, number]


@kernel(fastmath=FASTMATH)
def improve(task, plans, tape, times, rate):  # type: ignore[no-untyped-def]
    """Make each plan better so many ``times``, and play the cheapest of all that there were, as all plans."""
    task, plans, tape = borrowed((task, plans, tape))
    plans.mean[:] = _ZERO
    plans.square[:] = _ZERO
    play(task, plans, tape)
    price(task, plans, tape)
    for t in range(plans.commands.shape[0]):
        put(plans.best[t], plans.commands[t])
    for e in range(plans.cost.shape[0]):
        plans.least[e] = plans.cost[e]
    for number in range(times):
        slopes_by_commands(task, plans, tape)
        unbias, unbias_square = _ONE - _MEAN ** np.float32(number + 1), _ONE - _SQUARE ** np.float32(number + 1)
        step = np.float32(rate * (1.0 - number / times)) / unbias
        for t in range(plans.commands.shape[0]):
            for c in range(plans.commands.shape[1]):
                commands, gradient = plans.commands[t, c], plans.gradient[t, c]
                mean, square = plans.mean[t, c], plans.square[t, c]
                for e in range(commands.shape[0]):
                    mean[e] = _MEAN * mean[e] + (_ONE - _MEAN) * gradient[e]
                    square[e] = _SQUARE * square[e] + (_ONE - _SQUARE) * gradient[e] * gradient[e]
                    moved = commands[e] - step * mean[e] / (np.sqrt(square[e] / unbias_square) + _TINY)
                    commands[e] = min(max(moved, -_ONE), _ONE)
        play(task, plans, tape)
        price(task, plans, tape)
        for e in range(plans.cost.shape[0]):
            if plans.cost[e] < plans.least[e]:
                plans.least[e] = plans.cost[e]
                copy_plan(plans.best, e, plans.commands, e)
    cheapest = plans.least.argmin()
    for e in range(plans.least.shape[0]):
        copy_plan(plans.commands, e, plans.best, cheapest)
    play(task, plans, tape)


class PredictiveControl:
    """Plans turn by turn; what it needs is compiled when it is made.

    Args:
        simulation: that is planned in.
        task: prices, and what valves can do.
        times: how often plans are made better in a turn.
        policy: a network of ``n`` samples that proposes plans; None: plans begin with closed valves.

    """

    def __init__(self, simulation: Simulation, task: ServoTask, times: int, policy: Trainable | None = None) -> None:
        window, scaling, period = simulation.window, simulation.scaling, simulation.spec.period
        self._task = task._replace(steepest=_STEEPEST * USUAL_PERIOD / period)
        self._times, self._policy, self._window = times, policy, window
        self._steps = max(round(_HORIZON / period), 2)
        self.ahead = self._steps + int(task.inputs.steps.max()) - 1
        """Periods to come for which it has to know what is wanted."""
        hidden = 0 if policy is None else sum(len(units) for units in policy.units[:-1])
        self._tape = tape(task, self._steps, PLANS, hidden)
        self._tape.x[0, task.simulation.layout.one] = 1
        there = np.ones((window.joints, 2), np.float32)
        there[:, 1] = simulation.spec.muscles > 1
        self._plans = plans_of(self._steps, there.ravel(), PLANS)
        self._offset = window.of_joints(scaling.observation_offset)[:, 0]
        self._scale = window.of_joints(scaling.observation_scale)[:, 0]
        changes = np.concatenate([[0.0], np.geomspace(*_CHANGES, PLANS // 2 - 1)])
        self._changes = np.tile(changes, 2).astype(np.float32)
        self.reset()
        self.pulses(np.zeros(window.state_size, np.float32), np.zeros((1 + self.ahead, window.joints)))
        self.reset()

    def hurry(self) -> None:
        """Take half as long from now on: the computer is too slow, and a command that comes late is not given."""
        self._times = max(self._times // 2, 1)

    def reset(self) -> None:
        """Begin anew: nothing is left of a plan."""
        self._random = np.random.default_rng(0)
        self._left = np.zeros(self._plans.commands.shape[:2], np.float32)

    def pulses(self, state: NDArray[np.float32], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pulses (joints, 2) in the scaled ``state`` (state_size,).

        ``wanted`` (1 + ahead, joints) is what is asked for now and in the periods to come [counts].
        """
        here, plans, muscles = self._tape, self._plans, self._window.command_size
        commands = here.x[:-1, state.size : state.size + muscles, 0]
        proposed = self._proposed(state, wanted)
        plans.commands[..., : PLANS // 2] = self._left[..., None]
        plans.commands[..., PLANS // 2 :] = proposed[..., None]
        plans.commands[...] += self._changes * self._random.standard_normal(plans.commands.shape, np.float32)
        np.clip(plans.commands, -1.0, 1.0, out=plans.commands)
        improve(self._task, plans, here, self._times, _RATE)
        self._left[:-1] = plans.commands[1:, :, 0]
        self._left[-1] = 0.0
        return commands[0].astype(np.float64).reshape(-1, 2)

    def gains(self, state: NDArray[np.float32], wanted: NDArray[np.float64]) -> float:
        """Return by how many tolerances the joint furthest off is nearer on average by a plan than by the policy.

        Both as the simulation has it; arguments as of :meth:`pulses`, of which this is no turn.
        """
        left, random = self._left.copy(), self._random.bit_generator.state
        self._proposed(state, wanted)
        errors = [np.abs(errors_of(self._task, self._tape)[..., 0]).mean(axis=0).max()]
        self.pulses(state, wanted)
        errors.append(np.abs(errors_of(self._task, self._tape)[..., 0]).mean(axis=0).max())
        self._left, self._random.bit_generator.state = left, random
        return float(errors[0] - errors[1])

    def _proposed(self, state: NDArray[np.float32], wanted: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return what the policy would do, or closed valves, shape (steps, 2 joints), and leave that on the tape."""
        here, muscles = self._tape, self._window.command_size
        here.x[0, : state.size] = state[:, None]
        asked = ((wanted - self._offset) / self._scale).astype(np.float32)[..., None]
        here.reference[...] = asked[: self._steps + 1]
        if self._policy is None:
            return np.zeros_like(self._left)
        here.preview[...] = asked[np.arange(self._steps)[:, None] + self._task.inputs.steps]
        move_forward(self._task, self._policy, here)
        return here.x[:-1, state.size : state.size + muscles, 0].copy()
