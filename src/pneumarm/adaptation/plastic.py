"""The numbers of an agent that an adaptation changes: its weights, and its simulation's networks and errors."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.agents import Adapts
from pneumarm.networks import Network

_LAYERS = ("hidden_weights", "hidden_bias", "second_weights", "second_bias", "output_weights", "output_bias")
_KNOWN = ("error_std", "pressure_range", "further_std", "further_range")


def plastic(agent: Adapts) -> NDArray[np.float64]:
    """Return all numbers of ``agent`` that an adaptation changes, one after the other."""
    return np.concatenate([part.astype(np.float64).ravel() for part in _parts(agent)])


def with_plastic(agent: Adapts, numbers: NDArray[np.float64]) -> Adapts:
    """Return ``agent`` with other ``numbers``, as of :func:`plastic`."""
    parts = _parts(agent)
    ends = np.cumsum([part.size for part in parts])
    taken = [numbers[e - p.size : e].reshape(p.shape).copy() for e, p in zip(ends, parts, strict=True)]
    weights, known, layers = taken[0], taken[1 : 1 + len(_KNOWN)], taken[1 + len(_KNOWN) :]
    left = iter(layers)
    networks = tuple(
        Network(**{name: next(left) for name in _layers_of(network)}) for network in agent.simulation.networks
    )
    changed: dict[str, Any] = dict(zip(_KNOWN, known, strict=True))
    simulation = replace(agent.simulation, networks=networks, **changed)
    return agent.revised(simulation, weights.astype(np.float32))


def _parts(agent: Adapts) -> list[NDArray[np.floating]]:
    simulation = agent.simulation
    layers = [getattr(network, name) for network in simulation.networks for name in _layers_of(network)]
    return [agent.weights(), *(getattr(simulation, name) for name in _KNOWN), *layers]


def _layers_of(network: Network) -> list[str]:
    return [name for name in _LAYERS if getattr(network, name) is not None]
