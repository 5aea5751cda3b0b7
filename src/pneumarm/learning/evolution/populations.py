"""Enforced Sub-Populations: every unit of a recurrent network is evolved in a population of its own.

    draw one neuron from each subpopulation; they are a network; its fitness is added to that of each of them
    repeat until every neuron has been in as many networks as it gets trials
    rank the neurons of each subpopulation by their mean fitness
    cross each of the best quarter with another of that quarter; their offspring replace the worst half
    mutate one weight of some of those below the best half by Cauchy noise
    if the best network has not improved for long: burst, i.e. draw all neurons around those of that network

Sources: thesis section 4.5.2; F. Gomez and R. Miikkulainen, "Solving non-Markovian control tasks with
neuroevolution", IJCAI 1999; F. Gomez, "Robust non-linear control through neuroevolution", PhD thesis, University of
Texas at Austin, 2003, chapter 4.

Differences from them:

1. Networks are drawn in rounds in which every neuron takes part once, so all get exactly as many trials.
2. The number of units is fixed; there they are changed where two bursts in a row do not help.
3. Neurons get 2 trials instead of 10, first weights up to 1 instead of 6, all neurons below the best half mutate
   instead of 0.4 of them, by 0.6 instead of 0.3, and bursts come after 8 generations instead of 20. With theirs, two
   poles without velocities took this code far more evaluations (``python -m benchmarks double_poles``).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.settings import PositiveFloat, PositiveInt, Settings, Share

_BREEDING = 4  # a quarter of each subpopulation has offspring, two each


@dataclass(frozen=True)
class SubPopulationSettings(Settings):
    """How neurons are evolved."""

    neurons: Annotated[int, Meta(ge=_BREEDING, le=10_000)] = 40
    """Neurons in each subpopulation."""
    trials: PositiveInt = 2
    """Networks that each neuron takes part in, in a generation."""
    mutation: Share = 1.0
    """Share of the neurons below the best half of which one weight is changed."""
    spread: PositiveFloat = 0.6
    """Scale of the Cauchy noise, of mutations and of bursts."""
    initial_weight: PositiveFloat = 1.0
    """First weights are uniform up to this size."""
    stagnation: PositiveInt = 8
    """Generations without improvement of the best network after which there is a burst."""


def first_neurons(
    units: int, genes: int, settings: SubPopulationSettings, random: np.random.Generator
) -> NDArray[np.float32]:
    """Return random neurons, shape (units, neurons, genes): a subpopulation for each of the ``units``."""
    most = settings.initial_weight
    return random.uniform(-most, most, (units, settings.neurons, genes)).astype(np.float32)


def draw_networks(
    neurons: NDArray[np.float32], trials: int, random: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return which neurons make networks, shape (networks, units), and the networks, shape (networks, units, genes).

    There are ``trials`` times as many as there are neurons in a subpopulation; every neuron is in ``trials`` of them.
    """
    units, count, _ = neurons.shape
    rounds = np.tile(np.arange(count), (trials, units, 1))
    chosen = random.permuted(rounds, axis=2).transpose(0, 2, 1).reshape(trials * count, units)
    return chosen, np.ascontiguousarray(neurons[np.arange(units), chosen])


def mean_fitness(chosen: NDArray[np.int64], fitness: NDArray[np.float64], neurons: int) -> NDArray[np.float64]:
    """Return the mean fitness of the networks that each neuron was ``chosen`` for, shape (units, neurons)."""
    per_unit = [
        np.bincount(column, fitness, neurons) / np.maximum(np.bincount(column, minlength=neurons), 1)
        for column in chosen.T
    ]
    return np.stack(per_unit)


def recombine(
    neurons: NDArray[np.float32],
    fitness: NDArray[np.float64],
    settings: SubPopulationSettings,
    random: np.random.Generator,
) -> NDArray[np.float32]:
    """Return the next generation of ``neurons`` with the mean ``fitness`` (units, neurons), the best first."""
    units, count, genes = neurons.shape
    order = np.argsort(-fitness, axis=1, kind="stable")
    evolved = np.take_along_axis(neurons, order[:, :, None], axis=1)
    breeding = count // _BREEDING
    for population in evolved:
        for parent in range(breeding):
            mate, point = int(random.integers(breeding)), int(random.integers(genes))
            one, other = population[parent], population[mate]
            population[-2 * parent - 1] = np.concatenate([one[:point], other[point:]])
            population[-2 * parent - 2] = np.concatenate([other[:point], one[point:]])
    below = np.arange(count) >= 2 * breeding
    mutated = below & (random.random((units, count)) < settings.mutation)
    unit, place = np.nonzero(mutated)
    gene = random.integers(genes, size=unit.size)
    evolved[unit, place, gene] += settings.spread * random.standard_cauchy(unit.size).astype(np.float32)
    return evolved


def burst(
    best: NDArray[np.float32], settings: SubPopulationSettings, random: np.random.Generator
) -> NDArray[np.float32]:
    """Return subpopulations around the neurons of the ``best`` network (units, genes), which they hold first."""
    units, genes = best.shape
    noise = settings.spread * random.standard_cauchy((units, settings.neurons, genes))
    noise[:, 0] = 0.0
    return (best[:, None] + noise).astype(np.float32)
