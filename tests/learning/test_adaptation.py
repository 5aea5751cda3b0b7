"""Adapting to an arm: a changed one is learned, an unchanged one is left alone, what is unseen is not forgotten."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm import BeginState, ControlCycle, Reading, guarded
from pneumarm.arm.valves import VALVES
from pneumarm.control import PlanAgent
from pneumarm.errors import UnusableInput
from pneumarm.learning import Adaptation, AdaptationSettings, PolicyAgent, PolicySettings, adaptation
from pneumarm.learning import train as train_any
from pneumarm.learning.fleet.adaptation import adapted_simulation, rehearse
from pneumarm.simulation import SimulationArm
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.quality import residue
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.rows import Recorded, Rows, joined
from pneumarm.transitions.window import transitions

POLICY = PolicySettings(updates=40, agents=1, arms=32, steps=16, hidden=(8,), validation_episodes=200, lookahead=0)
SETTINGS = AdaptationSettings(updates=20, warm_up=5)


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
    return joined(blocks)


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


@pytest.mark.parametrize("joints", [1, 2])
def test_a_changed_arm_is_learned_and_judged_on_other_movements(joints: int) -> None:
    origin = synthetic_simulation(joints)
    arm = changed(origin)
    fitted = adapted_simulation(origin, origin, moved(arm, 60), SETTINGS, 0)
    assert fitted is not None
    fresh = moved(arm, 20, seed=9)
    assert np.log(squares(fitted, fresh) / squares(origin, fresh)).mean() < np.log(0.3)
    found = residue(fitted, transitions(fresh, origin.window)).std(axis=0).reshape(joints, -1)
    np.testing.assert_allclose(fitted.error_std, found, rtol=0.5)
    assert fitted.scaling is origin.scaling
    assert fitted.spec == origin.spec


def test_an_arm_that_is_as_it_was_changes_nothing(agent: PolicyAgent) -> None:
    rows = moved(agent.simulation, 60)
    adapting = Adaptation(agent, SETTINGS)
    adapting.learn(rows, 100)
    assert adapting.agent is agent
    assert adapting.accepted == 0


def test_rehearsal_keeps_what_the_movements_do_not_show() -> None:
    origin = synthetic_simulation()
    rows = moved(changed(origin), 60)
    unseen = rehearse(origin, transitions(rows, origin.window), 1000, np.random.default_rng(5))
    forgotten = []
    for share in (0.0, 1.0):
        fitted = adapted_simulation(origin, origin, rows, replace(SETTINGS, rehearsed=share), 0)
        assert fitted is not None
        forgotten.append(np.mean((residue(fitted, unseen) / origin.scaling.observation_scale) ** 2))
    assert forgotten[1] < forgotten[0]


def test_too_few_movements_are_left_alone(agent: PolicyAgent, changed_rows: Rows) -> None:
    few = Rows(**{name: values[changed_rows.sequence < 10] for name, values in vars(changed_rows).items()})
    assert adapted_simulation(agent.simulation, agent.simulation, few, SETTINGS, 0) is None


def test_it_is_reproducible_and_its_state_is_all_there_is(agent: PolicyAgent, changed_rows: Rows) -> None:
    one, other, resumed = (Adaptation(agent, SETTINGS, seed=3) for _ in range(3))
    for adapting in (one, other):
        adapting.learn(changed_rows, 100)
    assert one.accepted == 1
    assert one.get_state() == other.get_state() != Adaptation(agent, SETTINGS).get_state()
    resumed.set_state(one.get_state())
    assert resumed.get_state() == one.get_state()
    assert not resumed.is_due(100)
    assert resumed.is_due(200)
    more = moved(changed(agent.simulation, 1.8), 60, seed=4)
    for adapting in (one, resumed):
        adapting.learn(more, 200)
    assert one.accepted == 2
    assert one.get_state() == resumed.get_state()
    for damaged in (b"", one.get_state()[:-1], one.get_state()[:-8], b"\xff" * len(one.get_state())):
        with pytest.raises(UnusableInput, match="state of the adaptation"):
            resumed.set_state(damaged)


def test_the_policy_gets_better_in_the_new_simulation(agent: PolicyAgent, changed_rows: Rows) -> None:
    adapting = Adaptation(agent, SETTINGS)
    adapting.learn(changed_rows, 100)
    begin = synthetic_begin_states(agent.simulation)
    now = changed(agent.simulation)
    before, after = (one.test(now, begin, 1000, (1,)).reward.mean() for one in (agent, adapting.agent))
    assert after > before + 0.5


def test_only_what_can_adapt_does(agent: PolicyAgent) -> None:
    assert adaptation(agent, AdaptationSettings()) is not None
    assert adaptation(agent, AdaptationSettings(every=0)) is None
    linear = replace(agent, simulation=synthetic_simulation(direct=True))
    assert adaptation(linear, AdaptationSettings()) is None
    assert adaptation(PlanAgent(agent.simulation), AdaptationSettings()) is None
    with pytest.raises(UnusableInput, match="judged"):
        AdaptationSettings(judged=1.0)
