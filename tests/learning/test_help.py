"""What helps learning besides shaping (sections 4.2.2, 4.2.3, 4.3.3): each help does what it says, and no more."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.learning import METHODS, LearnSettings, Shaping, TrainSettings, test, train
from pneumarm.learning.online.loop import loop_workspace, train_episode, train_episodes
from pneumarm.learning.online.schedule import Schedule, schedule_here
from pneumarm.learning.online.settings import Help
from pneumarm.learning.online.shaping import stage
from pneumarm.learning.online.training import OnlineTrainee
from pneumarm.learning.online.values import draw_networks, learner, network_shapes, pack, unpack
from pneumarm.random import random_state
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates
from pneumarm.task.begin import begin_parameters, draw_begin
from pneumarm.task.environment import angle, environment, episode

QUIET = NoiseSettings(kind="none")
SCHEDULE = Schedule(np.inf, 0.0, 1.0, 0.002)
OPENS = 2
"""An action that moves the arm."""


def one_episode(
    simulation: Simulation, begin: BeginStates, settings: TrainSettings, schedule: Schedule
) -> tuple[tuple[int, float, bool], np.ndarray, float]:
    """Run an episode from 500 counts towards 900 of an agent that keeps to one action.

    Returns what it came to, the values afterwards, and how far the arm has moved [counts].
    """
    nearest = np.abs(begin.angle[:, 0] - 500).argmin()
    begin = BeginStates(begin.window, begin.states[[nearest]], begin.angle[[nearest]])
    simulation = replace(simulation, goal_range=np.array([[900.0, 900.0]]))
    networks = network_shapes(simulation.window, settings.hidden)
    networks.output_bias[0, OPENS] = 0.2
    weights = pack(networks, simulation.window)
    env = environment(simulation, begin, settings)
    one = episode(env, random_state(0))
    work = learner(weights, settings)
    outcome = train_episode(env, work, schedule, one, loop_workspace(work, one.goal.size))
    moved = angle(env.task, one, 0) - float(begin.angle[0, 0])
    return outcome, 50 * unpack(weights, simulation.window, settings.hidden).output_bias[0], moved


def test_coming_nearer_is_paid_for_in_training_and_not_counted(simulation: Simulation, begin: BeginStates) -> None:
    settings = TrainSettings(noise=QUIET, cutoff=1, learning_rate=1.0, discount=0.0)
    outcome, values, moved = one_episode(simulation, begin, settings, SCHEDULE._replace(local=50.0))
    assert outcome == (1, -1.0, False)
    assert abs(50 * moved) > 1
    assert values[OPENS] == pytest.approx(-1 + 50 * moved, abs=1e-2)


def test_who_strays_is_cut_off_which_is_not_terminal(simulation: Simulation, begin: BeginStates) -> None:
    settings = TrainSettings(noise=QUIET, cutoff=50)
    outcome, values, _ = one_episode(simulation, begin, settings, SCHEDULE._replace(stray=100.0))
    assert outcome == (1, -1.0, False)
    assert values[OPENS] == pytest.approx(10 + 0.05 * (-1 + 0.98 * 10 - 10), abs=1e-4)
    outcome, _, _ = one_episode(simulation, begin, settings, SCHEDULE._replace(stray=1000.0))
    assert outcome[0] == 50


@pytest.mark.parametrize(("retry", "share"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_what_failed_is_begun_again(retry: float, share: float, simulation: Simulation, begin: BeginStates) -> None:
    settings = TrainSettings(noise=QUIET, cutoff=1, method="q-learning")
    env = environment(simulation, begin, settings)
    weights = pack(draw_networks(simulation.window, settings, np.random.default_rng(0)), simulation.window)
    work, one = learner(weights, settings, 0.0), episode(env, random_state(3))
    workspace, goals, begins, failed = loop_workspace(work, 1), [], [], []
    schedule = SCHEDULE._replace(deviation=300.0, performance_rate=1.0, retry=retry)
    for _ in range(400):
        success, _, _ = train_episodes(env, work, schedule, one, workspace, 1, 0.0)
        goals.append(one.goal[0])
        begins.append(workspace.before[0])
        failed.append(success == 0)
    again = np.diff(goals) == 0
    assert np.array_equal(again, np.diff(begins) == 0)
    assert not again[~np.array(failed[:-1])].any()
    assert again[np.array(failed[:-1])].mean() == pytest.approx(share, abs=0.08)


def test_it_explores_by_where_it_is(simulation: Simulation, begin: BeginStates) -> None:
    env = environment(simulation, begin, TrainSettings())
    one = episode(env, random_state(0))
    schedule = Schedule(100.0, 0.5, 20.0, 0.002)
    here = angle(env.task, one, 0)
    for away, expected in ((0.0, 0.1), (-99.0, 0.1), (150.0, 0.3), (-200.0, 0.5), (500.0, 0.5)):
        one.goal[0] = here + away
        assert schedule_here(schedule, env.task, one).epsilon == 0.5
        found = schedule_here(schedule._replace(near_epsilon=0.1), env.task, one)
        assert found.epsilon == pytest.approx(expected)
        assert found._replace(epsilon=0.5) == schedule._replace(near_epsilon=0.1)


def test_help_is_part_of_a_stage_of_shaping() -> None:
    spec = ArmSpec()
    settings = TrainSettings(help=Help(stray=2.0, local=3.0, retry=0.25, by_position=True))
    now = stage(200.0, settings, spec).schedule
    assert (now.stray, now.retry, now.near_epsilon) == (400.0, 0.25, 0.05)
    assert now.local * spec.counts_per_degree == pytest.approx(3.0)
    assert stage(200.0, TrainSettings(), spec).schedule[5:] == (-1.0, np.inf, 0.0, 0.0)
    alone = stage(1023.0, replace(settings, shaping=None), spec).schedule
    assert (alone.stray, alone.near_epsilon) == (np.inf, -1.0)  # there is no deviation to go by
    with pytest.raises(UnusableInput, match="stray"):
        Help(stray=0.5)


def test_the_learning_rate_falls_as_1_over_k(simulation: Simulation, begin: BeginStates) -> None:
    def changed(halving: int) -> tuple[float, float]:
        settings = TrainSettings(agents=1, help=Help(halving=halving))
        trainee = OnlineTrainee(environment(simulation, begin, settings), simulation, settings, 0, 0)
        before = trainee.arrays()["weights"].copy()
        for _ in range(2):
            trainee.learn_on()
        assert trainee.episodes == 1000
        return trainee.rate_share, float(np.abs(trainee.arrays()["weights"] - before).mean())

    (constant, far), (falling, near) = changed(0), changed(10)
    assert (constant, falling) == (1.0, 10 / 1010)
    assert near < 0.9 * far


@pytest.mark.parametrize("name", ["sarsa", "sarsa-lambda"])
def test_a_single_goal(name: str, simulation: Simulation, begin: BeginStates) -> None:
    method = METHODS[name]
    settings = method.settings(agents=1, max_episodes=500, validation_episodes=20, goal=(5.0,), **method.fixed)
    training = train(simulation, begin, settings, 0, method=method)
    counts = simulation.spec.degrees(training.agent.goal_range)
    np.testing.assert_allclose(counts, [[5.0, 5.0]])
    for made in (training.validation[0], test(training.agent, simulation, begin, 20)):
        np.testing.assert_allclose(simulation.spec.degrees(made.goal), 5.0)


def test_a_goal_that_the_arm_has_not_is_refused(simulation: Simulation, begin: BeginStates) -> None:
    with pytest.raises(UnusableInput, match="goal: expected angles within"):
        train(simulation, begin, TrainSettings(goal=(1000.0,)))
    with pytest.raises(UnusableInput, match=r"goal: expected 1 angle\(s\)"):
        train(simulation, begin, TrainSettings(goal=(5.0, 5.0)))


@pytest.mark.parametrize(("by_length", "share"), [(False, 200 / 1023), (True, 0.4)])
def test_sides_are_drawn_by_the_place_of_the_goal_or_by_their_length(by_length: bool, share: float) -> None:
    """The example of table 4.1: a goal at 200, a deviation of 300, so 200 counts below and 300 above."""
    states = synthetic_begin_states(synthetic_simulation())
    line = replace(states, states=np.zeros((1000, 16), np.float32), angle=np.arange(1000.0)[:, None])
    begin, random = begin_parameters(line, (0.0, 1023.0), Shaping().weights, by_length), random_state(0)
    drawn = np.array([draw_begin(begin, np.array([200.0]), 300.0, random) for _ in range(20_000)])
    assert (drawn < 200).mean() == pytest.approx(share, abs=0.012)
    assert TrainSettings(shaping=Shaping(sides="length" if by_length else "place")).by_length == by_length


@pytest.mark.parametrize("name", ["q-learning", "q-lambda", "td"])
def test_agents_learn_with_it(name: str, simulation: Simulation, begin: BeginStates) -> None:
    method, help_ = METHODS[name], Help(stray=1.5, local=0.05, retry=0.3, by_position=True, halving=20_000)
    settings = method.settings(agents=1, max_episodes=20_000, validation_episodes=300, help=help_, **method.fixed)
    training = train(simulation, begin, settings, 1, method=method)
    assert training.validation[0].success.mean() > 0.85


def test_each_joint_has_its_own_deviation() -> None:
    """A joint that is always at its goal gets more room, one that never is gets less; the widest counts for all."""
    arm = synthetic_simulation(2)
    shaping = Shaping(each=True, performance_rate=1e-6)  # what the joints did so far hardly changes
    settings = TrainSettings(agents=1, shaping=shaping)
    env = environment(arm, synthetic_begin_states(arm), settings)
    trainee = OnlineTrainee(env, arm, settings, 0, 0)
    trainee.arrays()["joints"][:] = (100.0, 200.0), (1.0, 0.0)
    trainee.learn_on()
    np.testing.assert_allclose(trainee.arrays()["joints"], [(110.0, 194.0), (1.0, 0.0)], atol=1e-3)
    assert trainee.arrays()["shaping"][0] == pytest.approx(194.0)
    assert env.begin.shares.tolist() == [1.0, 1.0]  # other agents in the same environment have their own


@pytest.mark.parametrize("shares", [(1.0, 0.25), (0.1, 1.0)])
def test_begin_states_keep_to_the_deviation_of_each_joint(shares: tuple[float, float]) -> None:
    states = synthetic_begin_states(synthetic_simulation(2))
    begin = begin_parameters(states, (0.0, 1023.0), Shaping().weights)._replace(shares=np.array(shares))
    random, goal = random_state(0), np.array([500.0, 500.0])
    away = np.array([np.abs(states.angle[draw_begin(begin, goal, 300.0, random)] - goal) for _ in range(2000)])
    assert (away <= 300.0 * np.array(shares)).all()
    assert (away.max(axis=0) > 0.6 * 300.0 * np.array(shares)).all()


def test_a_hierarchy_refuses_it() -> None:
    with pytest.raises(UnusableInput, match="help"):
        _ = LearnSettings(method="hierarchy", own={"help": {"retry": 0.5}}).chosen
