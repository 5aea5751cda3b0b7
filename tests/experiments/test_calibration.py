"""Calibrating the replica: inputs scaled otherwise, and a choice by half of the trials."""

from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.calibration import EXPERIMENT as CALIBRATION
from pneumarm.experiments.calibration.choices import FIGURES, rescaled
from pneumarm.experiments.experiment import LaboratorySettings, Row, sorted_rows
from pneumarm.experiments.sweep import sweep
from pneumarm.simulation import Simulation


def changes(simulation: Simulation, raw: np.ndarray) -> np.ndarray:
    """Return the predicted changes of ``raw`` inputs [sensor units]."""
    scaled = simulation.scaling.inputs(raw, simulation.window)
    made = np.concatenate([network(scaled) for network in simulation.networks], axis=1)
    return made * simulation.scaling.observation_scale[simulation.outputs]


def test_a_simulation_of_other_scales_predicts_the_same() -> None:
    old = synthetic_simulation()
    raw = np.random.default_rng(0).normal(size=(50, old.window.input_size)) * 100
    for factor in (0.5, 2.0):
        new = rescaled(old, factor)
        np.testing.assert_allclose(changes(new, raw), changes(old, raw), rtol=1e-5, atol=1e-5)
        inputs = [one.scaling.inputs(raw, one.window)[:, 0] for one in (old, new)]
        np.testing.assert_allclose(inputs[0], factor * inputs[1])


def test_choices_are_made_by_the_odd_trials() -> None:
    """Trial 5 has the thesis' rewards in the odd trials and is far from them in the even ones; others the reverse."""
    thesis = ALL_GOALS.thesis["reward"].mean(axis=1)
    found = []
    for trial in CALIBRATION.trials:
        for arm in ("a", "b"):
            figures = {}
            for of, theirs in zip(ALL_GOALS.trials, thesis, strict=True):
                near = (of % 2 == 1) == (trial == 5)
                figures |= {
                    f"{name} {of}": 1.0 if "success" in name else theirs - 50 * (not near) for name in FIGURES
                }
            found.append(Row(arm, trial, 1, figures, 0.0))
    said = " ".join(CALIBRATION.analyse(sorted_rows(found)).summary)
    assert f"Nearest to the thesis in odd trials: {CALIBRATION.trials[5]}" in said


@pytest.mark.thorough
def test_every_choice_trains_all_trials(tmp_path: Path) -> None:
    small = LaboratorySettings(transitions=3_000, test_episodes=20, max_episodes=10)
    rows = sweep(CALIBRATION, tmp_path, ["virtual:seed=3"], 1, small).rows
    assert len(rows.rows) == 18
    assert rows.figures == {f"{name} {of}" for name in FIGURES for of in ALL_GOALS.trials}
    assert CALIBRATION.train_settings(1, 16).method == ALL_GOALS.train_settings(16).method
