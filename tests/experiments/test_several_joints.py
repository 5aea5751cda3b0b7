"""The experiments of chapter 6 at a small size, and what their parts and their verdicts rest on."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from pneumarm.arm.open import names_in, with_options
from pneumarm.errors import UnusableInput
from pneumarm.experiments.claims import keys_of
from pneumarm.experiments.coupling.couplings import coupling
from pneumarm.experiments.experiment import Claim, LaboratorySettings, Row, TrialRows, sorted_rows
from pneumarm.experiments.joint_data.transitions import JointData, joint_data
from pneumarm.experiments.joint_exploration.rates import TOGETHER
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.results import write_page
from pneumarm.experiments.several_joints import POLICY, SeveralJoints, one_goal
from pneumarm.experiments.sweep import sweep
from pneumarm.experiments.there_and_back import Prepared, Recipe
from pneumarm.simulation import FitSettings

SIMULATED = "in simulation: success_rate"
ARM = "virtual:joints=2,seed=3"
SMALL = LaboratorySettings(transitions=2400, test_episodes=4, max_episodes=20)
FEW = replace(POLICY, updates=2, arms=16, steps=8, validation_episodes=2)


def small(made: Any) -> Any:
    """Return an experiment whose simulation and policies learn little."""
    lessons = {
        words: replace(lesson, learning=FEW) if lesson.learning == POLICY else lesson
        for words, lesson in made.lessons.items()
    }
    return replace(made, recipe=Recipe(2400, fit=FitSettings(epochs=3)), lessons=lessons)


EXPERIMENTS: list[SeveralJoints] = [
    small(made)
    for made in (
        experiment("goal-pairs"),
        joint_data("joint-data", 2000, 2400),
        experiment("joint-exploration"),
        coupling(0.0, 1.0),
        experiment("joint-agents"),
        experiment("hierarchy"),
    )
]
GOAL_PAIRS, DATA, EXPLORATION, COUPLING, AGENTS, HIERARCHY = EXPERIMENTS


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("joints") / "laboratory"


def _silent(done: float, total: float) -> None:
    pass


@pytest.fixture(scope="module")
def material(laboratory: Path) -> Prepared:
    laboratory.mkdir(exist_ok=True)
    return EXPERIMENTS[0].prepare(ARM, laboratory / "arms" / "apart", SMALL, _silent)


@pytest.mark.parametrize("chosen", EXPERIMENTS, ids=lambda chosen: chosen.name)
def test_an_experiment_from_the_arm_to_its_page(chosen: SeveralJoints, laboratory: Path) -> None:
    """Every row once, every claim judged, everything on the page."""
    done = sweep(chosen, laboratory, [ARM], 1, SMALL)
    assert done.computed == len(chosen.trials)
    assert sweep(chosen, laboratory, [ARM], 1, SMALL).computed == 0
    analysis = chosen.analyse(done.rows)
    page = write_page(chosen, laboratory / chosen.name, analysis, done.rows).read_text()
    assert {claim.about for claim in analysis.claims} == keys_of(chosen.name)
    assert "How the arm moved" in page
    assert "nan" not in re.sub(r'"data:[^"]*"', "", page)
    found = json.loads((laboratory / chosen.name / "results.json").read_text())
    first = next(iter(chosen.trials.values()))
    assert any(first in table for table in found["ours"].values())
    json.dumps(chosen.settings())
    named = experiment(chosen.name)
    assert type(named) is type(chosen)
    assert len(named.arms) == 5


@pytest.mark.parametrize("chosen", EXPERIMENTS, ids=lambda chosen: chosen.name)
def test_a_lesson_is_learned_alike_again(chosen: SeveralJoints, laboratory: Path) -> None:
    done = sweep(chosen, laboratory, [ARM], 1, SMALL)
    folder = next(one for one in (laboratory / "arms").iterdir() if one.name != "apart")
    again = chosen.measure(chosen.prepare(ARM, folder, SMALL, _silent), 1, 1, SMALL)
    assert dict(again) == next(row.figures for row in done.rows.rows if row.trial == 1)


# Parts ----------------------------------------------------------------------------------------------------------


def test_the_goal_of_a_run_is_one_that_the_arm_can_hold(material: Prepared) -> None:
    goals = np.array([one_goal(material, run, SMALL) for run in range(1, 21)])
    assert goals.shape == (20, 2)
    assert material.simulation.goals.contain(goals).all()
    assert np.ptp(goals, axis=0).min() > 100
    np.testing.assert_array_equal(goals[3], one_goal(material, 4, SMALL))
    assert (goals[3] != one_goal(replace(material, arm="another"), 4, SMALL)).all()


def test_two_agents_explore_together_as_often_as_one() -> None:
    assert pytest.approx(0.5) == TOGETHER * (2 - TOGETHER)
    rates = [lesson.learning.shaping for lesson in EXPLORATION.lessons.values()]
    assert [one and one.exploration.epsilon for one in rates] == [0.5, TOGETHER, 0.1, 0.5, None]


def test_names_of_arms_and_their_options_have_commas() -> None:
    named = ["virtual:joints=2,seed=1", "virtual", "virtual:wide,seed=3", "python:mine:Arm", "virtual:seed=2"]
    assert names_in(",".join(named)) == named


def test_options_of_an_arm_change() -> None:
    assert with_options("virtual:joints=2,seed=1", coupling="0.5") == "virtual:joints=2,seed=1,coupling=0.5"
    assert with_options("virtual:seed=1,joints=2,coupling=0.5", joints=None, coupling=None) == "virtual:seed=1"
    assert with_options("virtual:joints=2", joints=None) == "virtual"
    with pytest.raises(UnusableInput, match=r"serial:/dev/ttyACM0.*expected a virtual one.*coupling"):
        with_options("serial:/dev/ttyACM0", coupling="0")


def test_another_arm_has_no_simulation_of_one_joint(material: Prepared) -> None:
    """Then that trial has no figures, and claims that need them are left out."""
    chosen = DATA
    assert isinstance(chosen, JointData)
    assert chosen.measure([material, material], chosen.alone, 1, SMALL) == {}
    rows = [row for row in made_up(chosen, {}).rows if row.trial != chosen.alone]
    rows += [Row(f"arm {arm}", chosen.alone, 1, {}, 0.0) for arm in range(5)]
    assert {claim.about for claim in claims_of(chosen, sorted_rows(rows))} == {"joint-data"}


# Verdicts -------------------------------------------------------------------------------------------------------


def made_up(chosen: SeveralJoints, figures: dict[str, dict[int, float]]) -> TrialRows:
    """Return rows of five arms in which figures have the value given for a trial, else 1, in a size that matters."""
    columns = [column for section in chosen.words.sections for column in section.columns]
    names = {column.figure for column in columns} | {"reward", "episodes", "success_rate", *figures}
    return sorted_rows(
        Row(f"arm {arm}", trial, 1, {n: sized(n, figures.get(n, {}).get(trial, 1.0), arm) for n in names}, 0.0)
        for arm in range(5)
        for trial in chosen.trials
    )


def sized(name: str, value: float, arm: int) -> float:
    size = 1e4 if name == "episodes" else 20.0 if "reward" in name else 1.0
    return size * value * (1 + 1e-3 * arm)


@pytest.mark.parametrize(
    ("chosen", "begins", "figure", "trial", "holds", "fails"),
    [
        (0, "The thesis' agents learn the goal in the middle", SIMULATED, 1, 0.95, 0.2),
        (0, "They do in less", "episodes", 1, 4.0, 20.0),
        (0, "They learn any goal as well", SIMULATED, 2, 0.95, 0.1),
        (0, "The thesis' agents learn all goals", SIMULATED, 3, 0.95, 0.1),
        (0, "A policy learned in many arms", SIMULATED, 6, 0.95, 0.1),
        (1, "The simulation is worse", "std angle", 2, 2.0, 0.5),
        (1, "2,400 transitions are enough", "success_rate", 2, 0.95, 0.5),
        (2, "A lower rate", "episodes", 2, 0.5, 2.0),
        (2, "With 0.5 each", "exploring", 1, 0.75, 0.5),
        (3, "With coupling a policy", "reward", 2, 0.5, 2.0),
        (3, "With coupling the thesis' agents", "episodes", 4, 2.0, 0.5),
        (4, "With a common goal agents succeed more often than with their own, of one", SIMULATED, 2, 0.5, 2.0),
        (4, "With a common goal agents succeed more often than with their own, of all", SIMULATED, 6, 0.5, 2.0),
        (4, "One agent with 81 actions", SIMULATED, 3, 0.2, 0.9),
        (5, "With an upper agent one goal takes fewer", "episodes", 3, 0.5, 2.0),
        (5, "With an upper agent more movements", SIMULATED, 7, 2.0, 0.5),
        (5, "It takes fewer episodes than with flat agents that have their own", "episodes", 3, 0.5, 2.0),
        (5, "More succeed than with own goals", SIMULATED, 6, 0.5, 2.0),
        (5, "An upper agent that sees angles", "in simulation: reward", 4, 0.5, 2.0),
    ],
)
def test_verdicts_follow_from_the_rows(
    chosen: int, begins: str, figure: str, trial: int, holds: float, fails: float
) -> None:
    for value, expected in ((holds, "holds"), (fails, "does not hold")):
        claims = claims_of(EXPERIMENTS[chosen], made_up(EXPERIMENTS[chosen], {figure: {trial: value}}))
        assert next(claim for claim in claims if claim.text.startswith(begins)).verdict == expected


def test_what_is_a_bit_worse_in_one_of_two_figures_holds_in_part() -> None:
    claims = claims_of(EXPERIMENTS[1], made_up(EXPERIMENTS[1], {"std angle": {2: 3.0}}))
    found = next(claim for claim in claims if claim.text.startswith("It is only a bit worse"))
    assert (found.verdict, found.judgement.why) == ("in part", "angle: does not hold; pressure: holds")


def claims_of(chosen: SeveralJoints, rows: TrialRows) -> Sequence[Claim]:
    with pytest.MonkeyPatch.context() as patch:  # claims need no pictures, which take long
        for drawn in ("_against", "_dots"):
            patch.setattr(f"pneumarm.experiments.pictures.{drawn}", lambda *given: Figure())
        return chosen.analyse(rows).claims


def test_what_the_thesis_has_is_in_the_unit_of_its_column() -> None:
    (section,) = EXPLORATION.analyse(made_up(EXPLORATION, {"exploring": {1: 0.76}})).sections
    header, first = section.tables[0].header, section.tables[0].rows[0]
    assert header[1:3] == ["at least one explores, at the begin [%]", "thesis"]
    assert first[1].startswith("76.")
    assert first[2] == "75.0"


def test_trials_of_the_coupling_are_called_by_its_share() -> None:
    for section in COUPLING.analyse(made_up(COUPLING, {})).sections:
        assert [row[0].replace("\u00a0", " ") for row in section.tables[0].rows] == ["coupling 0", "coupling 1"]


def test_flat_and_hierarchical_agents_have_the_same_budget() -> None:
    """All but who acts is alike."""
    lessons = [lesson.learning for lesson in HIERARCHY.lessons.values()]
    for name in ("max_episodes", "shaping", "exploration", "learning_rate", "hidden", "reward", "agents", "method"):
        assert len({getattr(learning, name) for learning in lessons}) == 1


@pytest.mark.parametrize("asked", EXPERIMENTS, ids=lambda asked: asked.name)
def test_an_arm_of_one_joint_is_refused(asked: SeveralJoints, tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match=r"'virtual:seed=1.*one joint"):
        asked.prepare("virtual:seed=1", tmp_path, SMALL, _silent)


def test_one_joint_and_two_are_fitted_alike() -> None:
    fit = joint_data("joint-data", 12_000, 24_000).recipe.fit
    assert {fit.with_layers(joints, 24_000).layers for joints in (1, 2)} == {1}
