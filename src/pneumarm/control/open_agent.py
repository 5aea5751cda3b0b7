"""Agents by their files: trained ones of any kind, and simulations, in which is planned."""

from pathlib import Path

from pneumarm.control.versions import agent_file
from pneumarm.files import kind_of
from pneumarm.learning import AnyAgent, find_method, load_agent
from pneumarm.learning.planned.agent import PlanAgent
from pneumarm.simulation.simulation import KIND as SIMULATION


def open_agent(path: Path, method: str | None = None) -> AnyAgent:
    """Return the agent in ``path``, a file or a run's folder; that of a simulation gives one that plans in it.

    ``method`` is a method of one's own, MODULE:NAME, whose agents may be read; see :mod:`pneumarm.learning.methods`.

    Raises:
        UnusableInput: ``path`` is neither, is damaged, or does not fit together; or there is no such method.

    """
    if method is not None:
        find_method(method)  # which imports it
    path = agent_file(path)
    return PlanAgent.load(path) if kind_of(path) == SIMULATION else load_agent(path)
