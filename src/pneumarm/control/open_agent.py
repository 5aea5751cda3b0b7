"""Agents by their files: trained ones of any kind, and simulations, in which is planned."""

from pathlib import Path

from pneumarm.files import kind_of
from pneumarm.learning import AnyAgent, load_agent
from pneumarm.planning.agent import PlanAgent
from pneumarm.simulation.simulation import KIND as SIMULATION


def open_agent(path: Path) -> AnyAgent:
    """Return the agent in ``path``; the file of a simulation gives one that plans in it.

    Raises:
        UnusableInput: ``path`` is neither, is damaged, or does not fit together.

    """
    return PlanAgent.load(path) if kind_of(path) == SIMULATION else load_agent(path)
