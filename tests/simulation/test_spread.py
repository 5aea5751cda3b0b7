"""What a simulation says of pulses, of an arm that has none."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm.virtual import VirtualArm
from pneumarm.learning import train
from pneumarm.learning.servo import ServoSettings
from pneumarm.moving import MoveSettings, move
from pneumarm.simulation import FitSettings, fit, fit_store
from pneumarm.simulation.spread import spread_over_periods
from pneumarm.task import begin_states
from pneumarm.task.reference import counts_of
from pneumarm.transitions import CollectSettings, Store, collect
from pneumarm.transitions.hysteresis import RADII


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    arm = VirtualArm(seed=4, pulses=False)
    with Store.for_arm(tmp_path_factory.mktemp("spread") / "arm.db", arm.spec) as store:
        collect(arm, store, 3_000, 4, settings=CollectSettings())
        yield store


@pytest.fixture(scope="module")
def made(store):
    return fit_store(store, FitSettings(history=2, memory=1))


def test_a_record_without_pulses_is_learned_from_as_it_is(made):
    commands = made.filtered.transitions.inputs[:, made.simulation.window.commanded]
    assert np.isin(commands, (-1, 0, 1)).all()
    assert made.simulation.commands == "valves"


def error_of(simulation, asked):
    """Return the errors (observation_size,) as a share of what changes."""
    error, change = simulation.predict(asked.inputs) - asked.target, asked.target - asked.observation
    return error.std(axis=0) / change.std(axis=0)


def test_on_average_pulses_do_what_whole_periods_do_as_often(made, store):
    asked = spread_over_periods(made.simulation, made.filtered.transitions, 7)
    known = made.filtered.transitions
    untaught = fit(
        known,
        made.filtered.stream("held-out"),
        spec=store.spec,
        goal_range=made.simulation.goal_range,
        settings=FitSettings(history=2, hysteresis=RADII, spread=False),
    ).simulation
    others = np.setdiff1d(np.arange(asked.inputs.shape[1]), made.simulation.window.commanded)
    np.testing.assert_array_equal(asked.inputs[:, others], known.inputs[:, others])
    assert made.simulation.spread
    assert not untaught.spread
    pressures = slice(2, None)
    assert (error_of(made.simulation, asked) < 0.3).all()
    assert (error_of(untaught, asked)[pressures] > 2 * error_of(made.simulation, asked)[pressures]).any()
    assert (error_of(made.simulation, known) < 1.2 * error_of(untaught, known)).all()


def test_an_arm_with_pulses_that_was_recorded_without_any_is_taught_them_too(made, store):
    known, apart = made.filtered.transitions, made.filtered.stream("held-out")
    taught = fit(
        known,
        apart,
        spec=replace(store.spec, pulses=True),
        goal_range=made.simulation.goal_range,
        settings=FitSettings(history=2, hysteresis=RADII, epochs=4),
    ).simulation
    assert taught.spread
    assert taught.commands == "valves"


def test_a_servo_of_an_arm_without_pulses_arrives_and_stays(made, store):
    simulation = made.simulation
    begin = begin_states(store.blocks(), simulation.window, simulation.scaling, store.spec)
    agent = train(simulation, begin, ServoSettings(agents=1, updates=400)).agent
    arm = VirtualArm(seed=4, pulses=False)
    goals = counts_of(np.random.default_rng(4).uniform(-20, 20, (12, 1)), arm.spec)
    with arm:
        made_moves = move(arm, agent.controller(), goals, MoveSettings(hold=2.0, tries=1))
        rest = np.array([one.rest_error.max() for one in made_moves])
    assert np.median(rest) < 2.2
    assert np.mean(rest < 4.0) > 0.8
