"""How agents move, as commands show it: settling, with what is normal, and reaching, the thesis' task."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from pneumarm.console import table
from pneumarm.learning.agents import AnyAgent, goals_of
from pneumarm.moving.told import IN_SIMULATION, ON_THE_ARM, Normal, told_figures
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.simulation import Simulation, SimulationArm


def settled_in(simulation: Simulation, agent: AnyAgent, seed: int = 0) -> dict[str, Any] | None:
    """Return how ``agent`` settles in ``simulation``, as in ``results.json``; None if it only reaches goals."""
    controller = agent.controller()
    if controller is None or not simulation.valves:
        return None
    with SimulationArm(simulation, seed=seed) as arm:
        tried = try_moving(arm, controller, goals_of(agent), MoveTrialSettings(frequencies=()), seed=seed)
    found: dict[str, Any] = tried.results()["settle"]
    return found


def settling_told(found: Mapping[str, Any]) -> list[Table | str]:
    """Return the figures of settling in a simulation with what is normal there, and why an arm does better."""
    why = "The simulation adds what it does not know of the arm as noise: on the arm more goals are settled at."
    return [table(("settling, in the simulation", "", "normal"), figure_rows(found, IN_SIMULATION)), why]


def figure_rows(found: Mapping[str, Any], normal: Normal = ON_THE_ARM) -> list[tuple[str, str, str]]:
    """Return the figures of settling as rows of a table; one that is not normal says so."""
    return [
        (one.name, one.value, one.normal if one.is_normal else f"{one.normal} (!)")
        for one in told_figures(found, normal)
    ]


def reaching_table(made: Mapping[str, Mapping[str, Any]], *, trained_for: bool) -> Table:
    """Return what came of reaching goals; movements ``made`` by an agent for another task say so."""
    rows = [
        (name, one["episodes"], one["reward"], f"{100 * one['success_rate']:.4g}", one["actions"], one["switches"])
        for name, one in made.items()
    ]
    title = "" if trained_for else "The thesis' task, for which this agent was not trained"
    return table(("reaching goals", "movements", "reward", "success [%]", "actions", "switches"), rows, title=title)
