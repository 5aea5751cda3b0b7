"""The settings of shaping: trials as data, the worn arm, differences within runs, the verdicts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.experiments.claims import keys_of
from pneumarm.experiments.experiment import LaboratorySettings, Row, TrialRows, sorted_rows
from pneumarm.experiments.preparation import PLAN, Simulated, simulated
from pneumarm.experiments.shaping_settings import EXPERIMENT
from pneumarm.experiments.shaping_settings.analysis import strategy_figure
from pneumarm.experiments.shaping_settings.shapings import WholeAndWorn
from pneumarm.experiments.verdict import OPEN
from pneumarm.learning import Shaping, TrainSettings

SHORT = LaboratorySettings(test_episodes=100, max_episodes=1000)
NAMES = {name: number for number, name in EXPERIMENT.trials.items()}
THESIS, WITHOUT = NAMES["as in the thesis"], NAMES["no shaping"]
WORN, WORN_WITHOUT = NAMES["worn, as in the thesis"], NAMES["worn, no shaping"]


def test_trials_change_shaping_and_nothing_else() -> None:
    thesis = EXPERIMENT.train_settings(THESIS)
    assert thesis.shaping == Shaping()
    seen = []
    for trial in EXPERIMENT.trials:
        found = EXPERIMENT.train_settings(trial)
        assert replace(found, shaping=thesis.shaping, exploration=thesis.exploration) == thesis
        seen.append((found.shaping, found.exploration, EXPERIMENT.plan[trial - 1].worn))
    assert len(set(seen)) == len(seen)
    assert EXPERIMENT.train_settings(WITHOUT).shaping is None
    assert EXPERIMENT.reference(WITHOUT) == THESIS
    assert EXPERIMENT.reference(WORN_WITHOUT) == WORN


def test_a_worn_potentiometer_spoils_the_fit(tmp_path: Path) -> None:
    settings = LaboratorySettings(transitions=3000)
    material = EXPERIMENT.prepare("virtual:seed=1", tmp_path, settings, lambda done, total: None)
    whole, worn = (each.simulation.error_std[0] for each in (material.whole, material.worn))
    assert worn[0] > 3 * whole[0]  # angle
    assert worn[2] < 2 * whole[2]  # pressure
    assert (tmp_path / "worn" / PLAN).read_text() == EXPERIMENT.wear
    again = EXPERIMENT.prepare("virtual:seed=1", tmp_path, settings, lambda done, total: None)
    np.testing.assert_array_equal(again.worn.begin.angle, material.worn.begin.angle)
    with pytest.raises(UnusableInput, match="begun with other settings"):
        simulated("virtual:seed=1", tmp_path, settings, lambda done, total: None, faults=EXPERIMENT.wear)


def test_worn_trials_are_measured_on_the_worn_arm() -> None:
    simulation = synthetic_simulation()
    here = Simulated("synthetic", simulation, synthetic_begin_states(simulation))
    noisy = replace(simulation, error_std=3 * simulation.error_std)
    there = replace(here, simulation=noisy)
    found = EXPERIMENT.measure(WholeAndWorn(here, there), WORN, 1, SHORT)
    assert found == EXPERIMENT.measure(WholeAndWorn(there, here), THESIS, 1, SHORT)
    assert found != EXPERIMENT.measure(WholeAndWorn(here, there), THESIS, 1, SHORT)


def rows(met: dict[int, float], arms: int = 5, runs: int = 4) -> TrialRows:
    """Return rows in which shaping brings 10 of reward; runs and arms differ by much more."""
    draw = np.random.default_rng(0)
    found = []
    for arm in range(arms):
        for run in range(1, runs + 1):
            base = 100 * arm + 30 * draw.normal()
            for trial in EXPERIMENT.trials:
                shaped = EXPERIMENT.plan[trial - 1].shaping
                noise = draw.normal() * (1 if shaped else 4)
                figures = dict.fromkeys(("success_rate", "learning success_rate", "actions", "switches"), 1.0)
                figures["reward"] = base + 10 * shaped + noise
                figures["episodes"] = 9000.0 + 2000 * shaped + noise
                figures["met"] = met.get(trial, 1.0)
                found.append(Row(f"arm {arm}", trial, run, figures, 0.0))
    return sorted_rows(found)


def test_claims_are_about_what_the_experiment_tests() -> None:
    assert {claim.about for claim in EXPERIMENT.analyse(rows({})).claims} == keys_of(EXPERIMENT.name)


def verdicts(found: TrialRows) -> dict[str, str]:
    return {claim.text.split(":")[0]: claim.verdict for claim in EXPERIMENT.analyse(found).claims}


def test_verdicts_follow_from_the_rows() -> None:
    said = verdicts(rows({WORN_WITHOUT: 0.0}))
    assert said["Shaping raises the reward"] == "holds"
    assert said["Shaping is not indispensable"] == "holds"
    assert said["Without shaping fewer episodes are needed"] == "holds"
    assert said["With a worn potentiometer shaping is indispensable"] == "holds"
    assert said["Adjusting the deviation more often than every 500 episodes saves episodes"] == "does not hold"
    said = verdicts(rows({WITHOUT: 0.0}))
    assert said["Shaping is not indispensable"] == "does not hold"
    assert said["With a worn potentiometer shaping is indispensable"] == "does not hold"


def test_one_run_decides_nothing() -> None:
    assert set(verdicts(rows({}, arms=1, runs=1)).values()) == {OPEN}


def test_the_spread_is_that_within_arms() -> None:
    """Arms differ by hundreds here; runs by 30, alike with and without shaping."""
    claims = EXPERIMENT.analyse(rows({})).claims
    (spread,) = (claim for claim in claims if "standard deviation" in claim.text)
    first, second = (float(value) for value in spread.ours.split(";")[0].split(" against "))
    assert 10 < first < 60
    assert 10 < second < 60


def test_the_strategy_is_drawn_as_in_figure_4_3() -> None:
    figure = strategy_figure(TrainSettings(), ArmSpec())
    ends = [(axis.lines[0].get_ydata()[0], axis.lines[0].get_ydata()[-1]) for axis in figure.axes]
    np.testing.assert_allclose(ends, [(0.5, 0.05), (20, 1), (0.5, 0.95)])
