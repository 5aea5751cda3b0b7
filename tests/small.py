"""A small run of the whole job: its settings, and what it gives on an arm of another kind."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pneumarm.cli import main as command_line
from pneumarm.learning import ServoSettings, Shaping, TrainSettings
from pneumarm.run import Run, RunSettings, RunTransferSettings
from pneumarm.simulation import FitSettings

SMALL = RunSettings(
    arm="virtual:seed=3",
    seed=5,
    transitions=6_000,
    test_episodes=300,
    bound_episodes=8,
    fit=FitSettings(epochs=10),
    method="sarsa",
    thesis=TrainSettings(agents=2, max_episodes=3_000, validation_episodes=100, shaping=Shaping(episodes=100)),
    transfer=RunTransferSettings(episodes=30, test_episodes=20),
)


def servo_on(arm: str, folder: Path) -> dict[str, Any]:
    """Return the results of the whole job with the default agent on ``arm``, learned in short, done in ``folder``."""
    servo = ServoSettings(updates=400)
    return Run(folder, replace(SMALL, arm=arm, bound_episodes=0, method="servo", servo=servo, test_episodes=50)).do()


def exit_status(arguments: list[str]) -> int | str | None:
    """Return the exit status of the command line."""
    with pytest.raises(SystemExit) as left:
        command_line(arguments)
    return left.value.code
