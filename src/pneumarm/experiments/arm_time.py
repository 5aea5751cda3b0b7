"""Estimate how long an experiment will need an arm, before it begins."""

from collections.abc import Iterable
from pathlib import Path

from pneumarm.experiments.experiment import Experiment, LaboratorySettings
from pneumarm.experiments.preparation import SIMULATION
from pneumarm.transitions.collect import recording_seconds

_MOVEMENT = 5.5
"""A movement, with all that leads to its begin state [s]."""


def arm_time(
    experiment: Experiment, arm: str, folder: Path, rows: Iterable[tuple[int, int]], settings: LaboratorySettings
) -> str | None:
    """Return in words for how long ``experiment`` needs ``arm``; None where it does not, or nobody knows.

    ``rows`` are the trials and runs that are to be measured, ``folder`` is where the arm's simulation lies or will.
    """
    trials = [trial for trial, _ in rows]
    records = bool(trials) and experiment.records and not (folder / SIMULATION).exists()
    movements = sum(experiment.movements(trial, arm, settings) for trial in trials)
    seconds = _MOVEMENT * movements + sum(experiment.rest(trial) for trial in trials)
    parts = []
    if records:
        parts.append(f"{settings.transitions:,} transitions to record")
        seconds += recording_seconds(settings.transitions)
    if movements:
        parts.append(f"at most {movements:,} movements")
    if not parts:
        return None
    minutes = max(1, round(seconds / 60))
    long = f", {minutes / 60:.1f} hours" if minutes >= 120 else ""
    return f"{arm}: {' and '.join(parts)}, about {minutes:,} minutes{long} of the arm's time"
