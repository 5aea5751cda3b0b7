"""Adapting to an arm: a changed one is learned, an unchanged one is left alone, what is unseen is not forgotten."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.adaptation import (
    Adaptation,
    AdaptationSettings,
    RefitSettings,
    TrialSettings,
    WatchSettings,
    adaptation_of,
    sentences,
)
from pneumarm.adaptation.plastic import plastic, with_plastic
from pneumarm.adaptation.refit import _outputs_fitted, refit, rehearse
from pneumarm.arm import BeginState, ControlCycle, Reading, guarded
from pneumarm.arm.valves import VALVES
from pneumarm.errors import UnusableInput
from pneumarm.learning import PolicyAgent, PolicySettings, fingerprint
from pneumarm.learning import train as train_any
from pneumarm.learning.planned.agent import PlanAgent
from pneumarm.simulation import SimulationArm
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.quality import residue
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions import Store, collect
from pneumarm.transitions.rows import Recorded, Rows, join_rows
from pneumarm.transitions.window import transitions

POLICY = PolicySettings(updates=40, agents=1, arms=32, steps=16, hidden=(8,), validation_episodes=200, lookahead=0)
REFIT = RefitSettings(fewest_rehearsed=300)
SETTINGS = AdaptationSettings(updates=20, warm_up=5, refit=REFIT)


def changed(simulation: Simulation, by: float = 1.4) -> Simulation:
    """Return the simulation of an arm whose pressures change faster by a factor."""
    networks = tuple(
        network
        if number % 3 == 0
        else replace(network, output_weights=by * network.output_weights, output_bias=by * network.output_bias)
        for number, network in enumerate(simulation.networks)
    )
    return replace(simulation, networks=networks)


def moved(simulation: Simulation, movements: int, seed: int = 0, noise: float = 0.1) -> Rows:
    """Return movements under random actions on the arm that ``simulation`` stands for."""
    arm = SimulationArm(simulation, seed=seed, noise=NoiseSettings(factor=noise))
    cycle, random = ControlCycle(guarded(arm)), np.random.default_rng(seed)
    blocks = []
    for number in range(movements):
        BeginState(deflate=0.5).reach(cycle.arm, random)
        left = [12]

        def decide(reading: Reading, left: list[int] = left) -> np.ndarray | None:
            left[0] -= 1
            return VALVES[random.integers(9, size=simulation.window.joints)] if left[0] >= 0 else None

        one = Recorded.from_steps(list(cycle.run(decide)), arm.spec)
        each = (np.full(len(one), number), one.step, one.time, one.angle, one.pressure, one.command)
        blocks.append(Rows(*each, np.ones(len(one), bool)))
    return join_rows(blocks)


@pytest.fixture(scope="module")
def agent() -> PolicyAgent:
    simulation = synthetic_simulation()
    return train_any(simulation, synthetic_begin_states(simulation), POLICY, threads=1).agent  # type: ignore[return-value]


@pytest.fixture(scope="module")
def changed_rows() -> Rows:
    return moved(changed(synthetic_simulation()), 60)


def squares(simulation: Simulation, rows: Rows) -> np.ndarray:
    error = residue(simulation, transitions(rows, simulation.window))
    return (error**2).mean(axis=0)[simulation.outputs] / simulation.scaling.observation_scale[simulation.outputs] ** 2


def test_movements_are_rehearsed_for_as_long_at_any_rate() -> None:
    simulation = synthetic_simulation(1, 1)
    known = transitions(moved(simulation, 5), simulation.window)
    lanes = {}
    for rate in (30, 60):
        at_rate = replace(simulation, spec=replace(simulation.spec, period=1 / rate))
        made = rehearse(at_rate, known, 400, np.random.default_rng(1))
        begins = known.inputs[known.step == 0][:, : simulation.window.state_size]
        is_begin = (made.inputs[:, None, : simulation.window.state_size] == begins).all(axis=2).any(axis=1)
        lanes[rate] = int(np.argmin(is_begin))
    assert lanes == {30: 20, 60: 10}


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("history", [1, 3])
def test_what_is_rehearsed_is_what_the_simulation_says_of_movements(joints: int, history: int) -> None:
    simulation = synthetic_simulation(joints, history)
    known = transitions(moved(simulation, 5), simulation.window)
    made = rehearse(simulation, known, 95, np.random.default_rng(1))
    lanes, size = 5, simulation.window.observation_size
    assert made.inputs.shape == (95, simulation.window.input_size)
    np.testing.assert_allclose(made.target, simulation.predict(made.inputs), rtol=1e-5, atol=1e-4)
    np.testing.assert_array_equal(made.inputs[lanes:, :size], made.target[:-lanes])  # it goes on where it came
    states, commands = history * size, 2 * joints
    now, then = made.inputs[lanes:], made.inputs[:-lanes]
    np.testing.assert_array_equal(now[:, size:states], then[:, : states - size])
    np.testing.assert_array_equal(
        now[:, states : states + (history - 1) * commands],
        np.concatenate([then[:, -commands:], then[:, states:-commands]], axis=1)[:, : (history - 1) * commands],
    )
    assert set(np.unique(made.inputs[:, -commands:])) == {-1, 0, 1}


def movement(rows: Rows, number: int) -> Rows:
    chosen = rows.sequence == number
    return rows.where(chosen)


def first_of(rows: Rows, movements: int) -> Rows:
    return join_rows([movement(rows, number) for number in range(movements)])


@pytest.mark.parametrize(("joints", "second"), [(1, False), (2, False), (2, True)])
def test_a_changed_arm_is_learned_and_judged_on_other_movements(joints: int, second: bool) -> None:
    origin = synthetic_simulation(joints, second=second)
    arm = changed(origin)
    found = refit(origin, origin, moved(arm, 60), REFIT, 0)
    assert found is not None
    assert found.better
    fresh = moved(arm, 20, seed=9)
    assert np.log(squares(found.simulation, fresh) / squares(origin, fresh)).mean() < np.log(0.35 if second else 0.3)
    error = residue(found.simulation, transitions(fresh, origin.window))
    np.testing.assert_allclose(
        found.simulation.error_std, np.sqrt((error**2).mean(axis=0)).reshape(joints, -1), rtol=0.5
    )
    assert found.simulation.scaling is origin.scaling
    assert found.simulation.spec == origin.spec


def test_few_movements_are_enough_for_a_large_change_and_spoil_nothing_elsewhere() -> None:
    origin = synthetic_simulation()
    arm = changed(origin)
    found = refit(origin, origin, moved(arm, 10), REFIT, 0)
    assert found is not None
    assert found.better
    elsewhere = rehearse(arm, transitions(moved(arm, 30, seed=8), origin.window), 2000, np.random.default_rng(5))
    unit = origin.error_std.ravel()[origin.outputs] ** 2
    (angle, *after), (_, *before) = (
        (residue(one, elsewhere) ** 2).mean(axis=0)[origin.outputs] / unit for one in (found.simulation, origin)
    )
    assert angle < 0.1  # it has not changed
    assert np.all(np.array(after) < 0.75 * np.array(before))


def test_output_weights_are_those_of_ridge_regression(changed_rows: Rows) -> None:
    origin = synthetic_simulation()
    known = transitions(changed_rows, origin.window)
    stiff, free = (_outputs_fitted(origin, known, ridge) for ridge in (1e12, 1e-9))
    x = origin.scaling.inputs(known.inputs, origin.window)
    for output, place in enumerate(origin.outputs):
        before = origin.networks[output]
        np.testing.assert_allclose(stiff[output].output_weights, before.output_weights, atol=1e-6)
        hidden = np.tanh(x @ before.hidden_weights + before.hidden_bias)
        hidden = np.concatenate([hidden, np.ones((len(x), 1))], axis=1)
        scale = origin.scaling.observation_scale[place]
        wanted = (known.target[:, place].astype(np.float64) - known.inputs[:, place]) / scale
        best = hidden @ np.linalg.lstsq(hidden, wanted, rcond=None)[0]
        np.testing.assert_allclose(free[output](x)[:, 0], best, atol=1e-4)


@pytest.mark.parametrize("second", [False, True])
def test_all_that_an_adaptation_changes_are_numbers(second: bool) -> None:
    simulation = synthetic_simulation(2, second=second)
    agent = train_any(
        simulation, synthetic_begin_states(simulation), replace(POLICY, updates=1, practice=1), threads=1
    ).agent
    assert isinstance(agent, PolicyAgent)
    numbers = plastic(agent)
    other = with_plastic(agent, 2 * numbers)
    np.testing.assert_array_equal(plastic(other), 2 * numbers)
    x = np.random.default_rng(0).normal(size=(5, simulation.window.input_size))
    np.testing.assert_array_equal(with_plastic(other, numbers).simulation.networks[0](x), simulation.networks[0](x))


@pytest.mark.parametrize("recorded", [True, False])
def test_a_simulation_of_two_layers_goes_on_learning_from_its_recording(tmp_path: Path, recorded: bool) -> None:
    simulation = replace(synthetic_simulation(2, second=True), held_out=0.2)
    agent = train_any(
        simulation, synthetic_begin_states(simulation), replace(POLICY, updates=1, practice=1), threads=1
    ).agent
    assert isinstance(agent, PolicyAgent)
    never = replace(SETTINGS, updates=1, warm_up=1, refit=RefitSettings(gain=0.99, fewest_rehearsed=300))
    adapting, arm = Adaptation(agent, never), SimulationArm(changed(simulation), noise=NoiseSettings(factor=0.1))
    rows = moved(changed(simulation), 12)
    with Store.for_arm(tmp_path / "transitions.db", arm.spec) as store:
        collect(arm, store, 2500, 1)
        assert adapting.learn(rows, store if recorded else None) == recorded
    fresh = moved(changed(simulation), 5, seed=9)
    before, after = (squares(one, fresh)[[1, 2, 4, 5]] for one in (simulation, adapting.agent.simulation))
    assert (after < 0.7 * before).all() == recorded


def test_too_few_movements_are_left_alone(agent: PolicyAgent, changed_rows: Rows) -> None:
    few = first_of(changed_rows, 2 * REFIT.folds - 1)
    assert refit(agent.simulation, agent.simulation, few, REFIT, 0) is None
    adapting = Adaptation(agent, SETTINGS)
    assert not adapting.learn(few)
    assert adapting.agent is agent
    assert adapting.events == []


def test_an_arm_that_is_as_it_was_changes_nothing(agent: PolicyAgent) -> None:
    # Its error is that of an arm with this noise, so that there is nothing to gain.
    adapting = Adaptation(agent, SETTINGS)
    for seed in range(3):
        assert not adapting.learn(moved(agent.simulation, 40, seed))
    assert adapting.agent is agent
    assert adapting.accepted == 0
    assert [event.what for event in adapting.events] == ["refused"] * 3


def told_of(adapting: Adaptation, rows: Rows, rewards: float | Iterable[float]) -> None:
    numbers = np.unique(rows.sequence)
    each = repeat(rewards) if isinstance(rewards, int | float) else rewards
    for number, reward in zip(numbers, each, strict=False):
        adapting.observe(movement(rows, number), reward)


def test_a_change_is_noticed_and_only_movements_since_then_are_used(agent: PolicyAgent) -> None:
    # The error of the simulation is said to be that of the arm's noise, see ``moved``.
    exact = replace(agent.simulation, error_std=0.15 * agent.simulation.error_std)
    adapting = Adaptation(replace(agent, simulation=exact), SETTINGS)
    told_of(adapting, moved(agent.simulation, 30), 30.0)
    assert [event.what for event in adapting.events] == []
    assert adapting.usable == 30
    told_of(adapting, moved(changed(agent.simulation), 30, seed=1), 30.0)
    (event,) = adapting.events
    assert event.what == "noticed"
    assert 31 <= event.movement <= 40
    assert 28 <= event.figures["since"] <= 31
    assert adapting.usable == 60 - event.figures["since"]
    assert adapting.is_due()
    assert "changed" in sentences(adapting.events, adapting.quantities)[0]


def test_when_to_adapt_is_after_ever_more_movements(agent: PolicyAgent, changed_rows: Rows) -> None:
    adapting = Adaptation(agent, replace(SETTINGS, first=4, growth=2.0, every=10))
    due = []
    for number in range(40):
        adapting.observe(movement(changed_rows, number), 30.0)
        if adapting.is_due():
            due.append(adapting.movements)
            adapting._tried = adapting.movements
    assert due == [4, 8, 16, 26, 36]


@pytest.fixture(scope="module")
def adapted(agent: PolicyAgent, changed_rows: Rows) -> bytes:
    """Return the state of an agent that has become version 1 after ten movements with a reward of about 30."""
    adapting = Adaptation(agent, SETTINGS, seed=3)
    first = first_of(changed_rows, 10)
    told_of(adapting, first, np.linspace(28, 32, 10))
    assert adapting.is_due()
    assert adapting.learn(first)
    assert adapting.version == 1
    return adapting.get_state()


def resumed(agent: PolicyAgent, state: bytes) -> Adaptation:
    adapting = Adaptation(agent, SETTINGS, seed=3)
    adapting.set_state(state)
    return adapting


def test_an_agent_that_earns_less_is_taken_back(agent: PolicyAgent, adapted: bytes, changed_rows: Rows) -> None:
    adapting = resumed(agent, adapted)
    assert adapting.agent.policy is not agent.policy
    told_of(adapting, changed_rows, [*np.linspace(0, 20, 9)])
    assert adapting.version == 1  # nobody has looked yet
    adapting.observe(movement(changed_rows, 50), 10.0)
    assert adapting.version == 0
    np.testing.assert_array_equal(adapting.agent.policy, agent.policy)
    for mine, was in zip(adapting.agent.simulation.networks, agent.simulation.networks, strict=True):
        np.testing.assert_array_equal(mine.output_weights, was.output_weights)
    assert adapting.events[-1].what == "rolled back"
    assert not adapting.is_due()
    assert "rolled back" in sentences(adapting.events, adapting.quantities)[-1]


def test_an_agent_that_earns_no_less_becomes_the_one_to_go_back_to(
    agent: PolicyAgent, adapted: bytes, changed_rows: Rows
) -> None:
    adapting = resumed(agent, adapted)
    rewards = np.random.default_rng(0).normal(31, 2, SETTINGS.trial.looks[-1])
    for number, reward in enumerate(rewards):
        adapting.observe(movement(changed_rows, number % 60), float(reward))
    assert adapting.version == 1
    assert adapting._trusted is adapting.agent


def test_movements_of_a_test_take_nothing_back(agent: PolicyAgent, adapted: bytes, changed_rows: Rows) -> None:
    adapting = resumed(agent, adapted)
    for number in range(40):
        adapting.observe(movement(changed_rows, number), -100.0, judges=False)
    assert adapting.version == 1


def test_movements_of_an_arm_with_a_fault_are_counted_and_tell_nothing(
    agent: PolicyAgent, adapted: bytes, changed_rows: Rows
) -> None:
    adapting = resumed(agent, adapted)
    known = adapting.movements, len(adapting.events)
    broken = moved(changed(agent.simulation, 10.0), 20, seed=2)
    for number in range(20):
        adapting.observe(movement(broken, number), -100.0, sound=False)
    assert (adapting.movements, len(adapting.events)) == (known[0] + 20, known[1])
    assert adapting.version == 1
    told_of(adapting, broken, -100.0)
    assert len(adapting.events) > known[1]  # without a fault they would have told a lot


def test_it_is_reproducible_and_its_state_is_all_there_is(
    agent: PolicyAgent, adapted: bytes, changed_rows: Rows
) -> None:
    one = Adaptation(agent, SETTINGS, seed=3)
    first = first_of(changed_rows, 10)
    told_of(one, first, np.linspace(28, 32, 10))
    one.learn(first)
    assert one.get_state() == adapted != Adaptation(agent, SETTINGS).get_state()
    other = resumed(agent, adapted)
    more = moved(changed(agent.simulation, 2.2), 30, seed=4)
    for adapting in (one, other):
        told_of(adapting, more, 25.0)
        assert adapting.learn(more)
    assert one.get_state() == other.get_state()
    for damaged in (b"", adapted[:-1], adapted[:-8], b"\xff" * len(adapted)):
        with pytest.raises(UnusableInput, match="state of the adaptation"):
            other.set_state(damaged)


def test_the_policy_gets_better_in_the_new_simulation(agent: PolicyAgent, changed_rows: Rows) -> None:
    adapting = Adaptation(agent, SETTINGS)
    assert adapting.learn(changed_rows)
    begin = synthetic_begin_states(agent.simulation)
    now = changed(agent.simulation)
    before, after = (one.test(now, begin, 1000, (1,)).reward.mean() for one in (agent, adapting.agent))
    assert after > before + 0.5


def test_only_what_can_adapt_does(agent: PolicyAgent) -> None:
    assert adaptation_of(agent, AdaptationSettings()) is not None
    assert adaptation_of(agent, AdaptationSettings(every=0)) is None
    linear = replace(agent, simulation=synthetic_simulation(direct=True))
    assert adaptation_of(linear, AdaptationSettings()) is None
    assert adaptation_of(PlanAgent(agent.simulation), AdaptationSettings()) is None
    for wrong in (
        lambda: AdaptationSettings(growth=1.0),
        lambda: RefitSettings(folds=1),
        lambda: WatchSettings(allowance=5.0),
        lambda: TrialSettings(looks=(10, 10)),
    ):
        with pytest.raises(UnusableInput):
            wrong()


def test_a_fingerprint_tells_agents_by_their_simulation_too(agent: PolicyAgent) -> None:
    other = replace(agent, simulation=changed(agent.simulation))
    narrower = replace(agent, simulation=replace(agent.simulation, goal_range=agent.goal_range + 1))
    found = [fingerprint(one) for one in (agent, other, narrower, replace(agent, policy=agent.policy + 1))]
    assert len(set(found)) == 4
    assert fingerprint(replace(agent)) == found[0]
