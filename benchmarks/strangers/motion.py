"""How arms of strangers move, in signal order: valve, flow, muscle, memory, joint, step; all that is compiled.

The state, by joint j and muscle m:

    angle[j]        q, 0 in the middle                       [rad]
    speed[j]        its rate                                 [rad/s]
    creep[j]        where what creeps is loose               [rad]
    memory[j, i]    of the loop, see ``hysteresis``          [N m, 1 or bar]
    pressure[j, m]  of the muscle, absolute                  [bar]
    line[j, m]      of the line at its valves, absolute      [bar]
    supply[0]       of the tank, absolute                    [bar]

Two joints are links of a plane chain (e.g. M. W. Spong, S. Hutchinson and M. Vidyasagar, 2006, section 7.4). Speeds
are stepped before angles, by half a millisecond.

Numba keeps what it has compiled until this file changes: touch it after a change of a constant that it imports.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.strangers.air import ATMOSPHERE, CAPILLARY, NOZZLE
from benchmarks.strangers.hysteresis import BLOCKS, BOUC_WEN, MEMORY, PLAY, PLAYS, SLIP
from pneumarm.kernels import kernel

Array = NDArray[np.float64]

STEP = 5e-4
"""Longest step [s]."""
_CHOKED = 0.528
_LARGEST = (_CHOKED ** (2 / 1.4) - _CHOKED ** (2.4 / 1.4)) ** 0.5
_VACUUM = 0.3  # bar, below which nothing that is closed is pulled


class State(NamedTuple):
    """What moves; see the table above."""

    angle: Array
    speed: Array
    creep: Array
    memory: Array
    pressure: Array
    line: Array
    supply: Array


def at_atmosphere(joints: int, supply: float) -> State:
    """Return the state of an arm without air, in its middle, on a full ``supply`` [bar, absolute]."""
    one, two = (joints,), (joints, 2)
    return State(
        np.zeros(one),
        np.zeros(one),
        np.zeros(one),
        np.zeros((joints, MEMORY)),
        np.full(two, ATMOSPHERE),
        np.full(two, ATMOSPHERE),
        np.array([supply]),
    )


@kernel
def open_for(opens, closes, time, seconds):  # type: ignore[no-untyped-def]
    """Return for which share of a step from ``time`` on a valve is open."""
    return max(min(closes, time + seconds) - max(opens, time), 0.0) / seconds


@kernel
def flow(air, upstream, downstream, filling):  # type: ignore[no-untyped-def]
    """Return what flows by conductance between two pressures [bar], the way that they say."""
    high, low = max(upstream, downstream), min(upstream, downstream)
    if air.kind == NOZZLE:
        ratio = max(low / high, _CHOKED)
        driven = high * math.sqrt(max(ratio ** (2 / 1.4) - ratio ** (2.4 / 1.4), 0.0)) / _LARGEST
    elif air.kind == CAPILLARY:
        driven = (high * high - low * low) / (2 * ATMOSPHERE)
    else:
        full = (downstream if filling else upstream) - ATMOSPHERE
        share = min(max(full / (air.full - ATMOSPHERE), 0.0), 1.0)
        driven = (high - low) / (1.0 + (air.slower[0] * share if filling else air.slower[1] * (1.0 - share)))
    return driven if upstream >= downstream else -driven


@kernel
def looked_up(muscles, j, m, contraction, column):  # type: ignore[no-untyped-def]
    """Return a ``column`` of a muscle's table, and how it changes with the contraction."""
    table = muscles.table[j, m]
    place = (contraction - muscles.lowest[j, m]) / muscles.spacing[j, m]
    point = min(max(int(place), 0), table.shape[0] - 2)
    rise = table[point + 1, column] - table[point, column]
    return table[point, column] + (place - point) * rise, rise / muscles.spacing[j, m]


@kernel
def pull(muscles, j, m, contraction, rate, gauge):  # type: ignore[no-untyped-def]
    """Return the force of a muscle [N] at a pressure [bar gauge]; ``rate`` of its contraction [1/s]."""
    inside = gauge if muscles.pushes[j, m] else max(gauge - muscles.start[j, m], 0.0)
    passive, _ = looked_up(muscles, j, m, contraction, 0)
    linear, _ = looked_up(muscles, j, m, contraction, 1)
    square, _ = looked_up(muscles, j, m, contraction, 2)
    force = passive + linear * inside + square * inside * abs(inside)
    force -= muscles.damping[j, m] * max(inside, 0.0) * rate * muscles.length[j, m]
    return force if muscles.pushes[j, m] else max(force, 0.0)


@kernel
def cam(body, j, angle):  # type: ignore[no-untyped-def]
    """Return by how much the muscles of a joint are drawn in [m], and the lever [m]."""
    crank = body.crank[j]
    drawn = body.lever[j] * ((1.0 - crank) * angle + crank * math.sin(angle))
    return drawn, body.lever[j] * ((1.0 - crank) + crank * math.cos(angle))


@kernel
def _breathe(air, valves, state, j, m, place, seconds):  # type: ignore[no-untyped-def]
    """Step the pressures of a muscle, and return what it took from the supply [bar l].

    ``place`` is the time, the volume of the muscle [l] and how fast it grows [l/s].
    """
    time, volume, growth = place
    hose = air.hose[j, m]
    before, gauge = state.line[j, m], state.pressure[j, m] - ATMOSPHERE
    into = open_for(valves[j, m, 0, 0], valves[j, m, 0, 1], time, seconds) * air.conductance[j, m, 0]
    out = open_for(valves[j, m, 1, 0], valves[j, m, 1, 1], time, seconds) * air.conductance[j, m, 1]
    taken = into * flow(air, state.supply[0], before, True) if into > 0 else 0.0
    given = out * flow(air, before, ATMOSPHERE, False) if out > 0 else 0.0
    net = taken - given
    if hose > 0:
        through = hose * (before - state.pressure[j, m])
        state.line[j, m] = max(before + seconds * air.exponent * (net - through) / air.line[j, m], _VACUUM)
        net = through
    net -= air.leak[j, m] * gauge + state.pressure[j, m] * growth
    state.pressure[j, m] = max(state.pressure[j, m] + seconds * air.exponent * net / volume, _VACUUM)
    if hose == 0:
        state.line[j, m] = state.pressure[j, m]
    return seconds * taken


@kernel
def _worth(loops, state, j, m):  # type: ignore[no-untyped-def]
    """Return what the pressure of a muscle is worth to it [bar gauge], behind its plays."""
    gauge = state.pressure[j, m] - ATMOSPHERE
    if loops.kind[j] != PLAY:
        return gauge
    worth = gauge
    for i in range(PLAYS):
        half, place = loops.play[j, i], m * PLAYS + i
        state.memory[j, place] = min(max(state.memory[j, place], gauge - half), gauge + half)
        worth += loops.weight[j, i] * (state.memory[j, place] - gauge)
    return worth


@kernel
def _remembered(loops, state, j, turned):  # type: ignore[no-untyped-def]
    """Return the torque of the loop of a joint that has ``turned`` [rad] in a step [N m], and step its memory."""
    memory = state.memory[j]
    torque = 0.0
    if loops.kind[j] == SLIP:
        for i in range(BLOCKS):
            dragged = memory[i] + loops.stiffness[j, i] * turned
            memory[i] = min(max(dragged, -loops.limit[j, i]), loops.limit[j, i])
            torque += memory[i]
    elif loops.kind[j] == BOUC_WEN:
        z, sigma = memory[0], loops.sigma[j]
        sharp = abs(z) ** loops.sharpness[j]
        change = turned - sigma * abs(turned) * math.copysign(sharp, z) + (sigma - 1.0) * turned * sharp
        memory[0] = min(max(z + change / loops.width[j], -1.0), 1.0)
        torque = loops.height[j] * memory[0]
    mean = 0.5 * (state.pressure[j, 0] + state.pressure[j, 1]) - ATMOSPHERE
    return torque * (loops.base[j] + (1.0 - loops.base[j]) * max(mean, 0.0) / loops.full[j])


@kernel
def _carried(body, angle, j):  # type: ignore[no-untyped-def]
    """Return what spring, stops and gravity turn a joint with [N m]."""
    torque = -body.spring[j] * (angle[j] - body.rest[j])
    beyond = max(abs(angle[j]) - body.stop[j], 0.0)
    torque -= math.copysign(body.stop_stiffness[j] * beyond, angle[j])
    for link in range(j, angle.size):
        turned = body.upright[link]
        for i in range(link + 1):
            turned += angle[i]
        torque -= body.weight[link] * math.sin(turned)
    return torque


@kernel
def _accelerate(body, state, torque, seconds):  # type: ignore[no-untyped-def]
    """Step the speeds and angles under ``torque`` (joints,) [N m]."""
    angle, speed = state.angle, state.speed
    if angle.size == 1:
        speed[0] += seconds * torque[0] / body.inertia[0]
    else:
        straight, bent = math.cos(body.bend[1] + angle[1]), math.sin(body.bend[1] + angle[1])
        carried = body.carried[1]
        first = body.inertia[0] + 2.0 * carried * (straight - math.cos(body.bend[1]))
        both, second = body.inertia[1] + carried * straight, body.inertia[1]
        one = torque[0] + carried * bent * (2.0 * speed[0] + speed[1]) * speed[1]
        two = torque[1] - carried * bent * speed[0] ** 2
        determinant = first * second - both * both
        speed[0] += seconds * (second * one - both * two) / determinant
        speed[1] += seconds * (first * two - both * one) / determinant
    for j in range(angle.size):
        angle[j] += seconds * speed[j]


@kernel
def _step(body, muscles, loops, air, valves, state, place, torque):  # type: ignore[no-untyped-def]
    time, seconds = place
    taken = 0.0
    for j in range(torque.size):
        drawn, lever = cam(body, j, state.angle[j])
        torque[j] = _carried(body, state.angle, j) - _remembered(loops, state, j, seconds * state.speed[j])
        for m in range(2):
            side = 1.0 - 2.0 * m
            contraction = muscles.middle[j, m] + side * drawn / muscles.length[j, m]
            rate = side * lever * state.speed[j] / muscles.length[j, m]
            volume, by_contraction = looked_up(muscles, j, m, contraction, 3)
            taken += _breathe(air, valves, state, j, m, (time, volume, by_contraction * rate), seconds)
            torque[j] += side * lever * pull(muscles, j, m, contraction, rate, _worth(loops, state, j, m))
        damping = body.viscous[j] + (body.stop_damping[j] if abs(state.angle[j]) > body.stop[j] else 0.0)
        torque[j] -= damping * state.speed[j] + body.creep[j] * (state.angle[j] - state.creep[j])
        state.creep[j] += seconds / body.creep_time[j] * (state.angle[j] - state.creep[j])
    _accelerate(body, state, torque, seconds)
    state.supply[0] += seconds * (air.full - state.supply[0]) / air.recovery - taken / air.tank


@kernel
def advance(body, muscles, loops, air, valves, state, time, seconds):  # type: ignore[no-untyped-def]
    """Advance ``state`` by ``seconds`` from ``time`` on.

    ``valves`` say from when to when each is open or was, shape (joints, 2, 2, 2): inlet and outlet of each muscle,
    begin and end [s].
    """
    torque = np.zeros(state.angle.size)
    steps = math.ceil(seconds / STEP)
    for i in range(steps):
        place = time + i * seconds / steps, seconds / steps
        _step(body, muscles, loops, air, valves, state, place, torque)


@kernel
def rests(body, muscles, angle, first, second):  # type: ignore[no-untyped-def]
    """Return the torque of a single joint at rest [N m]; pressures of its muscles [bar gauge]."""
    drawn, lever = cam(body, 0, angle)
    torque = _carried(body, np.full(1, angle), 0)
    for m in range(2):
        side = 1.0 - 2.0 * m
        contraction = muscles.middle[0, m] + side * drawn / muscles.length[0, m]
        torque += side * lever * pull(muscles, 0, m, contraction, 0.0, first if m == 0 else second)
    return torque


@kernel
def volume_at(body, muscles, angle, m):  # type: ignore[no-untyped-def]
    """Return the volume of a muscle of a single joint at an ``angle`` [l]."""
    drawn, _ = cam(body, 0, angle)
    volume, _ = looked_up(muscles, 0, m, muscles.middle[0, m] + (1.0 - 2.0 * m) * drawn / muscles.length[0, m], 3)
    return volume
