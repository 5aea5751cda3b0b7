"""Enforced Sub-Populations: populations, the recurrent network, and that evolved agents are agents like all."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.errors import UnusableInput
from pneumarm.learning import LearnSettings, find_method, load_agent, test, train
from pneumarm.learning.evolution import ESP, EvolutionSettings, EvolvedAgent
from pneumarm.learning.evolution.acting import arms_of, input_count, measure_fitness, seen_places, world
from pneumarm.learning.evolution.populations import (
    SubPopulationSettings,
    burst,
    draw_networks,
    first_neurons,
    mean_fitness,
    recombine,
)
from pneumarm.learning.evolution.recurrent import forget, memory_of, recur
from pneumarm.random import random_states
from pneumarm.simulation import Simulation
from pneumarm.task import BeginStates
from pneumarm.task.acting import test_acting as moved_step_by_step
from pneumarm.task.environment import environment
from pneumarm.task.movements import TEST

FEW = SubPopulationSettings(neurons=8, trials=3)
SHORT = EvolutionSettings(
    agents=1, generations=3, neurons=8, episodes=8, champion_episodes=16, validation_episodes=10, cutoff=30
)


def an_agent(simulation: Simulation, settings: EvolutionSettings, seed: int = 0) -> EvolvedAgent:
    inputs = input_count(simulation.window, settings)
    size = settings.hidden * (inputs + settings.hidden)
    weights = np.random.default_rng(seed).normal(0, 0.7, size).astype(np.float32)
    return EvolvedAgent(simulation, weights, settings)


def test_every_neuron_is_in_as_many_networks_as_it_has_trials() -> None:
    neurons = first_neurons(5, 7, FEW, np.random.default_rng(0))
    assert 0.9 < np.abs(neurons).max() <= 1.0
    chosen, networks = draw_networks(neurons, FEW.trials, np.random.default_rng(1))
    assert networks.shape == (24, 5, 7)
    for unit in range(5):
        np.testing.assert_array_equal(np.bincount(chosen[:, unit]), np.full(8, 3))
        np.testing.assert_array_equal(networks[:, unit], neurons[unit, chosen[:, unit]])
    assert len({tuple(row) for row in chosen}) > 20, "units are combined independently"


def test_a_neurons_fitness_is_the_mean_of_its_networks() -> None:
    chosen = np.array([[0, 1], [1, 0], [0, 0], [1, 1]])
    fitness = mean_fitness(chosen, np.array([1.0, 2.0, 5.0, 8.0]), 2)
    np.testing.assert_array_equal(fitness, [[3.0, 5.0], [3.5, 4.5]])


def test_the_best_half_stays_and_children_of_the_best_quarter_replace_the_rest() -> None:
    neurons = np.arange(2 * 8 * 6, dtype=np.float32).reshape(2, 8, 6)
    fitness = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [7, 6, 5, 4, 3, 2, 1, 0]], float)
    kept = replace(FEW, mutation=0.0)
    evolved = recombine(neurons, fitness, kept, np.random.default_rng(0))
    np.testing.assert_array_equal(evolved[0, :4], neurons[0, [7, 6, 5, 4]])
    np.testing.assert_array_equal(evolved[1, :4], neurons[1, [0, 1, 2, 3]])
    for unit in range(2):
        parents = evolved[unit, :2]
        for child in evolved[unit, 4:]:
            assert all(gene in parents[:, place] for place, gene in enumerate(child)), "genes stay in their places"
    mutated = recombine(neurons, fitness, FEW, np.random.default_rng(0))
    np.testing.assert_array_equal(mutated[:, :4], evolved[:, :4])


def test_a_mutation_changes_one_weight() -> None:
    neurons = np.zeros((3, 8, 6), np.float32)
    evolved = recombine(neurons, np.zeros((3, 8)), FEW, np.random.default_rng(0))
    np.testing.assert_array_equal((evolved != 0).sum(axis=2), np.tile([0, 0, 0, 0, 1, 1, 1, 1], (3, 1)))


def test_a_burst_is_around_the_best_network_and_holds_it() -> None:
    best = np.arange(10, dtype=np.float32).reshape(2, 5)
    around = burst(best, replace(FEW, neurons=2_000, spread=0.1), np.random.default_rng(0))
    np.testing.assert_array_equal(around[:, 0], best)
    np.testing.assert_allclose(np.median(around, axis=1), best, atol=0.02)
    distance = np.abs(around - best[:, None])
    np.testing.assert_allclose(np.median(distance), 0.1, atol=0.01)  # the quartiles of a Cauchy distribution


def test_a_step_of_the_network_is_that_of_its_formula() -> None:
    random = np.random.default_rng(0)
    network = random.normal(0, 1, (4, 3 + 4)).astype(np.float32)
    (seen,), (units,) = memory_of(1, 3, 4, 5)
    before = np.zeros((4, 5))
    for _ in range(3):
        seen[:2] = random.normal(0, 1, (2, 5))
        before = np.tanh(network[:, :3] @ np.vstack([seen[:2], np.ones(5)]) + network[:, 3:] @ before)
        recur(network, seen, units)
        np.testing.assert_allclose(units, before, atol=1e-4)
    forget(seen, 4)
    recur(network, seen, units)
    np.testing.assert_allclose(units, np.tanh(network[:, :3] @ seen[:3]), atol=1e-4)


@pytest.mark.parametrize(
    ("hidden_from_it", "names"),
    [
        ({}, ["angle[k]", "velocity[k]", "pressure_1[k]", "pressure_2[k]"]),
        ({"velocity": False}, ["angle[k]", "pressure_1[k]", "pressure_2[k]"]),
        ({"velocity": False, "pressures": False}, ["angle[k]"]),
        (
            {"history": True, "velocity": False, "pressures": False},
            ["angle[k]", "angle[k-1]", "command_1[k-1]", "command_2[k-1]"],
        ),
    ],
)
def test_what_networks_see_of_the_state(hidden_from_it: dict[str, bool], names: list[str]) -> None:
    window = synthetic_simulation(1, history=2).window
    places = seen_places(window, replace(SHORT, **hidden_from_it))  # type: ignore[arg-type]
    assert [window.input_names()[place] for place in places[:-1]] == names
    assert places[-1] == window.input_size, "the goal"


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("recurrent", [True, False])
def test_steps_from_python_are_those_of_the_loop(joints: int, recurrent: bool) -> None:
    simulation = synthetic_simulation(joints)
    begin = synthetic_begin_states(simulation)
    agent = an_agent(simulation, replace(SHORT, recurrent=recurrent))
    made = test(agent, simulation, begin, 8, 3)
    again = moved_step_by_step(agent.actor(), environment(simulation, begin, agent.settings), 8, (3, TEST))
    for name in ("goal", "angle_begin"):
        np.testing.assert_array_equal(getattr(made, name), getattr(again, name))
    quiet = replace(agent.settings, noise=replace(agent.settings.noise, factor=0.0))
    silent = EvolvedAgent(simulation, agent.policy, quiet)
    made = test(silent, simulation, begin, 8, 3)
    again = moved_step_by_step(silent.actor(), environment(simulation, begin, quiet), 8, (3, TEST))
    for name in ("goal", "reward", "actions", "switches"):
        np.testing.assert_array_equal(getattr(made, name), getattr(again, name))
    assert made.all_switches.max() > 0


def fitness_of(
    networks: NDArray[np.float32], simulation: Simulation, settings: EvolutionSettings
) -> NDArray[np.float64]:
    there = world(simulation, synthetic_begin_states(simulation), settings)
    arms = arms_of(there, 3, settings.hidden, 6)
    found = np.zeros(len(networks))
    measure_fitness(there, networks, arms, random_states(5, 6), found)
    return found


def test_fitness_is_the_mean_reward_whatever_the_neighbours_do() -> None:
    simulation = synthetic_simulation()
    one, other = (an_agent(simulation, SHORT, seed).network for seed in (0, 1))
    together = fitness_of(np.stack([one, other, one]), simulation, SHORT)
    assert together[0] == together[2]
    assert together[1] == fitness_of(other[None].copy(), simulation, SHORT)[0]
    strict = replace(SHORT, reward=replace(SHORT.reward, angle_tolerance=1e-6))
    nothing = fitness_of(np.zeros_like(one)[None], simulation, strict)
    assert nothing[0] == pytest.approx(-SHORT.cutoff), "closed valves, no switch, no goal reached"


def test_evolution_improves_and_goes_on_from_a_checkpoint(
    simulation: Simulation, begin: BeginStates, tmp_path: Path
) -> None:
    settings = replace(SHORT, generations=12, agents=2)
    whole = train(simulation, begin, settings, 1, threads=2)
    reward = whole.curves[whole.best][:, 1]
    assert (np.diff(reward) >= 0).all()
    assert reward[-1] > reward[0]

    class StopError(Exception):
        pass

    def stop_in_the_middle(now: object) -> None:
        calls.append(now)
        if len(calls) == 5:
            raise StopError

    calls: list[object] = []
    checkpoint = tmp_path / "checkpoint"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pneumarm.learning.training._CHECKPOINT_EVERY", 0.0)
        with pytest.raises(StopError):
            train(simulation, begin, settings, 1, checkpoint=checkpoint, progress=stop_in_the_middle)
    resumed = train(simulation, begin, settings, 1, checkpoint=checkpoint, threads=1)
    np.testing.assert_array_equal(resumed.agent.policy, whole.agent.policy)
    np.testing.assert_array_equal(resumed.curves[0], whole.curves[0])
    np.testing.assert_array_equal(resumed.steps, whole.steps)


def test_it_is_found_by_name_saved_and_loaded(simulation: Simulation, begin: BeginStates, tmp_path: Path) -> None:
    assert find_method("esp") is ESP
    chosen = LearnSettings(method="esp", own={"velocity": "false", "generations": "7"}).chosen
    assert chosen == EvolutionSettings(velocity=False, generations=7)
    agent = an_agent(simulation, replace(SHORT, velocity=False))
    agent.save(tmp_path / "agent")
    again = load_agent(tmp_path / "agent")
    assert isinstance(again, EvolvedAgent)
    assert again.settings == agent.settings
    np.testing.assert_array_equal(again.policy, agent.policy)
    replace(agent, policy=agent.policy[1:]).save(tmp_path / "cut")
    with pytest.raises(UnusableInput, match=r"cut: expected \d+ policy weights"):
        load_agent(tmp_path / "cut")


def test_too_few_units_are_refused() -> None:
    simulation = synthetic_simulation(2)
    with pytest.raises(UnusableInput, match="hidden: expected 4 units or more, one a muscle, got 3"):
        train(simulation, synthetic_begin_states(simulation), replace(SHORT, hidden=3), 0)
