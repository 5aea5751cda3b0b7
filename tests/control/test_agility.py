"""How fast joints are, and what a search makes of it."""

from itertools import product

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm.valves import VALVES
from pneumarm.planning.agility import agility_of
from pneumarm.planning.planner import Planner, SimulationModel
from pneumarm.planning.search import (
    Agility,
    PlanProblem,
    PlanSettings,
    advance,
    copy,
    fewest_periods,
    find,
    problem,
    tree,
)
from pneumarm.task import Reward

TOLERANCE, SLOW, FASTEST, SHARPEST = 25.0, 20.0, 80.0, 40.0


def fewest_tried(off: float, speed: float, longest: int) -> float:
    """Return in how many periods a joint ``off`` its goal gets there at best, of all ways to gain and lose speed."""
    gains = np.array(list(product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=longest))).T * SHARPEST
    speeds, way = np.full(gains.shape[1], speed), np.full(gains.shape[1], off)
    for period, gain in enumerate(gains):
        if ((np.abs(way) <= TOLERANCE) & (np.abs(speeds) <= SLOW)).any():
            return period
        speeds = np.clip(speeds + gain, -FASTEST, FASTEST)
        way = way - speeds
    return longest


@pytest.mark.parametrize("speed", [-60.0, -20.0, 0.0, 30.0, 80.0])
@pytest.mark.parametrize("off", [10.0, 60.0, 130.0, 240.0])
def test_no_joint_gets_to_its_goal_sooner_than_the_bound_says(off: float, speed: float) -> None:
    bound = fewest_periods(off - TOLERANCE, speed, SLOW, FASTEST, SHARPEST)
    found = fewest_tried(off, speed, 6)
    assert 0 <= bound <= found
    assert bound >= found - 4


def test_without_agility_nothing_is_known_of_the_rest_of_the_way() -> None:
    assert fewest_periods(500.0, 0.0, SLOW, np.inf, np.inf) == 0.0


@pytest.fixture(scope="module")
def model() -> SimulationModel:
    return SimulationModel(synthetic_simulation(joints=2), PlanSettings())


def sought(model: SimulationModel, goal: np.ndarray, agility: Agility | None) -> PlanProblem:
    return problem(goal, Reward().on(model.spec), PlanSettings(), agility=agility)


def test_nine_of_ten_periods_of_valves_that_change_rarely_are_slower(model: SimulationModel) -> None:
    agility, hasty = agility_of(model.world, model.states, model.spec)
    assert agility.period == 1e3 * model.spec.period
    random, speeds = np.random.default_rng(5), []
    for _ in range(60):
        copy(model.states, 1, 0)
        valves = VALVES[random.integers(0, 9, 2)]
        for _ in range(40):
            if random.random() < 0.05:
                valves = VALVES[random.integers(0, 9, 2)]
            advance(model.world, model.states, 1, valves)
            speeds.append(np.abs(model.states.velocity[1]) * agility.period)
    slower = np.mean(np.array(speeds) <= agility.speed, axis=0)
    assert ((slower > 0.75) & (slower < 0.99)).all()
    for sure, quick in ((agility.speed, hasty.speed), (agility.acceleration, hasty.acceleration)):
        assert ((quick > 0) & (quick < sure)).all()
    assert (agility.acceleration < 2 * np.max(speeds, axis=0)).all()


def test_plans_are_found_among_fewer_states_and_cost_hardly_more(model: SimulationModel) -> None:
    begin = synthetic_begin_states(synthetic_simulation(joints=2))
    workspace = tree(PlanSettings(), 2)
    simulated, costs = [], []
    for number in (100, 700, 1300):
        for away in ([150.0, -100.0], [100.0, 60.0]):
            pair = []
            for agility in (None, model.agility):
                model.put(begin.states[number])
                pair.append(
                    find(model.world, model.states, sought(model, begin.angle[number] + away, agility), workspace)
                )
            whole, guessed = pair
            assert not guessed.proven
            if whole.proven and whole.reached:
                assert guessed.reached
                simulated.append(guessed.simulated / whole.simulated)
                costs.append(guessed.cost / whole.cost)
    assert len(costs) >= 2
    assert np.mean(simulated) < 0.7
    assert np.mean(costs) < 1.15


def test_where_a_search_ends_for_want_of_room_a_hastier_one_finds_a_plan() -> None:
    simulation, settings = synthetic_simulation(joints=2), PlanSettings(nodes=600)
    begin, found = synthetic_begin_states(simulation), 0
    model = SimulationModel(simulation, settings)
    workspace = tree(settings, 2)
    guesses = (model.agility, model.hasty)
    planner = Planner(model, settings)
    for number in range(0, 1500, 50):
        goal = begin.angle[number] + np.array([150.0, -100.0])
        model.put(begin.states[number])
        problems = [
            problem(goal, Reward().on(model.spec), settings, model.uncertainty, 2, guess) for guess in guesses
        ]
        sure, quick = (find(model.world, model.states, one, workspace) for one in problems)
        planner.reset(goal)
        model.put(begin.states[number])
        planner.choose_valves()
        assert planner.found is not None
        assert planner.found.reached == (sure.reached or quick.reached)
        found += quick.reached and not sure.reached
    assert found > 0


def test_a_second_search_tells_how_much_cheaper_a_plan_could_be(model: SimulationModel) -> None:
    begin = synthetic_begin_states(synthetic_simulation(joints=2))
    workspace, little = tree(PlanSettings(), 2), tree(PlanSettings(nodes=300), 2)
    proven = []
    for number in (100, 700, 1300):
        for away in ([150.0, -100.0], [100.0, 60.0], [20.0, 30.0]):
            model.put(begin.states[number])
            goal = begin.angle[number] + away
            unguided = sought(model, goal, None)
            whole = find(model.world, model.states, unguided, workspace)
            guessed = find(model.world, model.states, sought(model, goal, model.agility), workspace)
            assert guessed.least == 0
            surer = find(model.world, model.states, unguided, workspace, known=guessed)
            assert surer.cost <= guessed.cost
            assert surer.simulated > guessed.simulated
            if whole.proven:
                assert (surer.cost, surer.least) == (whole.cost, whole.cost)
                proven.append(guessed.cost > surer.cost)
            doubtful = find(model.world, model.states, unguided, little, known=guessed)
            assert 0 < doubtful.least <= surer.cost <= doubtful.cost
            assert doubtful.proven or doubtful.least < doubtful.cost
    assert len(proven) >= 3
