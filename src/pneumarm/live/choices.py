"""The controllers that a page can choose from: those that were named, and the versions in the folder of a run."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm
from pneumarm.arm.controller import TrackingController
from pneumarm.arm.seam import ArmSpec
from pneumarm.control import Monitor, open_agent
from pneumarm.control.named import open_tracking
from pneumarm.control.versions import ADAPTED, AGENTS, agents_in, kept_versions
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.learning import SimulationAgent
from pneumarm.transitions.watch import made_up_readings


@dataclass(frozen=True)
class Choice:
    """A controller that can be chosen."""

    name: str
    """For people."""
    file: str
    """As :func:`~pneumarm.control.named.open_tracking` takes it."""
    version: int | None = None
    """Of the agent in a run's folder; None where it is none of these."""


@dataclass(frozen=True)
class Mover:
    """A controller that is ready to move the arm."""

    choice: Choice
    controller: TrackingController
    spec: ArmSpec
    goal_range: NDArray[np.float64]
    """Goals that it knows, shape (joints, 2) [counts]."""


def choices_in(folder: Path) -> list[Choice]:
    """Return the controllers that the run in ``folder`` has made, the one to begin with first."""
    found = [Choice("adapted" if file.name == ADAPTED else "as trained", str(file)) for file in agents_in(folder)]
    versions = [
        Choice(f"version {number}", str(folder / AGENTS / f"{number:03d}.safetensors"), number)
        for number in kept_versions(folder)
    ]
    return found + (versions if len(versions) > 1 else [])


def opened(choice: Choice, arm: Arm, method: str | None = None) -> Mover:
    """Return ``choice`` for ``arm``, not yet guarded, after rehearsing: nothing is compiled while the arm moves.

    Raises:
        UnusableInput: it is for another arm, or there is no such controller.

    """
    controller, spec, goals = open_tracking(choice.file, arm, method=method)
    controller.reset(goals.middle)
    for reading in made_up_readings(spec):
        controller.act(reading)
    return Mover(choice, controller, spec, goals.range)


def monitor_for(choice: Choice | None, spec: ArmSpec, method: str | None = None) -> Monitor:
    """Return a monitor that judges the arm by the simulation that the agent knows; by rules where there is none."""
    if choice is not None:
        try:
            agent = open_agent(Path(choice.file), method)
        except PneumarmError:
            return Monitor(spec)  # a tuned controller, or a plan
        if isinstance(agent, SimulationAgent):
            try:
                return Monitor(spec, agent.simulation)
            except UnusableInput:
                return Monitor(spec)  # of continuous commands
    return Monitor(spec)
