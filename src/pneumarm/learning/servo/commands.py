"""From what the policy says to what the valves do: pulses, none for a little, the whole period for a lot.

With z the policy's output, v = 1.25 tanh(z) and dead the share of it that keeps a valve closed,

    command = sign(v) clip((|v| - dead) / (1 - dead), 0, 1),   rounded where the valve can be no faster.

The gradient goes through the rounding as if it were not there (a straight-through estimate: Bengio, Leonard and
Courville, arXiv:1308.3432). Where the command is clipped or kept closed it has none, but a small share of it passes,
or a policy that keeps its valves closed would never learn to open them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.kernels import kernel, part
from pneumarm.networks.tansig import FASTMATH, tansig
from pneumarm.simulation.layout import Layout, layout_of, pressure_at
from pneumarm.simulation.simulation import Simulation

GAIN = np.float32(1.25)
_LEAK = 0.05
_AS_IF = 0.1
NEAR = 8.0
"""Tolerances from a goal that stays within which a joint may be nearly at rest."""
_FAST = 4.5  # tolerances/s; a joint that is faster is not
WHOLE = np.float32(0.8)
"""Longer pulses last the whole period: that saves changes of valves and costs next to no precision."""
_ONE, _ZERO = np.float32(1.0), np.float32(0.0)


class CommandParameters(NamedTuple):
    """How commands are made. Made by :func:`command_parameters`."""

    dead: float
    """Share of the policy's output around 0 that keeps a valve closed."""
    shortest: float
    """Shortest pulse, in periods."""
    step: float
    """Pulses are a multiple of it, in periods; 0: any."""
    leak: float
    """Share of the gradient that passes where the command does not change."""
    layout: Layout
    inlet: NDArray[np.float32]
    """Pressure over which an inlet stays closed, shape (joints, 2) [scaled]."""
    coarse: float
    """On the way to a goal that stays: share of the period that a pulse is at least, and is short of the whole."""
    near: float
    """Tolerances to the goal, and ..."""
    slow: float
    """... tolerances a period, within which a joint is no longer on its way."""


def command_parameters(simulation: Simulation, dead: float, shortest: float, coarse: float) -> CommandParameters:
    """Return the parameters for pulses of at least ``shortest`` periods, or ``coarse`` on the way to a goal."""
    scaling, window, spec = simulation.scaling, simulation.window, simulation.spec
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    inlet = (spec.max_pressure_counts - offset[:, 2:]) / scale[:, 2:]
    inlet, slow = np.ascontiguousarray(inlet, np.float32), _FAST * spec.period
    step = spec.pulse_step / spec.period if spec.pulses else 0.0
    layout = layout_of(window)
    return CommandParameters(float(dead), float(shortest), step, _LEAK, layout, inlet, float(coarse), NEAR, slow)


def shortest_share(spec: ArmSpec) -> float:
    """Return the shortest pulse of an arm in periods.

    A servo of an arm without pulses learns as if it had some, and spreads them over whole periods when it acts.
    """
    return min(spec.shortest_pulse / spec.period, 1.0) if spec.pulses else _AS_IF


@part
def rounded(size, shortest, step):  # type: ignore[no-untyped-def]
    """Return a pulse of ``size`` periods as the valve can make it: none, or between ``shortest`` and the period."""
    if step > _ZERO:
        return min(np.round(size / step) * step, _ONE)
    if size < np.float32(0.5) * shortest:
        return _ZERO
    if size > min(WHOLE, _ONE - np.float32(0.5) * shortest):
        return _ONE
    return max(size, shortest)


@part
def coarsened(pulse, coarse):  # type: ignore[no-untyped-def]
    """Return none for a ``pulse`` shorter than ``coarse``, and the period for one that is short of it by less."""
    return _ZERO if pulse < coarse else _ONE if pulse > _ONE - coarse else pulse


@kernel(fastmath=FASTMATH)
def write_commands(parameters, x, underway, said, slope, command):  # type: ignore[no-untyped-def]
    """Make ``command`` (2 joints, n) of the policy's outputs ``said``, ``slope`` to the derivatives by them.

    ``x`` (size, n) are the states, in which the pressures are read; ``underway`` (joints, n) tells which joints are
    on their way to a goal that stays; ``said`` is replaced by its hyperbolic tangent.
    """
    dead, shortest, step = np.float32(parameters.dead), np.float32(parameters.shortest), np.float32(parameters.step)
    leak, coarse = np.float32(parameters.leak), np.float32(parameters.coarse)
    stretch = _ONE / (_ONE - dead)
    for c in range(command.shape[0]):
        tansig(said[c])
        joint, muscle = c // 2, c % 2
        place, limit = pressure_at(parameters.layout, 0, joint, muscle), parameters.inlet[joint, muscle]
        for e in range(command.shape[1]):
            bent = said[c, e]
            v = GAIN * bent
            size = (abs(v) - dead) * stretch
            moves = _ZERO < size < _ONE
            if v > _ZERO and x[place, e] > limit:
                size, moves = _ZERO, False
            pulse = rounded(min(max(size, _ZERO), _ONE), shortest, step)
            if underway[joint, e]:
                pulse = coarsened(pulse, coarse)
            command[c, e] = pulse if v > _ZERO else -pulse
            slope[c, e] = GAIN * (_ONE - bent * bent) * stretch * (_ONE if moves else leak)
