"""Experiments that go from an arm back to it: small ones, and what their parts and their verdicts rest on."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from pneumarm.arm import open_arm
from pneumarm.errors import UnusableInput
from pneumarm.experiments.claims import keys_of
from pneumarm.experiments.control_frequency import ControlFrequency
from pneumarm.experiments.control_frequency.frequencies import at_frequency
from pneumarm.experiments.enough_data import EnoughData
from pneumarm.experiments.experiment import Claim, Experiment, LaboratorySettings, Row, TrialRows, sorted_rows
from pneumarm.experiments.noise_for_transfer import NoiseForTransfer
from pneumarm.experiments.preparation import PROCEDURES
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.results import write_page
from pneumarm.experiments.state_history import StateHistory
from pneumarm.experiments.state_history.histories import errors_with_period, with_history
from pneumarm.experiments.sweep import sweep
from pneumarm.experiments.there_and_back import Prepared, Recipe, open_arm_at, over_joints, prepared, train_and_move
from pneumarm.experiments.valves_closed import ValvesClosed
from pneumarm.experiments.valves_closed.inflation import inflation
from pneumarm.experiments.verdict import OPEN
from pneumarm.learning import TrainSettings
from pneumarm.simulation import SINGLE_STEPS, fit
from pneumarm.transitions import Store, Transitions, Window, collect, transitions

ARM = "virtual:seed=3"
QUICK = replace(SINGLE_STEPS, epochs=4)
SMALL = LaboratorySettings(transitions=2400, test_episodes=4, max_episodes=20)
EXPERIMENTS: list[Experiment] = [
    ControlFrequency(frequencies=(20.0, 30.0, 40.0)),
    StateHistory(histories=(1, 3, 4), fit=QUICK),
    EnoughData(minutes=(1.7, 2.5, 3.3)),
    NoiseForTransfer(factors=(1.0, 4.0)),
    ValvesClosed(),
]


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("experiments") / "laboratory"


@pytest.fixture(scope="module")
def material(laboratory: Path) -> Prepared:
    laboratory.mkdir(exist_ok=True)
    return prepared(ARM, laboratory / "arms" / "virtual-seed-3", Recipe(2400), SMALL, lambda done, total: None)


@pytest.mark.parametrize("chosen", EXPERIMENTS, ids=lambda chosen: chosen.name)
def test_an_experiment_from_the_arm_to_its_page(chosen: Experiment, laboratory: Path) -> None:
    """Every row once, every claim judged, everything on the page; a second sweep computes nothing."""
    done = sweep(chosen, laboratory, [ARM], 2, SMALL)
    assert done.computed == 2 * len(chosen.trials)
    assert sweep(chosen, laboratory, [ARM], 2, SMALL).computed == 0
    analysis = chosen.analyse(done.rows)
    page = write_page(chosen, laboratory / chosen.name, analysis, done.rows).read_text()
    assert {claim.about for claim in analysis.claims} == keys_of(chosen.name)
    for claim in analysis.claims:
        assert claim.verdict == OPEN  # of one arm
        assert claim.judgement.why.startswith(("one arm", "no rows"))
        assert claim.ours
    assert "How the arm moved" in page
    assert "nan" not in re.sub(r'"data:[^"]*"', "", page)
    found = json.loads((laboratory / chosen.name / "results.json").read_text())
    first = next(iter(chosen.trials.values()))
    assert any(first in table for table in found["ours"].values())
    again = chosen.measure(chosen.prepare(ARM, _arm_folder(laboratory), SMALL, _silent), 1, 2, SMALL)
    assert dict(again) == next(row.figures for row in done.rows.rows if (row.trial, row.run) == (1, 2))


def _arm_folder(laboratory: Path) -> Path:
    return next(folder for folder in (laboratory / "arms").iterdir() if folder.name != "virtual-seed-3")


def _silent(done: float, total: float) -> None:
    pass


@pytest.mark.parametrize("chosen", EXPERIMENTS, ids=lambda chosen: chosen.name)
def test_the_experiment_by_its_name_is_of_the_same_kind(chosen: Experiment) -> None:
    named = experiment(chosen.name)
    assert type(named) is type(chosen)
    assert len(named.arms) >= 5
    assert named.runs * len(named.arms) >= 16


# Verdicts -------------------------------------------------------------------------------------------------------


def made_up(chosen: Experiment, **slopes: float) -> TrialRows:
    """Return rows in which every figure grows with the trial by its slope, alike on all arms."""
    names = {*slopes, "reward", "episodes", "seconds", "switches", "actions", "success_rate"}
    names |= {f"{kind} {name}" for kind in ("std", "change", "relative") for name in over_joints(np.ones(4))}
    names |= {"in simulation: reward", "transitions", "occupied", "rows", "new", "unseen", "period", "pause"}
    names |= {
        f"{kind} {name} after a second" for kind in ("expected", "measured") for name in over_joints(np.ones(4))
    }
    names |= {"angle after a second"} | {f"after {t} ms {name}" for t in range(3) for name in ("angle", "pressure")}
    rows = []
    for arm in range(5):
        for trial in chosen.trials:
            for run in (1, 2):
                noise = 1e-3 * np.sin(10 * arm + trial + run)
                figures = {n: 10 + slopes.get(n.replace(" ", "_"), 0.0) * trial + noise + arm for n in names}
                rows.append(Row(f"arm {arm}", trial, run, figures, 0.0))
    return sorted_rows(rows)


def verdict(chosen: Any, begins: str, **slopes: float) -> str:
    return claim(chosen, begins, **slopes).verdict


def claim(chosen: Any, begins: str, **slopes: float) -> Claim:
    with pytest.MonkeyPatch.context() as patch:  # claims need no pictures, which take long
        patch.setattr("pneumarm.experiments.pictures._against", lambda *given: Figure())
        found = chosen.analyse(made_up(chosen, **slopes)).claims
    return next(each for each in found if each.text.startswith(begins))


@pytest.mark.parametrize(
    ("chosen", "begins", "figure", "sign"),
    [
        (EXPERIMENTS[0], "The angle is predicted better", "std_angle", -1),
        (EXPERIMENTS[0], "The velocity is predicted worse", "std_velocity", 1),
        (EXPERIMENTS[1], "The length of the step improves", "std_angle", -1),
        (EXPERIMENTS[2], "What fits better", "reward", 1),
        (EXPERIMENTS[3], "Noise makes", "reward", 1),
        (EXPERIMENTS[3], "Too much noise", "episodes", 1),
        (EXPERIMENTS[4], "Valves left as they are make control faster", "seconds", 1),
        (EXPERIMENTS[4], "Valves left as they are let", "change_velocity", -1),
    ],
)
def test_verdicts_follow_from_the_rows(chosen: Experiment, begins: str, figure: str, sign: float) -> None:
    slope = sign * {"reward": 5.0, "episodes": 2000.0}.get(figure, 1.0)
    assert verdict(chosen, begins, **{figure: slope}) == "holds"
    assert verdict(chosen, begins, **{figure: -slope}) == "does not hold"


def test_half_the_time_is_compared_with_the_longest() -> None:
    """Some hour, half of the thesis' two, against all."""
    chosen, said = experiment("enough-data"), "Fewer transitions would do"
    assert list(chosen.trials.values())[-3:] == ["50 min", "110 min", "220 min"]
    assert verdict(chosen, said, reward=0.1) == "holds"
    assert verdict(chosen, said, reward=1.5) == "does not hold"
    assert claim(chosen, said, reward=1.5).ours.startswith("reward less: +3.00")


# Parts ----------------------------------------------------------------------------------------------------------


def test_settings_at_a_frequency_are_the_same_in_time() -> None:
    usual = TrainSettings()
    assert at_frequency(usual, 30.0) == usual
    twice = at_frequency(usual, 60.0)
    assert twice.cutoff / 60 == usual.cutoff / 30
    assert twice.discount**60 == pytest.approx(usual.discount**30)
    assert 60 * twice.reward.action == 30 * usual.reward.action
    assert twice.reward.switch == usual.reward.switch
    assert twice.noise.steps == 2 * usual.noise.steps


def test_what_was_made_is_not_made_again(material: Prepared, laboratory: Path) -> None:
    folder = material.folder.parent

    def made() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in folder.rglob("*.*") if path.suffix in (".json", ".db")}

    before = made()
    again = prepared(ARM, folder, Recipe(2400, frequency=30.0), SMALL, _silent)  # the arm's own frequency
    assert made() == before
    assert again.figures == material.figures
    np.testing.assert_array_equal(again.begin.states, material.begin.states)


def test_arms_are_recorded_as_in_the_thesis_or_as_ours_apart(material: Prepared, tmp_path: Path) -> None:
    """Each way is what collecting that way gives, and no recording of one is taken for the other."""
    made = {"thesis": material.folder}
    ours = replace(SMALL, collecting="ours")
    made["ours"] = prepared(ARM, material.folder.parent, Recipe(2400), ours, _silent).folder
    assert made["thesis"] != made["ours"]
    for name, folder in made.items():
        with open_arm(ARM, SMALL.seed) as arm, Store.for_arm(tmp_path / name, arm.spec) as store:
            collect(arm, store, 2400, SMALL.seed, settings=PROCEDURES[name])
            expected = np.concatenate([rows.angle for rows in store.blocks()])
        with Store.open(folder / "transitions.db") as store:
            found = np.concatenate([rows.angle for rows in store.blocks()])
        np.testing.assert_array_equal(found, expected)


def test_the_arm_is_controlled_at_the_frequency(material: Prepared, laboratory: Path) -> None:
    """Twice as many actions fit in the time of a movement that is cut off."""
    never = replace(TrainSettings(), cutoff=20, reward=replace(TrainSettings().reward, angle_tolerance=1e-6))
    few = replace(SMALL, max_episodes=1)
    slow = train_and_move(material, never, 1, few)
    quick = train_and_move(replace(material, recipe=replace(material.recipe, frequency=60.0)), never, 1, few)
    assert slow["actions"] == quick["actions"] == 20
    assert slow["seconds"] == pytest.approx(20 / 30, rel=0.02)
    assert quick["seconds"] == pytest.approx(20 / 60, rel=0.02)


def test_a_period_shorter_than_the_latency_is_refused() -> None:
    assert open_arm_at(ARM, 0, 50.0).spec.period == 0.02
    with pytest.raises(UnusableInput, match="latency"):
        open_arm_at(ARM, 0, 1000.0)


def test_shorter_histories_are_cut_out_of_longer_ones(material: Prepared) -> None:
    with Store.open(material.folder / "transitions.db") as store:
        rows = next(iter(store.blocks()))
    longest = Window(1, 4)
    whole = transitions(rows, longest)
    for history in (1, 2, 3, 4):
        direct = transitions(rows, Window(1, history))
        assert len(direct.inputs) == len(whole.inputs)  # sequences begin at rest
        np.testing.assert_array_equal(with_history(whole, longest, history).inputs, direct.inputs)


def halves(material: Prepared, window: Window) -> tuple[Transitions, Transitions]:
    with Store.open(material.folder / "transitions.db") as store:
        whole = transitions(next(iter(store.blocks())), window)
    odd = whole.sequence % 2 == 1
    return Transitions._make(a[odd] for a in whole), Transitions._make(a[~odd] for a in whole)


def test_errors_without_the_period_are_those_of_the_fit(material: Prepared) -> None:
    window = Window(1, 2)
    kept, apart = halves(material, window)
    spec = material.simulation.spec
    chosen = replace(QUICK, history=2, seed=5)
    made = fit(kept, apart, spec=spec, goal_range=material.simulation.goal_range, settings=chosen)
    found = errors_with_period(kept, apart, window, chosen, made.simulation.limits, spec.period)
    for name, value in over_joints(made.held_out.std).items():
        assert found[name] == pytest.approx(value, rel=1e-5)


def test_the_period_helps_where_steps_differ(material: Prepared) -> None:
    """Made-up readings of an arm that moves evenly, at uneven times."""
    window = Window(1, 2)
    kept, apart = halves(material, window)
    random = np.random.default_rng(0)

    def uneven(these: Transitions) -> Transitions:
        interval = random.uniform(0.02, 0.05, len(these.interval)).astype(np.float32)
        target = these.observation.copy()
        target[:, 0] += 1000 * interval
        target[:, 1] = 1.0
        target[:, 2:] += random.normal(0, 1, target[:, 2:].shape)
        return these._replace(interval=interval, target=target)

    kept, apart = uneven(kept), uneven(apart)
    chosen = replace(QUICK, history=2, epochs=30)
    anything = np.array([[-np.inf] * 4, [np.inf] * 4])
    blind, told = (errors_with_period(kept, apart, window, chosen, anything, one) for one in (0.035, None))
    assert blind["angle"] == pytest.approx(1000 * 0.03 / np.sqrt(12), rel=0.1)
    assert told["angle"] < 0.05 * blind["angle"]
    assert told["velocity"] < 0.05 * blind["velocity"]


def test_parts_of_a_collection_are_what_a_short_one_gives(tmp_path: Path) -> None:
    """Cut after 1.7 minutes it is the collection that ended there, though its store went on."""
    both = EnoughData(minutes=(1.7, 2.5)).prepare(ARM, tmp_path / "arm", SMALL, _silent)
    alone = EnoughData(minutes=(1.7,)).prepare(ARM, tmp_path / "arm", SMALL, _silent)
    assert both[0].figures == alone[0].figures
    np.testing.assert_array_equal(both[0].begin.states, alone[0].begin.states)
    assert both[1].figures["minutes"] >= 2.5 > both[0].figures["minutes"] >= 1.7
    assert len(both[1].begin) > len(both[0].begin)


def test_pauses_let_less_air_in() -> None:
    begin: dict[str, Any] = {"arm": ARM, "seed": 1, "pause": 0.01}
    time, angle, pressure = inflation(**begin, close=False)
    same = inflation(ARM, 1, 0.02, close=False)
    np.testing.assert_array_equal(angle, same[1])
    assert time[-1] == pytest.approx(0.1)
    _, _, paused = inflation(**begin, close=True)
    assert 0.3 < paused[-1] / pressure[-1] < 0.95


def test_settings_are_kept_with_the_rows() -> None:
    for chosen in EXPERIMENTS:
        json.dumps(chosen.settings())
        assert chosen.settings() != experiment(chosen.name).settings() or isinstance(chosen, ValvesClosed)
    assert json.dumps(asdict(Recipe(fit=QUICK)))
