"""Two poles on a cart, balanced without velocities by the evolution that also learns arms: evaluations that it takes.

python -m benchmarks double_poles

The known answer by which the code of the method esp is checked. A cart on 4.8 m of track carries a pole of 1 m and
one of 0.1 m; a network sees where the cart is and how far the poles lean, not how fast, and pushes with up to 10 N
every 0.02 s. An evaluation is one attempt of one network. Settings come from the environment:

PNEUMARM_POLES_RUNS     runs from different seeds, 50
PNEUMARM_POLES_SEED     the first of these seeds, 0
PNEUMARM_POLES_FITNESS  "steps,damping"

steps: fitness is how many of 100,000 steps the poles stay up; a run ends with the first network that keeps them up
for all. damping: fitness is Gruau's, over 1,000 steps, which a cart cannot earn by rocking to and fro; a run ends
when the best network of a generation keeps the poles up for 100,000 steps and from at least 200 of 625 other
beginnings for 1,000. Trials of the best network in the second case are no evaluations, as in the papers.

Sources: A. Wieland, "Evolving neural network controllers for unstable systems", IJCNN 1991 (equations); F. Gruau,
D. Whitley and L. Pyeatt, "A comparison between cellular encoding and direct encoding for genetic neural networks",
GP 1996 (damping fitness, 625 beginnings); F. Gomez and R. Miikkulainen, "Solving non-Markovian control tasks with
neuroevolution", IJCAI 1999; F. Gomez, J. Schmidhuber and R. Miikkulainen, "Accelerated neural evolution through
cooperatively coevolved synapses", JMLR 9, 2008 (the evaluations in REPORTED, means of 50 runs).
"""

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import _environment as environment
from pneumarm.kernels import inner, kernel
from pneumarm.learning.evolution.populations import (
    SubPopulationSettings,
    burst,
    draw_networks,
    first_neurons,
    mean_fitness,
    recombine,
)
from pneumarm.learning.evolution.recurrent import memory_of, recur

GRAVITY = 9.8
"""[m/s^2]"""
CART = 1.0
"""Mass of the cart [kg]."""
POLES = np.array([[0.1, 0.5], [0.01, 0.05]])
"""Mass [kg] and half the length [m] of each pole."""
CART_FRICTION, HINGE_FRICTION = 5e-4, 2e-6
"""Friction of cart and track [N], of hinges [N m s]."""
FORCE = 10.0
"""Largest force [N]."""
TRACK = 2.4
"""Distance from the middle to either end of the track [m]."""
STEEPEST = math.radians(36.0)
"""Angle from the vertical at which a pole has fallen [rad]."""
STEP, STEPS_A_DECISION = 0.01, 2
"""Step of the integration [s], and how many of them a force holds."""
LEANING = math.radians(4.5)
"""How far the long pole leans at the beginning [rad]."""
LONG, SHORT = 100_000, 1_000
"""Decisions of a whole trial, and of one of Gruau's."""
ENOUGH = 200
"""Of the 625 beginnings, those from which a solution has to keep the poles up."""
INPUTS, UNITS = 4, 3
"""Cart, both poles and a 1; of the units the first is the force."""
SETTINGS = SubPopulationSettings()
GENERATIONS = 1_000
"""After which a run has failed."""
REPORTED = {"steps": 7_374, "damping": 26_342}
FITNESSES = tuple(REPORTED)


class Attempt(NamedTuple):
    """What one network did."""

    steps: int
    """Decisions until a pole had fallen or the cart had left the track, or all."""
    damping: float
    """Gruau's fitness: 0.1 for lasting 1,000 decisions, and 0.9 times one for little movement in the last 100."""


class Solved(NamedTuple):
    """How a run of evolution went."""

    evaluations: int
    is_solved: bool
    network: NDArray[np.float32]
    """The best one, shape (UNITS, genes)."""


@inner
def slopes(state, force, poles, slope):  # type: ignore[no-untyped-def]
    """Set ``slope`` (6,) to the derivative of ``state``: cart, its velocity, and the same of each pole (Wieland)."""
    friction = CART_FRICTION * np.sign(state[1])
    push, mass = force - friction, CART
    for pole in range(2):
        m, half = poles[pole, 0], poles[pole, 1]
        angle, turn = state[2 + 2 * pole], state[3 + 2 * pole]
        sin, cos = math.sin(angle), math.cos(angle)
        hinge = HINGE_FRICTION * turn / (m * half)
        push += m * half * turn * turn * sin + 0.75 * m * cos * (hinge - GRAVITY * sin)
        mass += m * (1.0 - 0.75 * cos * cos)
    acceleration = push / mass
    slope[0], slope[1] = state[1], acceleration
    for pole in range(2):
        m, half = poles[pole, 0], poles[pole, 1]
        angle, turn = state[2 + 2 * pole], state[3 + 2 * pole]
        hinge = HINGE_FRICTION * turn / (m * half)
        slope[2 + 2 * pole] = turn
        slope[3 + 2 * pole] = -0.75 / half * (acceleration * math.cos(angle) - GRAVITY * math.sin(angle) + hinge)


@inner
def advance(state, force, poles, work, step):  # type: ignore[no-untyped-def]
    """Let a ``step`` [s] pass by the method of Runge and Kutta of fourth order; ``work`` (6, 6) is workspace."""
    slopes(state, force, poles, work[0])
    for part in range(3):
        share = 1.0 if part == 2 else 0.5
        for i in range(6):
            work[5, i] = state[i] + share * step * work[part, i]
        slopes(work[5], force, poles, work[part + 1])
    for i in range(6):
        state[i] += step / 6.0 * (work[0, i] + 2.0 * work[1, i] + 2.0 * work[2, i] + work[3, i])


@kernel
def attempt(network, seen, units, state, poles, most):  # type: ignore[no-untyped-def]
    """Let ``network`` balance from ``state`` (6,) for at most so many decisions; return steps and Gruau's fitness."""
    work, moved = np.zeros((6, 6)), np.zeros(100)
    steps = 0
    while steps < most:
        seen[0, 0] = state[0] / TRACK
        seen[1, 0], seen[2, 0] = state[2] / STEEPEST, state[4] / STEEPEST
        recur(network, seen, units)
        force = FORCE * units[0, 0]
        for _ in range(STEPS_A_DECISION):
            advance(state, force, poles, work, STEP)
        if abs(state[0]) > TRACK or abs(state[2]) > STEEPEST or abs(state[4]) > STEEPEST:
            break
        moved[steps % 100] = abs(state[0]) + abs(state[1]) + abs(state[2]) + abs(state[3])
        steps += 1
    still = 0.75 / moved.sum() if steps >= 100 else 0.0
    return steps, 0.1 * steps / SHORT + 0.9 * still


def tried(network: NDArray[np.float32], most: int, state: NDArray[np.float64] | None = None) -> Attempt:
    """Return what ``network`` does in at most so many decisions, from ``state`` (6,) or the usual beginning."""
    begin = np.array([0.0, 0.0, LEANING, 0.0, 0.0, 0.0]) if state is None else state.copy()
    (seen,), (units,) = memory_of(1, INPUTS, UNITS, 1)
    return Attempt(*attempt(network, seen, units, begin, POLES, most))


def beginnings() -> NDArray[np.float64]:
    """Return Gruau's 625 beginnings, shape (625, 6): five places and speeds each of the cart and the long pole."""
    shares = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    ranges = np.array([[-2.16, 2.16], [-1.35, 1.35], np.radians([-3.6, 3.6]), np.radians([-8.6, 8.6])])
    values = ranges[:, :1] + shares * (ranges[:, 1:] - ranges[:, :1])
    found = np.zeros((625, 6))
    found[:, :4] = np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(625, 4)
    return found


def generalises(network: NDArray[np.float32]) -> int:
    """Return from how many of :func:`beginnings` the poles stay up for 1,000 decisions."""
    return sum(tried(network, SHORT, state).steps == SHORT for state in beginnings())


def evolve(
    fitness: str, seed: int, settings: SubPopulationSettings = SETTINGS, generations: int = GENERATIONS
) -> Solved:
    """Evolve a network until the task is solved, see the top of this module, or for so many ``generations``."""
    random = np.random.default_rng(seed)
    neurons = first_neurons(UNITS, INPUTS + UNITS, settings, random)
    best, highest, evaluations, stagnant = neurons[:, 0], -np.inf, 0, 0
    for _ in range(generations):
        chosen, networks = draw_networks(neurons, settings.trials, random)
        earned = np.zeros(len(networks))
        for place, network in enumerate(networks):
            evaluations += 1
            done = tried(network, LONG if fitness == "steps" else SHORT)
            earned[place] = done.steps if fitness == "steps" else done.damping
            if fitness == "steps" and done.steps == LONG:
                return Solved(evaluations, True, network)
        champion = networks[earned.argmax()]
        if fitness == "damping" and tried(champion, LONG).steps == LONG and generalises(champion) >= ENOUGH:
            return Solved(evaluations, True, champion)
        stagnant += 1
        if earned.max() > highest:
            best, highest, stagnant = champion, earned.max(), 0
        if stagnant >= settings.stagnation:
            neurons, stagnant = burst(best, settings, random), 0
        else:
            neurons = recombine(neurons, mean_fitness(chosen, earned, settings.neurons), settings, random)
    return Solved(evaluations, False, best)


def measure() -> Iterator[str]:
    """Yield a line for each fitness."""
    runs = environment.whole("PNEUMARM_POLES_RUNS", 50)
    first = environment.whole("PNEUMARM_POLES_SEED", 0, 0)
    for fitness in environment.several("PNEUMARM_POLES_FITNESS", FITNESSES):
        began = time.perf_counter()
        found = [evolve(fitness, seed) for seed in range(first, first + runs)]
        taken = np.array([one.evaluations for one in found])
        low, middle, high = np.quantile(taken, (0.25, 0.5, 0.75))
        failed = sum(not one.is_solved for one in found)
        reach = np.median([generalises(one.network) for one in found])
        reported = REPORTED[fitness]
        yield (
            f"{fitness}: {runs} runs, {failed} without a solution; evaluations: median {middle:,.0f}, quartiles "
            f"{low:,.0f} and {high:,.0f}, mean {taken.mean():,.0f}, most {taken.max():,}; reported: mean "
            f"{reported:,}, {'within' if middle <= reported else 'OVER'} it; solutions keep the poles up from "
            f"{reach:.0f} of 625 beginnings (median); {time.perf_counter() - began:.0f} s"
        )
