"""The whole job, stage by stage, from an arm to a controller that adapts on it; it can be interrupted anywhere.

A folder holds a run: ``settings.json`` (what was asked for), ``transitions.db``, ``simulation.safetensors``,
``agent.safetensors``, ``adapted.safetensors``, ``episodes.csv``, ``report.html``, and ``results.json``, which
grows by the stages that are done. A second call with the same folder goes on after the last of them.
"""

import json
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pneumarm.arm import Arm
from pneumarm.console import Report, jsonable
from pneumarm.control.transfer import TransferSettings, transfer
from pneumarm.errors import UnusableInput
from pneumarm.files import write_json
from pneumarm.learning import Agent, TrainSettings, begin_states, train
from pneumarm.learning import test as test_agent
from pneumarm.report import write_report
from pneumarm.simulation import FitSettings, Simulation, fit_store
from pneumarm.transitions import CollectSettings, Store, collect

Progress = Callable[[str], AbstractContextManager[Report]]


@dataclass(frozen=True)
class RunSettings:
    """What a run is asked for. A folder is resumed with the same settings only."""

    arm: str = "virtual"
    seed: int = 0
    transitions: int = 200_000
    """How many to collect (thesis section 3.2.2: 200,000, two hours)."""
    collect: CollectSettings = field(default_factory=CollectSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    train: TrainSettings = field(default_factory=TrainSettings)
    transfer: TransferSettings = field(default_factory=TransferSettings)
    test_episodes: int = 10_000
    """Movements of the test in simulation (thesis section 5.2)."""


@dataclass(frozen=True)
class RunFolder:
    """The files of a run."""

    path: Path

    def __getattr__(self, name: str) -> Path:
        raise AttributeError(name)

    @property
    def settings(self) -> Path:
        """What was asked for."""
        return self.path / "settings.json"

    @property
    def results(self) -> Path:
        """What came of it, stage by stage."""
        return self.path / "results.json"

    @property
    def store(self) -> Path:
        """All transitions: collected, and of the movements in transfer."""
        return self.path / "transitions.db"

    @property
    def simulation(self) -> Path:
        """The fitted simulation."""
        return self.path / "simulation.safetensors"

    @property
    def agent(self) -> Path:
        """The agent as trained in simulation."""
        return self.path / "agent.safetensors"
