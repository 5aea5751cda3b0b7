"""Plans are made better in the simulation by its gradient, and followed where they keep nearer than a policy."""

from dataclasses import replace

import numpy as np
import pytest

from learning.synthetic_arm import KINDS_OF_SIMULATION, synthetic_begin_states, synthetic_simulation
from pneumarm.arm import Reading
from pneumarm.arm.reference import Reference
from pneumarm.learning.planned.servo import PlannedServo
from pneumarm.learning.servo import ServoAgent, ServoSettings
from pneumarm.learning.servo.agent import ServoLearner
from pneumarm.learning.servo.gradient import ServoTask, Tape, tape
from pneumarm.learning.servo.predictive import (
    PLANS,
    Plans,
    PredictiveControl,
    improve,
    plans_of,
    play,
    price,
    slopes_by_commands,
)
from pneumarm.moving import MoveSettings, move, track
from pneumarm.simulation.arm import SimulationArm
from pneumarm.simulation.simulation import Simulation

STEPS = 9
SIMULATION = synthetic_simulation()
BEGIN = synthetic_begin_states(SIMULATION)
SMALL = ServoSettings(arms=8, agents=1, validation_movements=8)


def drawn(simulation: Simulation, n: int = PLANS) -> tuple[ServoTask, Plans, Tape]:
    """Return a task, plans drawn at random, and a tape that begins in a state of the simulation."""
    task, random = PlannedServo(simulation).task, np.random.default_rng(1)
    window = simulation.window
    here, plans = tape(task, STEPS, n), plans_of(STEPS, np.ones(window.command_size, np.float32), n)
    states = synthetic_begin_states(simulation).states
    here.x[0, : window.state_size] = states[0][:, None]
    here.x[0, window.input_size + window.joints] = 1
    here.reference[...] = random.normal(0, 0.3, here.reference.shape[:2])[..., None]
    plans.commands[...] = random.uniform(-0.7, 0.7, plans.commands.shape)
    return task, plans, here


@pytest.mark.parametrize("simulation", KINDS_OF_SIMULATION.values(), ids=KINDS_OF_SIMULATION)
def test_the_slopes_are_those_of_the_smooth_price(simulation: Simulation):
    task, plans, here = drawn(simulation, 1)
    commands = task.commands._replace(shortest=1e-6, leak=0.0)  # what has no slope, or jumps
    commands.inlet[:] = 1e6
    # Valve changes are counted in the price and smooth in its slopes: nothing is paid for them here.
    task = task._replace(past_the_limit=0.0, commands=commands, prices=task.prices._replace(change=0.0, slack=0.0))
    play(task, plans, here)
    slopes_by_commands(task, plans, here)
    slopes = plans.gradient.copy()
    way = slopes / np.linalg.norm(slopes)
    begun, found = plans.commands.copy(), []
    for distance in (1e-3, -1e-3):
        plans.commands[...] = begun + np.float32(distance) * way
        play(task, plans, here)
        price(task, plans, here)
        found.append(float(plans.cost[0]))
    assert (found[0] - found[1]) / 2e-3 == pytest.approx(np.linalg.norm(slopes), rel=0.02)


def test_valve_changes_are_counted_in_the_price():
    task, plans, here = drawn(synthetic_simulation(), 1)
    task = task._replace(
        prices=task.prices._replace(precision=1e9, far=0.0, slack=0.0, cocontraction=0.0, change=1.0)
    )
    here.x[0, : 3 * 4 + 2 * 2] = 0  # valves were closed before
    for commands, changes in (
        ([0, 0, 0], 0),
        ([1, 1, 0], 2),  # opens once, closes once
        ([0.5, 0.5, 0], 4),  # a pulse opens and closes
        ([1, 0.5, 0], 2),
        ([1, -1, 0], 3),  # the inlet closes as the outlet opens: one change of a muscle's valves
    ):
        plans.commands[...] = 0
        plans.commands[:3, 0, 0] = commands
        play(task, plans, here)
        price(task, plans, here)
        assert plans.cost[0] == pytest.approx(changes, abs=1e-3)


def test_the_cheapest_plan_is_played_and_costs_no_more_than_any_before():
    task, plans, here = drawn(synthetic_simulation())
    play(task, plans, here)
    price(task, plans, here)
    before = float(plans.cost.min())
    improve(task, plans, here, 20, 0.15)
    price(task, plans, here)
    assert plans.cost.max() == pytest.approx(plans.cost.min())
    assert plans.cost.max() == pytest.approx(plans.least.min(), rel=1e-4)
    assert plans.cost.max() < 0.9 * before


def test_a_muscle_that_is_not_there_is_told_nothing():
    simulation = synthetic_simulation()
    one = replace(simulation, spec=replace(simulation.spec, muscles=1))
    plan = PlannedServo(one).predictive()
    state = synthetic_begin_states(one).states[0]
    away = np.full((1 + plan.ahead, 1), one.goal_range[0, 1])
    pulses = plan.pulses(state, away)
    assert pulses[0, 0] != 0
    assert pulses[0, 1] == 0


def test_it_says_the_same_again():
    simulation = synthetic_simulation()
    plan = PlannedServo(simulation).predictive()
    states, wanted = synthetic_begin_states(simulation).states[:5], np.full((1 + plan.ahead, 1), 600.0)
    told = []
    for _ in range(2):
        plan.reset()
        told.append([plan.pulses(state, wanted) for state in states])
    np.testing.assert_array_equal(*told)


def test_what_a_plan_gains_is_asked_without_a_trace():
    agent = ServoLearner(SIMULATION, BEGIN, SMALL, 0, 0).agent()
    plan, state = agent.predictive(), BEGIN.states[0]
    assert plan is not None
    wanted = 520 + 80 * np.sin(0.2 * np.arange(1 + plan.ahead))[:, None]
    told = []
    for asks in (False, True):
        plan.reset()
        told.append([])
        for _ in range(3):
            if asks:
                assert plan.gains(state, wanted) > 0.5  # of a policy that has learned nothing
            told[-1].append(plan.pulses(state, wanted))
    np.testing.assert_array_equal(*told)


def test_a_simulation_that_is_planned_in_settles_holds_and_tracks():
    simulation = synthetic_simulation()
    # In pulses: a whole period moves this arm by nearly twice the tolerance, and rest is then a matter of luck.
    simulation = replace(simulation, error_std=simulation.error_std / 4, commands="pulses")
    servo, spec = PlannedServo(simulation), simulation.spec
    arm, controller = SimulationArm(simulation, seed=2), servo.controller()
    goals = np.array([[450.0], [600.0], [520.0]])
    made = [*move(arm, controller, goals, MoveSettings(hold=2, tries=1, tolerance=2))]
    assert [one.success for one in made] == [True] * 3
    sine = Reference(lambda time: np.array([520 + 8 * spec.counts_per_degree * np.sin(np.pi * time)]))
    assert track(arm, controller, sine, 5).rms_error[0] < 2


def test_where_turns_come_late_plans_take_less_time(monkeypatch: pytest.MonkeyPatch):
    """As on a computer that is too slow for them; on an arm whose clock stands while we compute none is late."""
    servo = PlannedServo(SIMULATION)
    controller, hurried = servo.controller(), []
    monkeypatch.setattr(PredictiveControl, "hurry", lambda plan: hurried.append(plan))
    controller.reset(np.array([600.0]))
    time, period = 0.0, servo.spec.period
    for late in (1.0, 1.2, 1.0, 2.0, 1.0):
        controller.act(Reading(time, np.array([500.0]), np.full((1, 2), 90.0)))
        time += late * period
    assert len(hurried) == 1


def test_to_take_less_time_is_to_make_plans_better_less_often():
    plan, improved = PlannedServo(SIMULATION).predictive(), []
    for _ in range(6):
        plan.hurry()
        improved.append(plan._times)
    assert improved == [10, 5, 2, 1, 1, 1]


def test_plans_are_followed_where_they_keep_nearer_than_the_policy():
    """A policy that has learned nothing is off by degrees, as its simulation and its arm say."""
    untrained = ServoLearner(SIMULATION, BEGIN, SMALL, 0, 0).agent()
    sine = Reference(lambda time: np.array([520 + 80 * np.sin(np.pi * time)]))

    def error(agent: ServoAgent) -> float:
        return float(track(SimulationArm(SIMULATION, seed=2), agent.controller(), sine, 6).rms_error[0])

    alone = error(replace(untrained, settings=replace(untrained.settings, planned=0)))
    assert error(untrained) < 0.7 * alone
