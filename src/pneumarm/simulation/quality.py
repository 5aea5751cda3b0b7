"""How good a simulation is: residues, isoplots, statistics, error propagation, validity (thesis section 3.3, 3.4).

Functions of arrays that draw nothing. Columns are those of an observation: angle [counts], velocity [counts/ms],
pressure 1 and 2 [counts], joint after joint. What can be long is taken block by block.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.window import Transitions, Window

Floats = NDArray[np.float64]

_BLOCK = 16_384
"""Rows predicted at once."""


# Residue and statistics -----------------------------------------------------------------------------------------


def residue(simulation: Simulation, transitions: Transitions) -> Floats:
    """Return res_k = sim_{k+1} - o_{k+1} (thesis eq. 3.2), shape (n, 4 joints)."""
    result = np.empty(transitions.target.shape)
    for begin in range(0, len(result), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        result[part] = simulation.predict(transitions.inputs[part]) - transitions.target[part]
    return result


class Statistics(NamedTuple):
    """The one-step error over a set of transitions; arrays have the shape (4 joints,)."""

    rows: int
    """Transitions."""
    mean: Floats
    """Mean residue: about 0 in a good fit."""
    std: Floats
    """Standard deviation of the residue (thesis eq. 3.6)."""
    change_std: Floats
    """Standard deviation of the observed change from one step to the next (thesis eq. 3.4)."""
    relative: Floats
    """``std / change_std``: 0 is perfect, 1 no better than to predict the mean change. NaN, as in what follows, where
    nothing can be said because nothing changes."""
    slope: Floats
    """Slope of the isoplot: of the predicted change over the observed one. Under 1 where the change cannot be
    foreseen, be it for lack of a good fit or for noise in the sensors."""
    calibration: Floats
    """Slope of the observed change over the predicted one: 1 in an unbiased fit, noise or not."""


def statistics(simulation: Simulation, sets: Transitions | Iterable[Transitions]) -> Statistics:
    """Return the statistics of the one-step error over transitions, or over blocks of them in bounded memory.

    Raises:
        UnusableInput: there is no transition.

    """
    sums = _Moments(simulation.window.observation_size)
    for transitions in [sets] if isinstance(sets, Transitions) else sets:
        for begin in range(0, len(transitions.target), _BLOCK):
            part = slice(begin, begin + _BLOCK)
            predicted = simulation.predict(transitions.inputs[part])
            now = transitions.observation[part].astype(np.float64)
            sums.add(predicted - now, transitions.target[part] - now)
    if not sums.count:
        raise UnusableInput("there is no transition to judge the simulation on; collect more sequences")
    return sums.statistics()


class _Moments:
    """Mean and covariance of predicted and observed change, merged block by block (Chan et al. 1979)."""

    def __init__(self, size: int) -> None:
        self.count = 0
        self.mean = np.zeros((2, size))
        self.scatter = np.zeros((2, 2, size))

    def add(self, predicted: Floats, observed: Floats) -> None:
        pair = np.stack([predicted, observed])
        count = pair.shape[1]
        mean = pair.mean(axis=1)
        centred = pair - mean[:, None]
        shift = mean - self.mean
        total = self.count + count
        self.scatter += np.einsum("ank,bnk->abk", centred, centred)
        self.scatter += shift[:, None] * shift[None] * (self.count * count / total)
        self.mean += shift * (count / total)
        self.count = total

    def statistics(self) -> Statistics:
        (pp, po), (_, oo) = self.scatter / self.count
        std, change = np.sqrt(np.maximum(pp - 2 * po + oo, 0)), np.sqrt(oo)
        return Statistics(
            rows=self.count,
            mean=self.mean[0] - self.mean[1],
            std=std,
            change_std=change,
            relative=_ratio(std, change),
            slope=_ratio(po, oo),
            calibration=_ratio(po, pp),
        )


def _ratio(a: Floats, b: Floats) -> Floats:
    return np.divide(a, b, out=np.full_like(a, np.nan), where=b > 0)


class Classified(NamedTuple):
    """Values summed up in classes of another quantity (thesis figure 3.2)."""

    edges: Floats
    """Limits of the classes, shape (classes + 1,)."""
    counts: NDArray[np.int64]
    """Values in each class, shape (classes,)."""
    mean: Floats
    """Shape (classes,); NaN in an empty class, as in all that follows."""
    std: Floats
    """Shape (classes,)."""
    quantiles: Floats
    """5th, 50th and 95th percentile, shape (classes, 3)."""


def classified(values: ArrayLike, by: ArrayLike, classes: int | ArrayLike = 20) -> Classified:
    """Return the statistics of ``values`` (n,), such as a residue, in ``classes`` of the quantity ``by`` (n,).

    Any quantity of a transition will do: velocity, time, angle, an input of the window, an action. ``classes`` is a
    number of equal classes between the extremes of ``by``, or their limits in ascending order.
    """
    values, by = np.asarray(values, np.float64), np.asarray(by, np.float64)
    edges = np.histogram_bin_edges(by, bins=classes)
    of = np.clip(np.searchsorted(edges, by, side="right") - 1, 0, len(edges) - 2)
    inside = (by >= edges[0]) & (by <= edges[-1])
    order = np.argsort(of[inside], kind="stable")
    count = np.bincount(of[inside], minlength=len(edges) - 1)
    groups = np.split(values[inside][order], np.cumsum(count)[:-1])
    summary = np.array([_summary(group) for group in groups])
    return Classified(edges, count, summary[:, 0], summary[:, 1], summary[:, 2:])


def _summary(group: Floats) -> Floats:
    if not len(group):
        return np.full(5, np.nan)
    return np.array([group.mean(), group.std(), *np.quantile(group, [0.05, 0.5, 0.95])])


class Isoplot(NamedTuple):
    """Predicted against observed change of one quantity (thesis figures 3.3 to 3.5)."""

    observed: NDArray[np.float32]
    """Observed change of each point (thesis eq. 3.4), shape (points,)."""
    predicted: NDArray[np.float32]
    """Predicted change of each point (thesis eq. 3.3), shape (points,)."""
    density: NDArray[np.int64]
    """Transitions, of all and not only of the points, in the cell of each point, shape (points,)."""
    edges: Floats
    """Limits of the cells, the same on both axes, shape (cells + 1,)."""
    counts: NDArray[np.int64]
    """Transitions in each cell, (observed, predicted), shape (cells, cells)."""


def isoplot_cells(observed: ArrayLike, predicted: ArrayLike, cells: int = 100, points: int = 20_000) -> Isoplot:
    """Return what an isoplot shows: the density in cells, and at most ``points`` evenly chosen points to draw.

    ``observed`` and ``predicted`` are changes from one step to the next, shape (n,).
    """
    observed, predicted = np.asarray(observed, np.float32), np.asarray(predicted, np.float32)
    if not len(observed) or observed.shape != predicted.shape:
        raise ValueError(f"expected as many observed as predicted changes, got {observed.shape}, {predicted.shape}")
    low = float(min(observed.min(), predicted.min()))
    high = float(max(observed.max(), predicted.max()))
    edges = np.linspace(low, high if high > low else low + 1, cells + 1)
    count = np.histogram2d(observed, predicted, bins=[edges, edges])[0].astype(np.int64)
    chosen = np.linspace(0, len(observed) - 1, min(points, len(observed))).astype(np.int64)
    cell = [np.clip(np.searchsorted(edges, v[chosen], "right") - 1, 0, cells - 1) for v in (observed, predicted)]
    return Isoplot(observed[chosen], predicted[chosen], count[cell[0], cell[1]], edges, count)


# Free runs ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Resynchronisation:
    """Replacing the simulated state by the most similar state of the database every so often (thesis section 3.4)."""

    states: NDArray[np.float32]
    """States to choose from, (n, state_size) in sensor units; some ten thousand do."""
    every: int = 10
    """Steps between two replacements (thesis: 10, for example)."""

    def nearest(self, states: Floats, simulation: Simulation) -> Floats:
        """Return for each of ``states`` (m, state_size) the one most similar in scaled units."""
        window, scaling = simulation.window, simulation.scaling
        known = scaling.inputs(self.states, window).astype(np.float32)
        half = 0.5 * np.einsum("nk,nk->n", known, known)
        wanted = scaling.inputs(states, window).astype(np.float32)
        chosen = np.empty(len(states), np.int64)
        for begin in range(0, len(states), 256):
            part = slice(begin, begin + 256)
            chosen[part] = np.argmin(half - wanted[part] @ known.T, axis=1)
        return self.states[chosen].astype(np.float64)


def starts(transitions: Transitions, steps: int, at_most: int = 2000, seed: int = 0) -> NDArray[np.int64]:
    """Return transitions from which ``steps`` transitions follow on each other, at most ``at_most`` at random.

    Raises:
        UnusableInput: no sequence is long enough.

    """
    first = np.arange(len(transitions.step) - steps + 1)
    last = first + steps - 1
    whole = transitions.sequence[first] == transitions.sequence[last]
    whole &= transitions.step[last] - transitions.step[first] == steps - 1
    possible = first[whole]
    if not len(possible):
        raise UnusableInput(f"no sequence has {steps} transitions in a row; ask for fewer steps")
    if len(possible) > at_most:
        possible = np.sort(np.random.default_rng(seed).choice(possible, at_most, replace=False))
    return possible


def free_run(
    simulation: Simulation,
    transitions: Transitions,
    begin: NDArray[np.int64],
    steps: int,
    resynchronisation: Resynchronisation | None = None,
) -> Iterator[tuple[Floats, Floats, NDArray[np.float32]]]:
    """Simulate from the states ``begin`` with the recorded actions, every step from what was simulated before.

    Yields for each step the inputs (starts, input_size) it was simulated from, the simulated observation and the
    recorded one, both (starts, 4 joints).
    """
    window = simulation.window
    inputs = transitions.inputs[begin].astype(np.float64)
    for step in range(steps):
        predicted = simulation.predict(inputs)
        yield inputs, predicted, transitions.target[begin + step]
        if step + 1 == steps:
            return
        command = transitions.inputs[begin + step + 1, window.state_size :]
        inputs = advanced(inputs, predicted, command, window)
        if resynchronisation is not None and (step + 1) % resynchronisation.every == 0:
            states = resynchronisation.nearest(inputs[:, : window.state_size], simulation)
            inputs = np.concatenate([states, command], axis=1)


def advanced(inputs: Floats, observation: Floats, command: ArrayLike, window: Window) -> Floats:
    """Return the inputs (n, input_size) a step later, with a new ``observation`` and the next ``command``."""
    size, past = window.observation_size, window.history * window.observation_size
    kept = inputs[:, : past - size]
    commands = inputs[:, past : window.state_size - window.memory_size]
    last = inputs[:, window.state_size :]
    memory = window.remembered(inputs, observation)
    if window.history == 1:
        return np.concatenate([observation, memory, command], axis=1)
    older = commands[:, : -window.command_size]
    return np.concatenate([observation, kept, last, older, memory, command], axis=1)


class Propagation(NamedTuple):
    """How the error grows when the simulation runs on its own predictions; arrays are (steps, 4 joints)."""

    measured: Floats
    """Standard deviation of the error after 1, 2, ... steps."""
    mean: Floats
    """Mean error after 1, 2, ... steps: the drift."""
    expected: Floats
    """What independent errors would add up to, sqrt(x) std (thesis eq. 3.7), from the error of one step."""
    change_std: Floats
    """Standard deviation of the observed change since the start: the error of a simulation that stands still."""
    runs: int
    """Simulated runs."""


def propagation(
    simulation: Simulation,
    transitions: Transitions,
    steps: int = 30,
    runs: int = 2000,
    seed: int = 0,
    resynchronisation: Resynchronisation | None = None,
) -> Propagation:
    """Measure the error propagation over ``steps`` steps of held-out ``transitions``, beside thesis eq. 3.7.

    The transitions are in the order of their recording; ``runs`` of them are starts.

    Raises:
        UnusableInput: no sequence is long enough.

    """
    begin = starts(transitions, steps, runs, seed)
    started = transitions.observation[begin].astype(np.float64)
    errors = np.empty((steps, 3, transitions.target.shape[1]))
    simulated = free_run(simulation, transitions, begin, steps, resynchronisation)
    for step, (_, predicted, recorded) in enumerate(simulated):
        error = predicted - recorded
        errors[step] = error.std(axis=0), error.mean(axis=0), (recorded - started).std(axis=0)
    expected = np.sqrt(np.arange(1, steps + 1))[:, None] * errors[0, 0]
    return Propagation(errors[:, 0], errors[:, 1], expected, errors[:, 2], len(begin))


class Validity(NamedTuple):
    """How often a simulated run is where no data was (invalid predictions, thesis section 3.4)."""

    simulated: Floats
    """Share of simulated inputs outside the known cells after 0, 1, 2, ... steps, shape (steps,)."""
    recorded: Floats
    """The same of the recorded inputs at these steps: what the grid itself leaves out, shape (steps,)."""
    runs: int
    """Simulated runs."""


def validity(
    simulation: Simulation,
    transitions: Transitions,
    known: Callable[[Floats], NDArray[np.bool_]],
    steps: int = 30,
    runs: int = 2000,
    seed: int = 0,
    resynchronisation: Resynchronisation | None = None,
) -> Validity:
    """Measure how often simulated inputs lie outside of the cells that hold data.

    ``known(inputs)`` tells of inputs (n, input_size) in sensor units whether their cell of the grid holds data.

    Raises:
        UnusableInput: no sequence is long enough.

    """
    begin = starts(transitions, steps, runs, seed)
    outside = np.empty((2, steps))
    simulated = free_run(simulation, transitions, begin, steps, resynchronisation)
    for step, (inputs, _, _) in enumerate(simulated):
        recorded = transitions.inputs[begin + step].astype(np.float64)
        outside[:, step] = [1 - known(states).mean() for states in (inputs, recorded)]
    return Validity(outside[0], outside[1], len(begin))
