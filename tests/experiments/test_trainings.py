"""Experiments with the thesis' agent: equal weights within a run, training on, what is recorded, the command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.cli import main
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import LaboratorySettings, run_seed
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.trainings import LEARNING, train_and_test, with_setting, with_settings
from pneumarm.learning import Exploration, TrainSettings
from pneumarm.learning.online.training import train_online

SHORT = LaboratorySettings(test_episodes=200, max_episodes=1000, exploring=True)
FACTORIALS = [name for name in PLACES if isinstance(experiment(name), Factorial)]


@pytest.fixture(scope="module")
def material() -> Simulated:
    simulation = synthetic_simulation()
    return Simulated("synthetic", simulation, synthetic_begin_states(simulation))


def test_settings_are_changed_by_their_place() -> None:
    settings = with_settings(TrainSettings(), {"reward.switch": 0.0, "hidden": 7, "shaping.grow": 0.2})
    assert (settings.reward.switch, settings.hidden) == (0.0, 7)
    assert settings.shaping is not None
    assert settings.shaping.grow == 0.2
    assert settings.reward.goal == TrainSettings().reward.goal
    for place in ("nothing", "reward.nothing", "hidden.nothing"):
        with pytest.raises(UnusableInput, match="has no setting 'nothing'"):
            with_setting(TrainSettings(), place, 1)


def test_trials_of_a_run_begin_with_the_same_weights(material: Simulated) -> None:
    """Agents that learn nothing show their first weights: those of the run, for each number of hidden units."""
    still = replace(TrainSettings(), learning_rate=0.0, max_episodes=1)
    laboratory = LaboratorySettings(test_episodes=300)

    def rewards(**changes: object) -> list[float]:
        settings = replace(still, **changes)  # type: ignore[arg-type]
        return [train_and_test(material, settings, run, laboratory)["reward"] for run in (1, 2)]

    sarsa = rewards()
    assert rewards(method="q-learning", trace_decay=0.3, discount=0.95) == sarsa
    assert sarsa[0] != sarsa[1]
    assert rewards(hidden=10) != sarsa


def test_the_same_row_is_the_same_bit_for_bit(material: Simulated) -> None:
    chosen = experiment("all-goals")
    first, again = (chosen.measure(material, 7, 2, SHORT) for _ in range(2))
    assert first == again
    assert chosen.measure(material, 7, 1, SHORT) != first


def test_rewards_are_made_of_actions_and_switches(material: Simulated) -> None:
    found = train_and_test(material, TrainSettings(), 1, SHORT)
    for prefix in ("", "exploring "):
        success, actions, switches = (found[prefix + name] for name in ("success_rate", "actions", "switches"))
        assert found[prefix + "reward"] == pytest.approx(51 * success - actions - 8 * switches)


def test_exploration_in_the_test_makes_switches(material: Simulated) -> None:
    """At epsilon 1 no action is the greedy one, so the actions of the two tests differ; at 0 they are the same."""
    never, always = (
        train_and_test(material, replace(TrainSettings(), shaping=None, exploration=Exploration(e, 20.0)), 1, SHORT)
        for e in (0.0, 1.0)
    )
    assert never["exploring reward"] == never["reward"]
    assert always["exploring switches"] != always["switches"]


def test_exploring_tests_are_made_when_asked_for(material: Simulated) -> None:
    asked, not_asked = (
        train_and_test(material, TrainSettings(), 1, replace(SHORT, exploring=exploring))
        for exploring in (True, False)
    )
    extra = {name for name in asked if name.startswith("exploring ")}
    assert len(extra) == 4
    assert {name: value for name, value in asked.items() if name not in extra} == not_asked


def test_success_while_learning_on_is_that_of_the_training(material: Simulated) -> None:
    """An agent that met the criterion of 95 % goes on meeting it; one that learns nothing does as in the test."""
    laboratory = LaboratorySettings(test_episodes=2000, exploring=True)
    settings = replace(TrainSettings(), max_episodes=40_000)
    trained = train_and_test(material, settings, 3, laboratory)
    assert trained["met"] == 1
    assert trained[LEARNING] > 0.93
    still = replace(settings, learning_rate=0.0, max_episodes=1, shaping=None)
    untrained = train_and_test(material, still, 3, laboratory)
    assert untrained[LEARNING] == pytest.approx(untrained["exploring success_rate"], abs=0.08)


def test_a_single_goal(material: Simulated) -> None:
    goal = 650.0
    narrowed = replace(material.simulation, goal_range=np.array([[goal, goal]]))
    alone = train_and_test(material, TrainSettings(), 1, SHORT, goal)
    assert alone == train_and_test(replace(material, simulation=narrowed), TrainSettings(), 1, SHORT)
    assert alone != train_and_test(material, TrainSettings(), 1, SHORT)


def test_training_on_begins_as_training(material: Simulated) -> None:
    """Trained to 3,000 episodes and then on to 4,000; the first is what it was without going on."""
    chosen = replace(experiment("long-training"), continued=4000)  # type: ignore[type-var]
    laboratory = LaboratorySettings(test_episodes=100)
    settings = replace(TrainSettings(), agents=1, validation_episodes=1, stops=False, max_episodes=3000)
    seed = run_seed(laboratory, 1)
    short = train_online(material.simulation, material.begin, settings, seed)
    long = train_online(material.simulation, material.begin, replace(settings, max_episodes=4000), seed)
    np.testing.assert_array_equal(short.curves[0], long.curves[0][: len(short.curves[0])])
    assert long.episodes[0] == 4000
    row = chosen.measure(material, 10, 1, laboratory)
    before = experiment("all-goals").measure(material, 10, 1, laboratory)
    assert row["gain"] == pytest.approx(row["reward"] - before["reward"])
    assert row["episodes"] == before["episodes"]


def test_training_that_does_not_stop_meets_the_criterion_for_good(material: Simulated) -> None:
    settings = replace(TrainSettings(), agents=1, validation_episodes=1, max_episodes=40_000)
    stopped = train_online(material.simulation, material.begin, settings, 3)
    assert stopped.met[0]
    most = int(stopped.episodes[0]) + 1000
    on = train_online(material.simulation, material.begin, replace(settings, stops=False, max_episodes=most), 3)
    assert on.met[0]
    assert on.episodes[0] == most


def test_without_shaping_the_end_is_looked_for_after_every_episode(material: Simulated) -> None:
    """As in table C.22. The performance (eq. 4.14) has met the criterion just then."""
    settings = experiment("no-shaping").train_settings(2)  # type: ignore[attr-defined]
    assert (settings.exploration.epsilon, settings.exploration.temperature, settings.shaping) == (0.09, 10.0, None)
    one = replace(settings, agents=1, validation_episodes=1, max_episodes=40_000)
    ends = [train_online(material.simulation, material.begin, one, seed) for seed in (1, 2)]
    assert all(end.met[0] for end in ends)
    assert any(end.episodes[0] % 500 for end in ends)
    for end in ends:
        performance = end.curves[0][-1, 3]
        assert 0.95 <= performance < 0.952


@pytest.mark.parametrize("name", PLACES)
def test_experiments_are_data(name: str) -> None:
    chosen = experiment(name)
    assert chosen.name == name
    kept = json.dumps(chosen.settings())
    assert all(json.dumps(experiment(other).settings()) != kept for other in PLACES if other != name)
    assert list(chosen.trials) == list(range(1, len(chosen.trials) + 1))
    assert experiment(name) is chosen


@pytest.mark.parametrize("name", FACTORIALS)
def test_factors_reach_the_training(name: str) -> None:
    chosen = experiment(name)
    assert isinstance(chosen, Factorial)
    found = [chosen.train_settings(trial) for trial in chosen.trials]
    assert {s.method for s in found} == {"sarsa", "q-learning"}
    assert sorted({(s.learning_rate, s.hidden) for s in found}) == [(0.05, 5), (0.05, 10), (0.1, 5), (0.1, 10)]
    last = {(s.discount, s.reward.switch) for s in found}
    assert last == ({(0.98, -8.0), (0.98, 0.0)} if name == "switch-punishment" else {(0.95, -8.0), (0.98, -8.0)})
    for table in chosen.thesis.values():
        assert len(table) == len(chosen.trials) == 16
    for claim in chosen.effect_claims:
        assert claim.criterion in chosen.thesis


def test_no_experiment_is_said() -> None:
    with pytest.raises(UnusableInput, match="no experiment 'nothing'; there are all-goals"):
        experiment("nothing")


def test_the_command_leaves_a_page_and_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two experiments in one laboratory: the arm is prepared once, rows are computed once."""
    laboratory = tmp_path / "laboratory"
    options = ["--out", laboratory, "--transitions", 6000, "--test-episodes", 20, "--max-episodes", 20, "--json"]
    options += ["--arms", "virtual"]
    for name, runs, computed in (("optimal-settings", 2, 4), ("optimal-settings", 3, 2), ("all-goals", 2, 32)):
        with pytest.raises(SystemExit) as ended:
            main(["experiment", name, "--runs", str(runs), *map(str, options)])
        out, _ = capsys.readouterr()
        assert ended.value.code == 0
        found = json.loads(out)
        assert found["computed"] == computed
        assert found["rows"] == runs * len(experiment(name).trials)
        page = (laboratory / name / "page.html").read_text()
        assert "The thesis beside ours" in page
        # One plays, drawn for wide and for narrow screens.
        assert page.count("data:image/svg") == 2 + (20 if name == "all-goals" else 0)
    assert len(list((laboratory / "arms").iterdir())) == 1
    assert found["thesis"]["reward"]["ranking"]["mean"][:2] == [4, 12]
