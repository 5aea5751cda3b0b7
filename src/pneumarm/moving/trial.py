"""What a controller is good for, told in degrees and seconds: goals held one after the other, sinusoids followed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm import Arm, guarded
from pneumarm.arm.controller import TrackingController
from pneumarm.arm.reference import Reference
from pneumarm.moving.movement import Moved, MoveSettings, Tracked, move, track
from pneumarm.moving.settling import TOLERANCE
from pneumarm.settings import Settings
from pneumarm.statistics import wilson
from pneumarm.transitions.goals import Goals


@dataclass(frozen=True)
class MoveTrialSettings(Settings):
    """What is tried."""

    goals: Annotated[int, Meta(ge=0, le=1_000_000)] = 40
    """Goals that are moved to, one after the other, drawn uniformly; 0 for none."""
    hold: Annotated[float, Meta(gt=0, le=3600)] = 3.0
    """For how long each is held, from when it is given [s]."""
    tolerance: Annotated[float, Meta(gt=0, lt=360)] = TOLERANCE
    """A joint is there within so much [degrees]."""
    frequencies: tuple[Annotated[float, Meta(gt=0, le=100)], ...] = (0.25, 0.5, 1.0)
    """Frequencies of the sinusoids that are followed [Hz]."""
    amplitude: Annotated[float, Meta(gt=0, lt=360)] = 20.0
    """Amplitude of the sinusoids about the middle of the goals; less where the arm does not go so far [degrees]."""
    seconds: Annotated[float, Meta(gt=0, le=3600)] = 8.0
    """For how long each sinusoid is followed [s]."""


@dataclass(frozen=True)
class MoveTrial:
    """What came of a trial."""

    moved: tuple[Moved, ...]
    tracked: dict[float, tuple[float, Tracked]]
    """By frequency: the amplitude in degrees, and what came of it."""
    settings: MoveTrialSettings

    def results(self) -> dict[str, Any]:
        """Return the figures for ``results.json``, ``settle`` and ``track``."""
        found: dict[str, Any] = {}
        if self.moved:
            settled = [one for one in self.moved if one.time_settled is not None]
            seconds = [one.time_settled - one.time_start for one in settled if one.time_settled is not None]
            low, high = wilson(len(settled), len(self.moved))
            air = [one.air for one in self.moved if one.air is not None]
            found["settle"] = {
                "movements": len(self.moved),
                "tolerance_deg": self.settings.tolerance,
                "settled": len(settled) / len(self.moved),
                "settled_interval": [low, high],
                "median_seconds": float(np.median(seconds)) if seconds else None,
                "seconds_95": float(np.quantile(seconds, 0.95)) if seconds else None,
                "overshoot_deg": float(np.median([one.overshoot.max() for one in self.moved])),
                "rest_error_deg": float(np.mean([one.rest_error.max() for one in self.moved])),
                "valve_changes_per_second": float(np.mean([one.switches for one in self.moved]) / self.settings.hold),
                "valve_changes_last_second": float(np.median([one.changes_at_rest.max() for one in self.moved])),
                "air_litres_per_movement": float(np.mean(air)) if air else None,
            }
        if self.tracked:
            found["track"] = [
                {"frequency_hz": frequency, "amplitude_deg": amplitude, "rms_error_deg": one.rms_error.tolist()}
                for frequency, (amplitude, one) in self.tracked.items()
            ]
        return found


def try_moving(
    arm: Arm,
    controller: TrackingController,
    goals: Goals | NDArray[np.float64],
    settings: MoveTrialSettings = MoveTrialSettings(),
    *,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> MoveTrial:
    """Move ``arm`` to ``goals``, or within a range (joints, 2) [counts], and along sinusoids; each is tried once."""
    spec, random, possible = arm.spec, np.random.default_rng([seed, 5]), Goals.of(goals)
    drawn = possible.draw(random, settings.goals)
    total, moved = settings.goals + len(settings.frequencies), []
    guard = guarded(arm)
    for one in move(guard, controller, drawn, MoveSettings(settings.hold, 1, settings.tolerance)):
        moved.append(one)
        if progress is not None:
            progress(len(moved), total)
    middle, half = possible.middle, np.ptp(possible.range, axis=1) / 2
    counts = np.minimum(settings.amplitude * spec.counts_per_degree, 0.9 * half)
    counts = np.minimum(*(np.abs(possible.within(middle + side * counts) - middle) for side in (-1, 1)))
    tracked = {}
    for number, frequency in enumerate(settings.frequencies, 1):
        wave = Reference(lambda t, f=frequency: middle + counts * np.sin(2 * np.pi * f * t))  # type: ignore[misc]
        amplitude = float(counts.min() / spec.counts_per_degree)
        tracked[frequency] = amplitude, track(guard, controller, wave, settings.seconds)
        if progress is not None:
            progress(settings.goals + number, total)
    return MoveTrial(tuple(moved), tracked, settings)
