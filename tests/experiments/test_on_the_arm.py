"""Experiments on the arm, in small: over the simulation of the shared small run and the virtual arm that it is of."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneumarm.arm import open_arm
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.arm.virtual.parameters import without_noise
from pneumarm.control.playing import Player
from pneumarm.control.turns import TurnPlayer
from pneumarm.experiments import registry
from pneumarm.experiments.arm_time import arm_time
from pneumarm.experiments.claims import keys_of
from pneumarm.experiments.displacement import typical
from pneumarm.experiments.experiment import Experiment, LaboratorySettings, Row, TrialRows, run_seed, sorted_rows
from pneumarm.experiments.means import blocks, values
from pneumarm.experiments.moving import (
    MOVEMENTS,
    THESIS,
    agent_of,
    draws,
    from_visits,
    new_arm,
    parameters_of,
)
from pneumarm.experiments.on_the_arm_only import from_scratch
from pneumarm.experiments.overnight.days import DAYS
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.results import write_page
from pneumarm.experiments.sweep import sweep
from pneumarm.experiments.transfer import conditions
from pneumarm.learning import Shaping
from pneumarm.learning.online.schedule import Schedule
from pneumarm.simulation import Simulation
from pneumarm.simulation.kernel import raw_observation
from pneumarm.task import Reward, begin_states
from pneumarm.transitions import Store
from small import SMALL

PLAIN = "python:tests.plain_arms:linear"
ANGLES = "virtual:seed=3,pressure_sensors=off"
LABORATORY = LaboratorySettings(test_episodes=30, max_episodes=300)
AGENT = replace(THESIS, agents=2, validation_episodes=20)


def small_one(name: str, **sizes: Any) -> Any:
    found: Any = registry.experiment(name)
    learned = {} if name == "on-the-arm-only" else {"agent": AGENT}
    return replace(found, **learned, sizes=replace(found.sizes, **sizes))


SMALL_ONES = {
    "transfer": small_one("transfer", learning=40, block=10, test=10, warming=10),
    "transferability": small_one("transferability", test=10),
    "goal-area": small_one("goal-area", test=10),
    "overnight": small_one("overnight", first=20, second=20, block=10, hours=2.0),
    "on-the-arm-only": small_one("on-the-arm-only", looks=20, test=10),
    "displacement": small_one("displacement", adapting=10, shown=40, typical=2),
}


@pytest.fixture(scope="module")
def small_material(small_run: Path) -> Simulated:
    simulation = Simulation.load(small_run / "simulation.safetensors")
    with Store.open(small_run / "transitions.db") as store:
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
    return Simulated(SMALL.arm, simulation, begin)


def rows_of(experiment: Experiment, of: Simulated, runs: int = 2) -> TrialRows:
    measured = [
        (trial, run, experiment.measure(of, trial, run, LABORATORY))
        for run in range(1, runs + 1)
        for trial in experiment.trials
    ]
    return sorted_rows(Row(of.arm, trial, run, dict(found), 0.0) for trial, run, found in measured)


@pytest.mark.parametrize("name", SMALL_ONES)
def test_an_experiment_leaves_a_page(name: str, small_material: Simulated, tmp_path: Path) -> None:
    experiment = SMALL_ONES[name]
    rows = rows_of(experiment, small_material)
    assert all(np.isfinite(list(row.figures.values())).all() for row in rows.rows)  # JSON knows no others
    first = rows.rows[0]
    assert experiment.measure(small_material, first.trial, first.run, LABORATORY) == first.figures
    analysis = experiment.analyse(rows)
    page = write_page(experiment, tmp_path, analysis, rows).read_text()
    assert page.count("data:image/svg") == sum(len(section.figures) for section in analysis.sections) > 0
    results = json.loads((tmp_path / "results.json").read_text())
    assert len(results["claims"]) == len(analysis.claims)
    assert {claim.about for claim in analysis.claims} == keys_of(experiment.name)
    assert all(claim["thesis"] for claim in results["claims"])
    assert json.dumps(experiment.settings()) != json.dumps(type(experiment)().settings())


def test_the_agents_that_are_compared_come_from_the_same_training(small_material: Simulated) -> None:
    """The test in the simulation is of the agent as it arrives, whatever it will learn with, and another a run."""
    experiment = SMALL_ONES["transfer"]
    rows = rows_of(experiment, small_material)
    before = np.stack([values(rows, "simulation, exploring: reward", trial) for trial in conditions.RATES])
    assert (before == before[0]).all()
    assert before[0, 0, 0] != before[0, 0, 1]
    courses = [blocks(rows, "reward", trial) for trial in conditions.RATES]
    assert courses[0].shape == (1, 2, 4)
    assert not np.array_equal(courses[0], courses[1])


def test_conditions_change_what_they_say() -> None:
    parameters = draw_parameters(3)
    ideal = without_noise(parameters)
    changed = {trial: conditions.changed(parameters, trial) for trial in conditions.CONDITIONS}
    assert changed[conditions.AS_IT_IS] == changed[conditions.WARM] == parameters
    assert changed[conditions.NO_NOISE] == replace(parameters, sensors=ideal.sensors) != parameters
    assert changed[conditions.PUNCTUAL] == replace(parameters, jitter=0.0) != parameters
    assert changed[conditions.ALL] == ideal


def test_days_are_alike_until_they_differ(small_material: Simulated) -> None:
    rows = rows_of(SMALL_ONES["overnight"], small_material, runs=1)
    learning, first_day, frozen, no_night = (blocks(rows, "actions", trial)[0, 0] for trial in DAYS)
    rewards = [blocks(rows, "reward", trial)[0, 0] for trial in DAYS]
    for other in (1, 3):
        np.testing.assert_array_equal(rewards[0][:2], rewards[other][:2])
        assert not np.array_equal(rewards[0][2:], rewards[other][2:])
    assert not np.array_equal(rewards[0][:2], rewards[2][:2])
    assert len(learning) == len(first_day) == len(frozen) == len(no_night) == 4


def test_looking_tells_goals_and_scales() -> None:
    arm = VirtualArm(draw_parameters(2), seed=1)
    agent = from_scratch.untrained_agent(arm, from_scratch.ONE, 60, seed=3)
    low, high = agent.goal_range[0]
    assert high - low > 400
    durations = np.random.default_rng(8).uniform(0, 1.5, (40, 1, 2))
    angle, pressure = Player(agent, arm).visit(durations)
    margin = (high - low) / 8  # goals are in the middle 80 % between the ends
    assert ((angle > low - margin - 8) & (angle < high + margin + 8)).all()
    begin = from_visits(agent, angle, pressure)
    np.testing.assert_array_equal(begin.angle, np.sort(angle, axis=0))
    assert np.abs(begin.states).max() < 3  # four standard deviations would be 2
    raw = raw_observation(begin.states, agent.window, agent.scaling)
    np.testing.assert_allclose(raw[..., 0], begin.angle, atol=1e-3)
    assert (raw[..., 1] == 0).all()


def test_learning_on_the_arm_ends_when_the_criterion_is_met() -> None:
    """With a goal area as wide as the range every movement succeeds, so shaping grows the deviation every time."""
    wide = Reward(angle_tolerance=1e4, velocity_tolerance=1e4)
    shaping = Shaping(initial_deviation=30.0, episodes=10, performance_rate=0.2, grow=0.5)
    settings = replace(from_scratch.ONE, reward=wide, shaping=shaping)
    arm = VirtualArm(draw_parameters(2), seed=1)
    agent = from_scratch.untrained_agent(arm, settings, 10, seed=3)
    found = from_scratch.learn_on(arm, agent, 3)
    hours, deviation, performance = np.array(found.course).T
    assert found.met
    assert deviation[-1] == 1023
    np.testing.assert_allclose(deviation[1:-1], 1.5 * deviation[:-2])
    assert performance[-1] >= 0.95
    assert found.movements == 10 * len(hours) == found.steps
    assert hours[-1] * 3600 == found.seconds == arm.time
    assert (np.diff(hours) > 10 * 3.0 / 3600).all()  # venting and settling alone take 3 s
    assert not np.array_equal(found.agent.weights(), agent.weights())
    cut = from_scratch.learn_on(VirtualArm(), replace(agent, settings=replace(settings, max_episodes=15)), 3)
    assert (cut.movements, cut.met) == (15, False)


def test_movements_of_a_given_displacement(small_material: Simulated) -> None:
    agent = agent_of(small_material, AGENT, 1, LABORATORY)
    arm = VirtualArm(parameters_of(small_material.arm), seed=2)
    made = typical.typical_movement(agent, arm, 20.0, np.random.default_rng(1))
    assert made is not None
    step = 20.0 * arm.spec.counts_per_degree
    assert abs(abs(made.goal[0] - made.angle[0, 0]) - step) <= 10  # the noise of two readings
    assert len(made.time) == len(made.angle) == len(made.pressure) == len(made.valves)
    assert made.time[-1] >= (made.end or made.time[-1] - 0.8) + 0.8 - 1e-9
    assert typical.typical_movement(agent, arm, 120.0, np.random.default_rng(1)) is None


def test_out_of_the_way_and_ringing_by_hand() -> None:
    angle = np.array([100.0, 80.0, 150.0, 210.0, 190.0, 260.0, 205.0])[:, None]
    time = np.arange(7.0)
    nothing = np.zeros((7, 1, 2))
    made = typical.TypicalMovement(time, angle, nothing, nothing, np.array([200.0]), 4.0)
    assert made.beyond == 20.0
    assert made.ringing == 60.0
    missed = replace(made, end=None)
    assert missed.beyond == 60.0
    assert np.isnan(missed.ringing)


def test_thirds_and_relations_by_hand() -> None:
    distance = np.arange(9.0)
    actions, switches = (10 * distance).astype(np.int64) + 2, np.full(9, 3)
    won = np.arange(9) != 0
    found = typical.thirds(distance, actions, switches, won)
    assert found["success, short"] == pytest.approx(2 / 3)
    assert found["ratio, short"] == pytest.approx(6 / (12 + 22))
    assert found["ratio, long"] == pytest.approx(9 / (62 + 72 + 82))
    related = typical.relations(distance, actions, switches)
    assert related["correlation of actions"] == pytest.approx(1.0)
    assert "correlation of switches" not in related  # they do not vary
    assert related["few switches"] == 1.0


def test_draws_go_on(small_material: Simulated) -> None:
    agent = agent_of(small_material, AGENT, 1, LABORATORY)
    seed = run_seed(LABORATORY, 1)
    whole, rest = draws(agent, seed, 6, MOVEMENTS), draws(agent, seed, 2, MOVEMENTS, 4)
    for all_, part in zip(whole, rest, strict=True):
        np.testing.assert_array_equal(all_[4:], part)


@pytest.fixture(scope="module")
def plain_laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("plain")


@pytest.mark.parametrize("name", ["transfer", "goal-area", "overnight", "on-the-arm-only", "displacement"])
def test_they_move_any_arm(name: str, plain_laboratory: Path, tmp_path: Path) -> None:
    small = replace(LABORATORY, transitions=2_000, max_episodes=40)
    tiny = {
        "transfer": {"learning": 10, "block": 5, "test": 3, "warming": 2},
        "goal-area": {"test": 3},
        "overnight": {"first": 5, "second": 5, "block": 5, "hours": 0.01},
        "on-the-arm-only": {"looks": 5, "test": 3},
        "displacement": {"adapting": 3, "shown": 9, "typical": 1},
    }[name]
    one = SMALL_ONES[name]
    experiment = replace(one, sizes=replace(one.sizes, **tiny))
    done = sweep(experiment, plain_laboratory, [PLAIN], 1, small)
    assert {row.arm for row in done.rows.rows} == {PLAIN}
    for row in done.rows.rows:
        ideal = name == "transfer" and row.trial in conditions.IDEAL
        assert bool(row.figures) != ideal, row
    analysis = experiment.analyse(done.rows)
    told = "Only a virtual arm can" in " ".join(analysis.summary)
    assert told == (name == "transfer")
    assert write_page(experiment, tmp_path, analysis, done.rows).exists()


def test_it_is_said_for_how_long_an_arm_will_be_needed(tmp_path: Path) -> None:
    def said(name: str, arm: str = PLAIN, folder: Path = tmp_path / "none", **settings: Any) -> str | None:
        one = registry.experiment(name)
        rows = [(trial, 1) for trial in one.trials]
        return arm_time(one, arm, folder, rows, LaboratorySettings(**settings))

    recorded = tmp_path / "recorded"
    recorded.mkdir()
    (recorded / "simulation.safetensors").touch()
    ideal, each = 2 * 300 + 800 + 300, 300  # sensors without noise, never late; both and warm
    known = 3 * 2000 + 2 * 300 + 800 + each
    assert said("transfer", folder=recorded) == (
        f"{PLAIN}: at most {known:,} movements, about {round(known * 5.5 / 60)} minutes, 11.8 hours of the arm's time"
    )
    assert f"at most {known + ideal:,} movements" in str(said("transfer", "virtual:seed=1", recorded))
    assert said("goal-area", transitions=20_000, folder=tmp_path) == (
        f"{PLAIN}: 20,000 transitions to record and at most 1,200 movements, about 127 minutes, 2.1 hours of the "
        "arm's time"
    )
    nights = round((4 * 2000 * 5.5 + 3 * 14 * 3600) / 60)
    assert f"about {nights:,} minutes" in str(said("overnight", folder=recorded))
    assert "at most 1,001 movements" in str(said("on-the-arm-only", folder=recorded, max_episodes=1))
    assert said("all-goals", folder=recorded) is None  # it learns and tests in the simulation
    assert said("coupling") is None  # it moves arms in a way of its own


def test_a_virtual_arm_is_moved_as_it_is_named(tmp_path: Path) -> None:
    """Not as a plain one with the same parameters: without what is left out of it, at the rate that it is read at."""
    name = "virtual:seed=3,rate=40,pressure_sensors=off,sensors=velocity"
    of = Simulated(name, None, None)  # type: ignore[arg-type]
    parameters = parameters_of(name)
    assert parameters is not None
    with (
        new_arm(of, 1, LABORATORY) as arm,
        new_arm(of, 1, LABORATORY, conditions.changed(parameters, conditions.NO_NOISE)) as quiet,
        open_arm(name) as named,
    ):
        assert isinstance(arm, VirtualArm)
        assert isinstance(quiet, VirtualArm)
        assert arm.spec == quiet.spec == named.spec
        assert arm.parameters.sensors != quiet.parameters.sensors
        assert not arm.is_plain
    one = SMALL_ONES["transfer"]
    experiment = replace(one, sizes=replace(one.sizes, learning=4, block=2, test=2, warming=1))
    small = replace(LABORATORY, transitions=2_000, max_episodes=40)
    done = sweep(experiment, tmp_path, [ANGLES], 1, small)
    assert all(row.figures for row in done.rows.rows)


def test_turn_by_turn_it_is_the_compiled_loop(small_material: Simulated) -> None:
    agent, seed = agent_of(small_material, AGENT, 1, LABORATORY), 3
    made = []
    for kind in (Player, TurnPlayer):
        with VirtualArm(draw_parameters(3), seed=7) as arm:
            one = kind(agent, arm, 0.05, AGENT.exploration, seed)
            near = Schedule(60.0, 0.1, 5.0, 0.1)
            rows = [*one.play(*draws(agent, seed, 3, MOVEMENTS)).rows()]
            rows += one.play(*draws(agent, seed, 3, MOVEMENTS, 3), near).rows()
            seen = one.visit(draws(agent, seed, 2, MOVEMENTS, 6)[1])
            made.append((rows, one.learned.weights().tolist(), one.performance, [part.tolist() for part in seen]))
    assert made[0] == made[1]
