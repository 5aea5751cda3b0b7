"""Fitting a simulation further to the newest movements of an arm, few or many.

    1  the weights of the outputs, by ridge regression around what they were    11 numbers an output
    2  all weights, by Levenberg-Marquardt around those, on the movements and on rehearsed ones; with two hidden
       layers by some steps of gradient descent

Few movements determine few numbers, so the first step does most of the work then. The second would forget what the
movements do not show, as those of a policy use few of the actions; it is held by its anchor, and by transitions
that the simulation of the *first* step says of actions drawn at random (A. Robins, "Catastrophic forgetting,
rehearsal and pseudorehearsal", Connection Science 7(2), 1995). That one knows already, roughly, how the arm is now;
rehearsing the old simulation would call back what is no longer so.

Measured on three arms of which a muscle had been exchanged: error over that of the fit (geometric mean over the
quantities), on other movements of the policy / under random actions; 1.59 / 1.44 without refitting.

    movements            10           20           40           80           160
    step 1 alone      1.15 / 1.30  1.12 / 1.25  1.11 / 1.27  1.10 / 1.23  1.09 / 1.22
    steps 1 and 2     1.11 / 1.27  1.07 / 1.23  1.05 / 1.24  1.02 / 1.18  0.99 / 1.16
    rehearsing the
    old simulation    2.77 / 6.03  1.90 / 5.06  1.18 / 2.85  1.05 / 1.55  1.03 / 1.33

Whether the refitted simulation is better is decided by cross-validation: each part of the movements is predicted by a
fit to the others.

Where the recording that the simulation was fitted to is at hand, and the arm is as it was then, nothing need be
rehearsed: the fit goes on with that recording and the movements together, to single steps and to several
(:func:`refit_to_all`).
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.adaptation.change import error_squares
from pneumarm.arm.valves import VALVES
from pneumarm.networks import LevenbergMarquardt, Network, gradient_descent, levenberg_marquardt
from pneumarm.settings import NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt, Settings
from pneumarm.simulation.fit import FitSettings, fitted_on
from pneumarm.simulation.quality import residue
from pneumarm.simulation.simulation import Simulation
from pneumarm.simulation.spread import spread_over_periods
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.store import Store
from pneumarm.transitions.window import Transitions, Window, transitions

Floats = NDArray[np.float64]
_SWITCHES = 0.2  # how often a rehearsed action is another than the one before
_PASSES, _RATE = 10, 3e-4  # of gradient descent: passes for an epoch, and its learning rate
_REHEARSED = 2 / 3  # s; length of a rehearsed movement, twice that of one of the policy


@dataclass(frozen=True)
class RefitSettings(Settings):
    """How a simulation is fitted further."""

    newest: Annotated[int, Meta(ge=2)] = 400
    """Movements that it is fitted to, the newest ones since the arm changed."""
    folds: Annotated[int, Meta(ge=2)] = 4
    """Parts of these, each predicted by a fit to the others to judge it."""
    gain: Annotated[float, Meta(ge=0, lt=1)] = 0.05
    """Part by which the mean squared errors must be lower, as a mean over the quantities predicted."""
    certainty: NonNegativeFloat = 2.0
    """Standard errors, over movements, by which they must be lower by more than that."""
    ridge: PositiveFloat = 10.0
    """Weight of what the output weights were, in transitions."""
    anchor: NonNegativeFloat = 300.0
    """Weight of what all weights were after that, in transitions."""
    rehearsed: NonNegativeFloat = 0.5
    """Rehearsed transitions for each of the arm's."""
    fewest_rehearsed: NonNegativeInt = 1000
    """Fewest of these."""
    epochs: PositiveInt = 10
    """Epochs of Levenberg-Marquardt."""


@dataclass(frozen=True)
class Refit:
    """What came of a refit."""

    simulation: Simulation
    """The simulation refitted to all movements; its error is that of the cross-validation."""
    movements: int
    """Movements that it was fitted to."""
    before: Floats
    """Root mean square of the errors of the simulation in use, shape (outputs,) [sensor units]."""
    after: Floats
    """The same of the refitted one, on movements that were not fitted."""
    better: bool
    """Whether that is an improvement."""


def refit(now: Simulation, origin: Simulation, rows: Rows, settings: RefitSettings, seed: int) -> Refit | None:
    """Return ``origin`` fitted to ``rows`` and whether it is better than ``now``; None with too few movements.

    Scaling, window and spec stay as they are, so that a policy of the one can act in the other.
    """
    found = transitions(rows, now.window)
    numbers = np.unique(found.sequence)
    if len(numbers) < 2 * settings.folds:
        return None
    fold = np.searchsorted(numbers, found.sequence) * settings.folds // len(numbers)  # neighbours stay together
    predicted = np.empty((len(fold), now.window.observation_size))
    for each in range(settings.folds):
        fitted = _fitted(origin, _part(found, fold != each), settings, seed)
        predicted[fold == each] = residue(fitted, _part(found, fold == each))
    whole = _fitted(origin, found, settings, seed)
    old, new = (values[:, now.outputs] ** 2 for values in (residue(now, found), predicted))
    window, rms = now.window, np.sqrt(np.mean(predicted**2, axis=0))
    pressure, further = window.of_joints(found.target)[..., -2:], found.target[:, window.joint_size :]
    reached = replace(
        whole,
        pressure_range=_reaching(origin.pressure_range, pressure),
        further_range=_reaching(origin.further_range, further),
    )
    return Refit(
        simulation=reached.with_errors(rms),
        movements=len(numbers),
        before=np.sqrt(old.mean(axis=0)),
        after=np.sqrt(new.mean(axis=0)),
        better=_is_better(old[:, now.measured], new[:, now.measured], found.sequence, settings),
    )


def refit_to_all(now: Simulation, store: Store, rows: Rows, ahead: float = FitSettings.ahead) -> Refit:
    """Return ``now`` fitted on to all that ``store`` holds: a recording, and the movements, whose ``rows`` are given.

    ``ahead`` is how far ahead [s]; 0 for single steps alone.

    It is meant for an arm that is as it was when it was recorded, and taken to be better: it knows more.
    """
    found = transitions(rows, now.window)
    whole = fitted_on(now, store, ahead, found)
    pressure, further = now.window.of_joints(found.target)[..., -2:], found.target[:, now.window.joint_size :]
    reached = replace(
        whole,
        pressure_range=_reaching(now.pressure_range, pressure),
        further_range=_reaching(now.further_range, further),
    )
    before, after = (np.sqrt(np.mean(residue(one, found)[:, now.outputs] ** 2, axis=0)) for one in (now, reached))
    return Refit(reached, len(np.unique(found.sequence)), before, after, better=True)


def _is_better(old: Floats, new: Floats, sequence: NDArray[np.int64], settings: RefitSettings) -> bool:
    """Whether squared errors ``new`` (n, outputs) are surely lower than ``old``, with movements as the samples."""
    gained = ((old - new) / np.maximum(old.mean(axis=0), 1e-30)).mean(axis=1)
    _, of = np.unique(sequence, return_inverse=True)
    count = np.bincount(of)
    total = np.bincount(of, gained) - settings.gain * count  # of each movement, above what is asked for
    error = total.std(ddof=1) * math.sqrt(len(total))
    return bool(total.sum() > settings.certainty * error)


def _fitted(origin: Simulation, known: Transitions, settings: RefitSettings, seed: int) -> Simulation:
    first = replace(origin, networks=_outputs_fitted(origin, known, settings.ridge))
    count = max(settings.fewest_rehearsed, round(settings.rehearsed * len(known.inputs)))
    rehearsed = rehearse(first, known, count, np.random.default_rng([seed, len(known.inputs)]))
    if origin.spread:  # what was recorded says nothing of pulses, and they are not to be forgotten
        rehearsed = spread_over_periods(first, rehearsed, seed)
    x, y = (np.concatenate(pair) for pair in zip(_scaled(first, known), _scaled(first, rehearsed), strict=True))
    return replace(first, networks=_all_fitted(first, x, y, settings))


def _scaled(simulation: Simulation, known: Transitions) -> tuple[Floats, Floats]:
    """Return scaled inputs, and the changes that are to be predicted of them in errors of the fit."""
    places = simulation.outputs
    change = known.target[:, places].astype(np.float64) - known.inputs[:, places]
    read = simulation.scaling.inputs(known.inputs, simulation.window) * simulation.reads  # the others keep no weight
    return read, change / np.sqrt(error_squares(simulation))


def _columns(simulation: Simulation) -> list[NDArray[np.int64]]:
    """Return which outputs each network has."""
    return np.array_split(np.arange(len(simulation.outputs)), len(simulation.networks))


def _unit(simulation: Simulation) -> Floats:
    """Return what an error of the fit is in the networks' own scale, shape (outputs,)."""
    unit: Floats = np.sqrt(error_squares(simulation)) / simulation.scaling.observation_scale[simulation.outputs]
    return unit


def _outputs_fitted(simulation: Simulation, known: Transitions, ridge: float) -> tuple[Network, ...]:
    """Return the networks with output weights fitted to ``known``, by ridge regression around what they were."""
    x, y = _scaled(simulation, known)
    unit, fitted = _unit(simulation), []
    for network, of_it in zip(simulation.networks, _columns(simulation), strict=True):
        hidden = np.concatenate([network.units(x), np.ones((len(x), 1))], axis=1)
        weights = np.concatenate([network.output_weights, network.output_bias[None]]) / unit[of_it]
        normal = hidden.T @ hidden + ridge * np.eye(hidden.shape[1])
        weights = (weights + np.linalg.solve(normal, hidden.T @ (y[:, of_it] - hidden @ weights))) * unit[of_it]
        fitted.append(replace(network, output_weights=weights[:-1], output_bias=weights[-1]))
    return tuple(fitted)


def _all_fitted(simulation: Simulation, x: Floats, y: Floats, settings: RefitSettings) -> tuple[Network, ...]:
    """Return the networks fitted to ``x`` and ``y``, anchored where they are."""
    solver = LevenbergMarquardt(epochs=settings.epochs, decay=settings.anchor / len(x), anchored=True)
    unit, read = _unit(simulation), np.flatnonzero(simulation.reads)
    seen = np.ascontiguousarray(x[:, read])

    def fitted(network: Network, of_it: NDArray[np.int64]) -> Network:
        if network.second_weights is None:
            scale, fit = unit[of_it], partial(levenberg_marquardt, settings=solver)
        else:  # short steps, and few, leave it where it was as an anchor does
            scale = unit[of_it] * y[:, of_it].std(axis=0)
            fit = partial(gradient_descent, passes=_PASSES * settings.epochs, rate=_RATE)
        start, target = network.reading(read).times(1 / scale), y[:, of_it] * unit[of_it] / scale
        return fit(seen, target, start).network.times(scale).widened(read, x.shape[1])

    with ThreadPoolExecutor(os.cpu_count() or 1) as threads:  # kernels, which release Python's lock
        return tuple(threads.map(fitted, simulation.networks, _columns(simulation)))


def rehearse(simulation: Simulation, known: Transitions, count: int, random: np.random.Generator) -> Transitions:
    """Return ``count`` transitions that ``simulation`` predicts of actions drawn at random.

    Movements begin in the states in which those of ``known`` begin, or in any where there is none.
    """
    window = simulation.window
    began = known.inputs[known.step == 0]
    sigma = (began if len(began) else known.inputs)[:, : window.state_size]
    steps = max(round(_REHEARSED / simulation.spec.period), 1)
    lanes = -(-count // steps)
    sigma = sigma[random.integers(len(sigma), size=lanes)]
    actions = random.integers(len(VALVES), size=(lanes, window.joints))
    valves = VALVES * (np.arange(2) < simulation.spec.muscles)
    inputs, target = [], []
    for _ in range(steps):
        drawn = random.integers(len(VALVES), size=actions.shape)
        actions = np.where(random.random(actions.shape) < _SWITCHES, drawn, actions)
        command = valves[actions].reshape(lanes, window.command_size).astype(np.float32)
        inputs.append(np.concatenate([sigma, command], axis=1))
        target.append(simulation.predict(inputs[-1]).astype(np.float32))
        sigma = _advanced(sigma, target[-1], command, window)
    zeros = np.zeros(count)
    return Transitions(
        inputs=np.concatenate(inputs)[:count],
        target=np.concatenate(target)[:count],
        sequence=zeros.astype(np.int64),
        step=zeros.astype(np.int64),
        interval=np.full(count, simulation.spec.period, np.float32),
        time=zeros,
    )


def _advanced(
    sigma: NDArray[np.float32], observation: NDArray[np.float32], command: NDArray[np.float32], window: Window
) -> NDArray[np.float32]:
    """Return the states (n, state_size) a step later."""
    past = window.history * window.observation_size
    observed, commanded = sigma[:, :past], sigma[:, past : window.state_size - window.memory_size]
    commands = np.concatenate([command, commanded], axis=1)[:, : commanded.shape[1]]
    memory = window.remembered(sigma, observation)
    return np.concatenate([observation, observed[:, : -window.observation_size], commands, memory], axis=1)


def _reaching(limits: Floats, read: NDArray[np.float32]) -> Floats:
    """Return the range ``limits`` (..., 2) of readings, wide enough for all that were ``read`` (n, ...)."""
    low, high = np.moveaxis(limits, -1, 0)
    found = read.astype(np.float64)
    return np.stack([np.minimum(low, found.min(axis=0)), np.maximum(high, found.max(axis=0))], axis=-1)


def _part(found: Transitions, chosen: NDArray[np.bool_]) -> Transitions:
    return Transitions(**{name: values[chosen] for name, values in found._asdict().items()})
