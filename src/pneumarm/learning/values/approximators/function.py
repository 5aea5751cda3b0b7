"""A function of states with some outputs, learned step by step along eligibility traces (section 4.2.5, Algorithm 2).

    delta = target - V(s)
    e     = e + grad V(s)                    accumulating; replacing: e = grad V(s) where that is larger
    w     = w + beta delta e                 beta constant, or 1 / k for what was visited k times (section 4.2.3)
    e     = gamma lambda e

All approximators are one to those who learn: :func:`look` at a state, then ask for the :func:`value` of an output,
:func:`add_trace` of it, :func:`follow` the traces. Linear ones keep a list of the traces that are not 0.

Sources: Sutton and Barto, Reinforcement Learning, sections 9.3 and 12.2; S. P. Singh and R. S. Sutton, "Reinforcement
learning with replacing eligibility traces", Machine Learning 22, 1996.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel, part
from pneumarm.learning.values.approximators.coding import KANERVA, NETWORK, RADIAL, TABLE, TILES, Coding
from pneumarm.learning.values.approximators.kanerva import write_kanerva
from pneumarm.learning.values.approximators.network import (
    activate,
    add_network_gradient,
    follow_network,
    network_shape,
    network_value,
)
from pneumarm.learning.values.approximators.radial import write_radial
from pneumarm.learning.values.approximators.table import write_table
from pneumarm.learning.values.approximators.tiles import write_tiles

_LEAST = 1e-3  # smaller traces are forgotten


class ValueFunction(NamedTuple):
    """A function for each of some agents as a kernel changes it. Made by :func:`value_function`."""

    coding: Coding
    weights: NDArray[np.float32]
    """Shape (agents, outputs, features); of networks (agents, inputs + rows, units), see :mod:`.network`."""
    visits: NDArray[np.float32]
    """How often each weight was active, same shape; (agents, 0, 0) where step sizes are constant."""
    traces: NDArray[np.float32]
    """Eligibility of each weight, same shape."""
    listed: NDArray[np.bool_]
    """Which traces are not 0, shape (agents, weights); of networks which groups, at their first units."""
    entries: NDArray[np.int32]
    """Places of these traces, shape (agents, weights) ..."""
    traced: NDArray[np.int64]
    """... and how many they are, shape (agents,)."""
    places: NDArray[np.int64]
    """The active features of the state looked at, shape (most,) ..."""
    amounts: NDArray[np.float32]
    """... how active they are, same shape ..."""
    active: NDArray[np.int64]
    """... and how many, shape (1,)."""
    hidden: NDArray[np.float32]
    """Workspace of networks, shape (units,)."""
    slope: NDArray[np.float32]
    """Workspace of networks, shape (width,)."""
    inputs: int
    groups: int
    width: int
    """Of networks: inputs, groups of hidden units, and units of a group."""
    scale: float
    """Value that an output of 1 stands for."""
    is_replacing: bool


def function_shape(
    coding: Coding, agents: int, outputs: int, inputs: int = 0, hidden: int = 0, groups: int = 1
) -> tuple[int, int, int]:
    """Return the shape of the weights; the last three sizes are those of networks."""
    if coding.kind == NETWORK:
        return agents, *network_shape(inputs, hidden, outputs, groups)
    return agents, outputs, coding.size


def value_function(
    coding: Coding,
    weights: NDArray[np.float32],
    visits: NDArray[np.float32] | None = None,
    *,
    inputs: int = 0,
    groups: int = 1,
    scale: float = 1.0,
    is_replacing: bool = False,
) -> ValueFunction:
    """Return a function that changes ``weights`` and, for step sizes 1 / k, ``visits`` in place."""
    agents, _, units = weights.shape
    is_network = coding.kind == NETWORK
    size = units if is_network else weights[0].size
    width = units // groups if is_network else 1
    return ValueFunction(
        coding=coding,
        weights=weights,
        visits=np.zeros((agents, 0, 0), np.float32) if visits is None else visits,
        traces=np.zeros_like(weights),
        listed=np.zeros((agents, size), np.bool_),
        entries=np.zeros((agents, 0 if is_network else size), np.int32),
        traced=np.zeros(agents, np.int64),
        places=np.zeros(coding.most, np.int64),
        amounts=np.zeros(coding.most, np.float32),
        active=np.zeros(1, np.int64),
        hidden=np.zeros(units if is_network else 0, np.float32),
        slope=np.zeros(width, np.float32),
        inputs=inputs,
        groups=groups,
        width=width,
        scale=float(scale),
        is_replacing=is_replacing,
    )


@kernel
def write_features(coding, z, places, amounts):  # type: ignore[no-untyped-def]
    """Write the active features of the state ``z`` (variables,) and how active they are; return how many."""
    if coding.kind == TABLE:
        return write_table(coding, z, places, amounts)
    if coding.kind == TILES:
        return write_tiles(coding, z, places, amounts)
    if coding.kind == RADIAL:
        return write_radial(coding, z, places, amounts)
    if coding.kind == KANERVA:
        return write_kanerva(coding, z, places, amounts)
    return 0


@kernel
def look(function, agent, z):  # type: ignore[no-untyped-def]
    """Look at the state ``z`` (variables,) with the eyes of ``agent``."""
    if function.coding.kind == NETWORK:
        activate(function, agent, z)
    else:
        function.active[0] = write_features(function.coding, z, function.places, function.amounts)


@part(entry=True)
def value(function, agent, output):  # type: ignore[no-untyped-def]
    """Return the value of an ``output`` in the state looked at."""
    total = np.float32(0.0)
    if function.coding.kind == NETWORK:
        total = network_value(function, agent, output)
    else:
        for k in range(function.active[0]):
            total += function.amounts[k] * function.weights[agent, output, function.places[k]]
    return total * np.float32(function.scale)


@kernel
def add_trace(function, agent, z, output, factor):  # type: ignore[no-untyped-def]
    """Add ``factor`` times the gradient of an ``output`` in the state ``z`` looked at to the traces of ``agent``."""
    if function.coding.kind == NETWORK:
        add_network_gradient(function, agent, z, output, np.float32(factor))
        return
    size, traces = function.coding.size, function.traces[agent]
    for k in range(function.active[0]):
        feature, amount = function.places[k], np.float32(factor * function.amounts[k])
        if not function.listed[agent, output * size + feature]:
            function.listed[agent, output * size + feature] = True
            function.entries[agent, function.traced[agent]] = output * size + feature
            function.traced[agent] += 1
        if function.is_replacing:
            traces[output, feature] = max(traces[output, feature], amount)
        else:
            traces[output, feature] += amount
        if function.visits.shape[1] > 0:
            function.visits[agent, output, feature] += np.float32(1.0)


@kernel
def follow(function, agent, delta, rate, decay):  # type: ignore[no-untyped-def]
    """Move the weights of ``agent`` by the error ``delta`` along their traces, and let these decay."""
    amount, decay = np.float32(rate * delta / function.scale), np.float32(decay)
    if function.coding.kind == NETWORK:
        follow_network(function, agent, amount, decay)
        return
    size, left = function.coding.size, 0
    weights, traces = function.weights[agent], function.traces[agent]
    for k in range(function.traced[agent]):
        place = function.entries[agent, k]
        output, feature = place // size, place % size
        step = amount
        if function.visits.shape[1] > 0:
            step = np.float32(delta / function.visits[agent, output, feature])
        weights[output, feature] += step * traces[output, feature]
        traces[output, feature] *= decay
        if abs(traces[output, feature]) < np.float32(_LEAST):
            traces[output, feature] = np.float32(0.0)
            function.listed[agent, place] = False
        else:
            function.entries[agent, left] = place
            left += 1
    function.traced[agent] = left


@part(entry=True)
def forget_traces(function, agent):  # type: ignore[no-untyped-def]
    """Set the traces of ``agent`` to 0, as at the start of every episode."""
    follow(function, agent, 0.0, 0.0, 0.0)


@kernel
def update(function, agent, z, output, target, rate, decay):  # type: ignore[no-untyped-def]
    """Move an ``output`` in the state ``z`` (variables,) towards ``target``; return the error delta."""
    look(function, agent, z)
    delta = target - value(function, agent, output)
    add_trace(function, agent, z, output, 1.0)
    follow(function, agent, delta, rate, decay)
    return delta
