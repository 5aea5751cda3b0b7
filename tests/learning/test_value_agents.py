"""Agents that learn values on an arm: training, files, acting step by step, and what may be chosen."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm.valves import NEVER
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning import METHODS, Learns, LearnSettings, load_agent, test, train
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.values import VALUES, ValueAgent, ValueSettings
from pneumarm.learning.values.agent import KIND
from pneumarm.learning.values.learner import value_memory, weigh
from pneumarm.learning.values.loop import train_episodes
from pneumarm.learning.values.settings import Approximator
from pneumarm.learning.values.view import see, view_of
from pneumarm.learning.values.weights import first_weights, learner_of, weight_count
from pneumarm.random import random_state
from pneumarm.simulation.kernel import simulation_state, step
from pneumarm.simulation.layout import layout_of
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates
from pneumarm.task.environment import begin_episode, environment, episode, take
from pneumarm.task.reward import paid

LEARNED = sorted(VALUES.keys() - {"dynamic-programming"})
QUIET = NoiseSettings(kind="none")


def settings_of(name: str, **chosen: object) -> ValueSettings:
    return VALUES[name].settings(**{"agents": 1, "validation_episodes": 500, **chosen})


def an_agent(simulation: Simulation, name: str, seed: int = 0, **chosen: object) -> ValueAgent:
    """Return an agent that knows nothing, but not nothing in the same way everywhere."""
    settings = settings_of(name, noise=QUIET, cutoff=12, **chosen)
    weights = np.random.default_rng(seed).normal(size=weight_count(simulation, settings)).astype(np.float32)
    if settings.step_size == "1/k":
        weights[len(weights) // 2 :] = 0.0
    return ValueAgent(simulation, weights, settings)


@pytest.mark.parametrize("name", LEARNED)
def test_every_rule_learns_to_reach_goals(name: str, simulation: Simulation, begin: BeginStates) -> None:
    settings = settings_of(name, max_episodes=10_000)
    training = train(simulation, begin, settings, 1, method=METHODS[name])
    assert training.agent.settings == settings
    assert training.validation[0].success.mean() > 0.9
    untrained = replace(training.agent, learned=np.zeros_like(training.agent.learned))
    assert test(untrained, simulation, begin, 500).success.mean() < 0.5


@pytest.mark.parametrize("approximator", ["table", "tiles", "kanerva", "network", "networks"])
def test_on_every_approximator(approximator: Approximator, simulation: Simulation, begin: BeginStates) -> None:
    is_network = approximator.startswith("network")
    chosen = {"traces": "accumulating", "learning_rate": 0.05, "trace_decay": 0.3} if is_network else {}
    episodes = 30_000 if is_network else 10_000
    settings = settings_of("sarsa-lambda", approximator=approximator, max_episodes=episodes, **chosen)
    training = train(simulation, begin, settings, 1, method=METHODS["sarsa-lambda"])
    assert training.validation[0].success.mean() > 0.85


def test_dynamic_programming_plans(simulation: Simulation, begin: BeginStates) -> None:
    settings = settings_of("dynamic-programming", states=20_000, rounds=3)
    training = train(simulation, begin, settings, method=METHODS["dynamic-programming"])
    assert training.validation[0].success.mean() > 0.85
    again = train(simulation, begin, settings, method=METHODS["dynamic-programming"])
    np.testing.assert_array_equal(again.agent.learned, training.agent.learned)


@pytest.mark.parametrize("name", ["q-lambda", "td"])
def test_two_joints_each_have_values(name: str) -> None:
    simulation = synthetic_simulation(2)
    settings = settings_of(name, max_episodes=1000)
    training = train(simulation, synthetic_begin_states(simulation), settings, method=METHODS[name])
    assert training.validation[0].switches.shape == (500, 2)
    learned = training.agent.learned.reshape(2, -1)
    assert learned.any(axis=1).all()
    assert (learned[0] != learned[1]).any()


def test_the_same_seed_gives_the_same_bits(simulation: Simulation, begin: BeginStates, tmp_path: Path) -> None:
    settings = settings_of("actor-critic", agents=2, max_episodes=1000, step_size="1/k")
    method, checkpoint = METHODS["actor-critic"], tmp_path / "checkpoint"
    one = train(simulation, begin, settings, 5, method=method, threads=1, checkpoint=checkpoint)
    other = train(simulation, begin, settings, 5, method=method, threads=2)
    np.testing.assert_array_equal(one.agent.learned, other.agent.learned)
    again = train(simulation, begin, settings, 5, method=method, checkpoint=checkpoint)
    np.testing.assert_array_equal(one.agent.learned, again.agent.learned)
    assert one.agent.learned.any()


@pytest.mark.parametrize(
    ("name", "chosen"),
    [
        ("sarsa-lambda", {"approximator": "tiles"}),
        ("q-lambda", {"approximator": "networks", "traces": "accumulating"}),
        ("monte-carlo", {"approximator": "table", "step_size": "1/k"}),
        ("td", {"approximator": "kanerva"}),
        ("actor-critic", {"approximator": "radial"}),
    ],
)
@pytest.mark.parametrize("joints", [1, 2])
def test_learns_what_the_training_loop_learns(name: str, chosen: dict, joints: int) -> None:
    """Episodes once in the compiled loop, once step by step: the same weights bit for bit."""
    simulation = synthetic_simulation(joints)
    agent = an_agent(simulation, name, **chosen)
    env = environment(simulation, synthetic_begin_states(simulation), agent.settings)
    weights, last = agent.weights(), agent.settings.exploration
    learner, one = learner_of(simulation, agent.settings, weights), episode(env, random_state(7))
    memory = value_memory(learner, one.state.x.size, agent.settings.cutoff)
    actor, size = agent.learner(agent.settings.learning_rate), simulation.window.state_size
    other = episode(env, random_state(7))
    for _ in range(15):
        train_episodes(env, learner, Schedule(60.0, last.epsilon, last.temperature, 0.0), one, memory, 1, 0.0)
        actor._random[:] = other.state.random  # the loop draws begin states and actions from one stream
        begin_episode(env, other, 60.0, actor._random)
        actor.begin(other.state.x[:size], other.goal)
        for _ in range(agent.settings.cutoff):
            is_reached = take(env, other, actor.act())
            rewards = [paid(env.task.reward, is_reached, switched) for switched in other.switched]
            actor.observe(rewards, other.state.x[:size], is_reached)
            if is_reached:
                break
        other.state.random[:] = actor._random
    if name == "monte-carlo":
        actor.begin(other.state.x[:size], other.goal)  # so that it learns from the last episode, too
    np.testing.assert_array_equal(actor.agent.learned, weights)
    assert (weights != agent.learned).any()


@pytest.mark.parametrize("name", LEARNED)
def test_is_a_controller_without_a_learning_rate(name: str, simulation: Simulation, begin: BeginStates) -> None:
    agent = an_agent(simulation, name, approximator="table")
    assert isinstance(agent, Learns)
    actor = agent.actor()
    with pytest.raises(PneumarmError, match="begin an episode"):
        actor.act()
    actor.begin(begin.states[0], [500.0])
    before = -1
    for state in begin.states[1:100:7]:
        values = actor.values()[0]
        assert actor.act().tolist() == [values.argmax()]
        before = int(actor.act()[0])
        actor.observe(-1.0, state, False)
    np.testing.assert_array_equal(actor.weights(), agent.learned)
    assert before >= 0


def test_what_a_switch_costs_is_known(simulation: Simulation, begin: BeginStates) -> None:
    agent = an_agent(simulation, "q-lambda", approximator="table")
    actor = agent.actor()
    actor.begin(begin.states[5], [500.0])
    first, taken = actor.values()[0], int(actor.act()[0])
    actor.follow(begin.states[5])
    cost = np.where(np.arange(9) == taken, 0.0, -8.0)
    np.testing.assert_allclose(actor._workspace.values, first + cost, rtol=1e-6)


def test_td_looks_ahead_through_the_simulation(simulation: Simulation, begin: BeginStates) -> None:
    """r + gamma V(s'), each action's state foreseen here step by step."""
    agent = an_agent(simulation, "td", approximator="table")
    learner, layout = learner_of(simulation, agent.settings, agent.weights()), layout_of(simulation.window)
    x = np.zeros(layout.size, np.float32)
    x[: layout.command], x[layout.one] = begin.states[40], 1
    x[layout.goal] = (begin.angle[40, 0] + 120 - 512.0) / 400.0
    memory = value_memory(learner, layout.size, 0)
    values, before = np.zeros(9, np.float32), np.array([2])
    weigh(learner, 0, x, before, memory.z, values)
    env, found = learner.model.environment, []
    for action in range(9):
        state = simulation_state(env.simulation, random_state(0))
        state.x[:] = x
        step(env.simulation, env.noise, state, env.task.commands[0, action])
        see(learner.variables, 0, state.x, memory.z)
        cells = learner.values.coding.cells
        cell = int(np.ravel_multi_index(tuple((memory.z * cells).astype(int)), tuple(cells)))
        found.append(-1 - 8 * (action != 2) + 0.98 * learner.values.weights[0, action + 1, cell])
    np.testing.assert_allclose(values, found, rtol=1e-5)
    x[layout.goal] = x[0]  # with the goal where it is, closed valves reach it
    weigh(learner, 0, x, before, memory.z, values)
    assert values[4] == 50 - 8


def test_what_is_seen_of_the_arm(simulation: Simulation) -> None:
    view = view_of(simulation, settings_of("q-lambda"))
    x, z, layout = np.zeros(layout_of(simulation.window).size, np.float32), np.zeros(5, np.float32), None
    layout = layout_of(simulation.window)
    x[layout.goal] = 100 / 400  # the goal at 612, the arm at 512 and still, 90 counts of 200 in both muscles
    see(view, 0, x, z)
    np.testing.assert_allclose(z, [0.5 + 0.5 * 100 / 200, 0.5, 0.45, 0.45, 512 / 1023], atol=1e-6)
    x[0], x[1] = -600 / 400, 2 / 5  # below the range of angles; 2 counts/ms
    see(view, 0, x, z)
    np.testing.assert_allclose(z[[0, 1, 4]], [0.5 + 0.5 * 700 / 800, 0.75, 0.0], atol=1e-6)


@pytest.mark.parametrize("name", ["q-lambda", "monte-carlo"])
def test_saved_state_goes_on_bit_for_bit(name: str, simulation: Simulation, begin: BeginStates) -> None:
    agent = an_agent(simulation, name)
    one, other = agent.learner(0.1, 1), agent.learner(0.1, 2)
    one.begin(begin.states[0], [450.0])
    for state in begin.states[1:9]:
        one.observe(-1.0, state, False)
    other.begin(begin.states[0], [450.0])
    other.set_state(one.get_state())
    for state in begin.states[10:13]:
        assert one.act().tolist() == other.act().tolist()
        for each in (one, other):
            each.observe(-9.0, state, state is begin.states[12])
    assert one.get_state() == other.get_state()
    for strange in (b"", b"nonsense", an_agent(simulation, name, approximator="table").learner(0.1).get_state()):
        with pytest.raises(UnusableInput, match="state of a learner"):
            one.set_state(strange)


@pytest.mark.parametrize("name", VALUES)
def test_files(name: str, simulation: Simulation, begin: BeginStates, tmp_path: Path) -> None:
    settings = settings_of(name)
    weights = first_weights(simulation, settings, np.random.default_rng(0))
    agent, path = ValueAgent(simulation, weights, settings), tmp_path / "agent"
    agent.save(path)
    loaded = load_agent(path)
    assert isinstance(loaded, ValueAgent)
    assert loaded.settings == settings
    assert type(loaded.settings) is VALUES[name].settings
    np.testing.assert_array_equal(loaded.learned, weights)
    header, arrays = read_arrays(path, KIND)
    for wrong in (
        (header, {**arrays, "learned": weights[:-1].copy()}),
        ({**header, "settings": {"rule": "no such"}}, arrays),
        ({**header, "settings": {**header["settings"], "cells": [3]}}, arrays),
    ):
        write_arrays(path, KIND, *wrong)
        with pytest.raises(UnusableInput, match=r"train it again|expected \d+ weights"):
            load_agent(path)


def test_what_one_muscle_cannot_do_is_not_done(simulation: Simulation) -> None:
    spring = replace(simulation, spec=replace(simulation.spec, muscles=1))
    learner = learner_of(spring, settings_of("sarsa-lambda"), an_agent(simulation, "sarsa-lambda").weights())
    x = np.zeros(layout_of(spring.window).size, np.float32)
    memory = value_memory(learner, x.size, 0)
    weigh(learner, 0, x, np.array([-1]), memory.z, memory.values)
    assert (np.flatnonzero(memory.values > 0.5 * NEVER) % 3 == 1).all()


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"approximator": "network"}, "traces cannot be 'replacing'; expected accumulating"),
        ({"approximator": "networks", "traces": "accumulating", "step_size": "1/k"}, "expected constant"),
        ({"cells": (3, 3)}, "expected 5 numbers"),
        ({"variables": ("error", "error")}, "each of them once"),
        ({"policy": "cautious"}, "greedy, epsilon-greedy, boltzmann, max-boltzmann"),
        ({"approximator": "splines"}, "table, tiles, radial, kanerva, network, networks"),
    ],
)
def test_what_does_not_fit_together_is_said(chosen: dict, words: str) -> None:
    with pytest.raises(UnusableInput, match=words):
        settings_of("q-lambda", **chosen)


def test_options_of_the_command_line() -> None:
    learn = LearnSettings(method="q-lambda", own={"approximator": "kanerva", "centres": "80", "policy": "boltzmann"})
    assert learn.chosen == VALUES["q-lambda"].settings(approximator="kanerva", centres=80, policy="boltzmann")
    parts = LearnSettings(method="td", own={"goal": "[10]", "help": '{"retry": 0.5}', "noise": '{"kind": "uniform"}'})
    assert (parts.chosen.goal, parts.chosen.help.retry, parts.chosen.noise.kind) == ((10.0,), 0.5, "uniform")
    with pytest.raises(UnusableInput, match="JSON"):
        LearnSettings(method="td", own={"help": "{retry"})
    with pytest.raises(UnusableInput, match="no setting approximate"):
        LearnSettings(method="q-lambda", own={"approximate": "radial"})
    with pytest.raises(UnusableInput, match="rule"):
        LearnSettings(method="q-lambda", own={"rule": "td"})
