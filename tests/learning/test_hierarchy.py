"""Two levels of agents: subgoals, who is paid for what, and that steps from Python are those of the loop."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.errors import UnusableInput
from pneumarm.learning import LearnSettings, find_method, load_agent, test, train
from pneumarm.learning.hierarchy import HIERARCHY, HierarchicalAgent, HierarchySettings
from pneumarm.learning.hierarchy.loop import begin_levels, go_on, hierarchy, level_memory, upper_shape
from pneumarm.learning.online.loop import remember
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.values import draw_networks, pack
from pneumarm.random import random_state
from pneumarm.simulation import Simulation
from pneumarm.simulation.layout import layout_of
from pneumarm.task.acting import test_acting as moved_step_by_step
from pneumarm.task.environment import environment
from pneumarm.task.movements import TEST

GREEDY = Schedule(np.inf, 0.0, 1.0, 0.0)
SHORT = HierarchySettings(agents=1, max_episodes=300, validation_episodes=10, cutoff=30)


def an_agent(simulation: Simulation, settings: HierarchySettings, seed: int = 0) -> HierarchicalAgent:
    random = np.random.default_rng(seed)
    lower = pack(draw_networks(simulation.window, settings, random), simulation.window)
    upper = random.uniform(-0.3, 0.3, upper_shape(simulation.window, settings)).astype(np.float32)
    return HierarchicalAgent(simulation, upper, lower, settings)


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("upper_state", ["angles", "whole"])
def test_steps_from_python_are_those_of_the_loop(joints: int, upper_state: str) -> None:
    simulation = synthetic_simulation(joints)
    begin = synthetic_begin_states(simulation)
    agent = an_agent(simulation, replace(SHORT, upper_state=upper_state))  # type: ignore[arg-type]
    made = test(agent, simulation, begin, 8, 3)
    again = moved_step_by_step(agent.actor(), environment(simulation, begin, agent.settings), 8, (3, TEST))
    for name in ("goal", "reward", "actions", "switches"):
        np.testing.assert_array_equal(getattr(made, name), getattr(again, name))
    assert made.all_switches.max() > 0


@pytest.mark.parametrize("ways", [(0.0,), (0.5,), (1.0,), (0.0, 0.5, 1.0)])
def test_subgoals_lie_on_the_way_to_the_goal(ways: tuple[float, ...]) -> None:
    simulation = synthetic_simulation(2)
    begin = synthetic_begin_states(simulation)
    actor = an_agent(simulation, replace(SHORT, ways=ways)).actor()
    seen = set()
    for state, angle in zip(begin.states[::7], begin.angle[::7], strict=True):
        goal = np.array([400.0, 700.0])
        actor.begin(state, goal)
        shares = (actor.subgoal - angle) / (goal - angle)
        for share in shares:
            assert np.abs(np.array(ways) - share).min() < 1e-3
        seen |= set(np.round(shares, 3))
    assert len(seen) >= min(len(ways), 2)


def test_what_both_levels_learn_from_a_step() -> None:
    """A lower agent at its subgoal is paid for that alone; the upper one when the period is over, both discounted."""
    simulation = synthetic_simulation(2)
    begin = synthetic_begin_states(simulation)
    window, scaling = simulation.window, simulation.scaling
    settings = replace(SHORT, ways=(0.0,), period=2, subgoal=20.0, discount=0.9, learning_rate=0.1, return_scale=1.0)
    upper = np.zeros(upper_shape(window, settings), np.float32)
    agent = an_agent(simulation, settings)
    lower = np.zeros_like(agent.lower)
    levels = hierarchy((upper, lower), simulation.spec, window, scaling, settings)
    thinks, place = level_memory(levels), layout_of(window)
    x = np.zeros(place.size, np.float32)
    x[place.one] = 1
    x[: place.command] = begin.states[0]
    random = random_state(0)
    begin_levels(levels, GREEDY, thinks, x, begin.angle[0] + 300.0, random)
    np.testing.assert_allclose(thinks.aim, begin.angle[0], atol=1e-2)
    remember(thinks.low, x)
    x[0] += 100 / levels.unit[0, 1]  # joint 1 leaves its subgoal, joint 2 stays at its own
    thinks.low.paid[:] = -1.0, -9.0
    go_on(levels, GREEDY, thinks, x, random, False)
    assert lower[0, -1, 0] == pytest.approx(0.1 * -1)
    assert lower[1, -1, 0] == pytest.approx(0.1 * (-9 + 20 + 1))
    assert upper[0, -1, 0] == 0
    thinks.low.paid[:] = 50.0, 50.0
    remember(thinks.low, x)
    before = lower.copy()
    go_on(levels, GREEDY, thinks, x, random, True)
    total = -1 - 8 + 0.9 * 50
    assert upper[0, -1, 0] == pytest.approx(0.1 * total, rel=1e-5)
    assert lower[0, -1, 0] == pytest.approx(before[0, -1, 0] + 0.1 * (50 - before[0, -1, 0]), rel=1e-4)
    at_both = 50 + 20 - before[1, -1, 0]
    assert lower[1, -1, 0] == pytest.approx(before[1, -1, 0] + 0.1 * at_both, rel=1e-4)


def test_its_settings_are_given_as_those_of_ones_own() -> None:
    chosen = LearnSettings(method="hierarchy", own={"period": "7", "ways": [0.5, 1.0]}).chosen
    assert chosen == HierarchySettings(period=7, ways=(0.5, 1.0))
    with pytest.raises(UnusableInput, match=r"method hierarchy: has no setting perod; it has .*period"):
        LearnSettings(method="hierarchy", own={"perod": "7"})
    with pytest.raises(UnusableInput, match="expected reach, what hierarchy is for"):
        LearnSettings(method="hierarchy", task="settle")


def test_is_trained_and_kept_as_any_method(tmp_path: Path) -> None:
    simulation = synthetic_simulation(2)
    begin = synthetic_begin_states(simulation)
    method = find_method("hierarchy")
    assert method is HIERARCHY
    first = train(simulation, begin, SHORT, 4, threads=1)  # its settings say by which method
    second = train(simulation, begin, SHORT, 4, method=method, checkpoint=tmp_path / "checkpoint")
    np.testing.assert_array_equal(first.agent.upper, second.agent.upper)
    assert (first.agent.upper != an_agent(simulation, SHORT).upper).any()
    assert first.episodes[0] == 300
    first.agent.save(tmp_path / "agent")
    found = load_agent(tmp_path / "agent")
    assert isinstance(found, HierarchicalAgent)
    assert found.settings == SHORT
    np.testing.assert_array_equal(found.lower, second.agent.lower)
    with pytest.raises(UnusableInput, match="ways"):
        HierarchySettings(ways=(2.0,))
    replace(first.agent, upper=first.agent.upper[:, 1:].copy()).save(tmp_path / "bad")
    with pytest.raises(UnusableInput, match="expected weights"):
        load_agent(tmp_path / "bad")
