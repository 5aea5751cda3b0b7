"""What a simulation says of pulses, of an arm that has none."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm.virtual import VirtualArm
from pneumarm.simulation import FitSettings, fit, fit_store
from pneumarm.simulation.spread import spread_over_periods
from pneumarm.transitions import CollectSettings, Store, collect


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    arm = VirtualArm(seed=4, pulses=False)
    with Store.for_arm(tmp_path_factory.mktemp("spread") / "arm.db", arm.spec) as store:
        collect(arm, store, 3_000, 4, settings=CollectSettings())
        yield store


@pytest.fixture(scope="module")
def made(store):
    return fit_store(store, FitSettings(history=2))


def test_a_record_without_pulses_is_learned_from_as_it_is(made):
    commands = made.filtered.transitions.inputs[:, -4:]
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
        spec=replace(store.spec, pulses=True),
        goal_range=made.simulation.goal_range,
        settings=FitSettings(history=2),
    ).simulation
    pressures = slice(2, None)
    assert (error_of(made.simulation, asked) < 0.3).all()
    assert (error_of(untaught, asked)[pressures] > 2 * error_of(made.simulation, asked)[pressures]).any()
    assert (error_of(made.simulation, known) < 1.2 * error_of(untaught, known)).all()
