"""Each rule on problems of textbooks with known answers, and against updates worked by hand."""

import numpy as np
import pytest
from textbook import CLIFF, WINDY, Student, function, mountain_car, random_walk

from pneumarm.learning.values.approximators.function import update
from pneumarm.learning.values.approximators.table import table
from pneumarm.learning.values.approximators.tiles import tiles
from pneumarm.learning.values.learner import ACTOR_CRITIC, MONTE_CARLO, Q_LEARNING, SARSA
from pneumarm.learning.values.monte_carlo import learn_path, path

WALK = np.arange(1, 6) / 6
"""Values of the five states of the random walk (Sutton and Barto, example 6.2)."""


def walked(episodes: int, rate: float, decay: float, seed: int = 0, **options: bool) -> np.ndarray:
    """Return the values (5,) that TD learns on the random walk."""
    problem = random_walk(5, seed)
    values = function(problem.coding, **options)
    values.weights[:] = 0.5
    for _ in range(episodes):
        state, is_over = problem.begin, False
        while not is_over:
            after, reward, is_over = problem.step(state, 0)
            z = np.array(problem.seen(state), np.float32)
            target = reward if is_over else reward + values.weights[0, 0, after]
            update(values, 0, z, 0, float(target), rate, decay)
            state = after
        update(values, 0, z, 0, float(values.weights[0, 0, state if not is_over else 0]), 0.0, 0.0)
    return values.weights[0, 0]


@pytest.mark.parametrize("decay", [0.0, 0.8])
def test_td_knows_the_random_walk(decay: float) -> None:
    means = np.mean([walked(400, 0.02, decay, seed) for seed in range(5)], axis=0)
    np.testing.assert_allclose(means, WALK, atol=0.03)


@pytest.mark.parametrize("rule", [SARSA, Q_LEARNING, ACTOR_CRITIC])
@pytest.mark.parametrize("decay", [0.0, 0.7])
def test_rules_know_the_random_walk(rule: int, decay: float) -> None:
    """With one action all of them estimate what states are worth; the critic is TD(lambda)."""
    found = []
    for seed in range(4):
        student = Student(random_walk(5, seed), rule, 0.03, decay=decay, first=0.5)
        for _ in range(400):
            student.episode()
        found.append(student.values.weights[0, 0].copy())
    np.testing.assert_allclose(np.mean(found, axis=0), WALK, atol=0.04)


def test_monte_carlo_is_the_mean_of_returns() -> None:
    """Step sizes 1/k: a value is the mean of what followed each visit, to the last bit but rounding."""
    problem, visits, wins = random_walk(5, 3), np.zeros(5), np.zeros(5)
    steps = problem.step
    seen: list[int] = []

    def noted(state: int, action: int) -> tuple[int, float, bool]:
        seen.append(state)
        return steps(state, action)

    problem.step = noted
    student = Student(problem, MONTE_CARLO, 0.1, is_averaging=True)
    for _ in range(300):
        seen.clear()
        _, total = student.episode()
        np.add.at(visits, seen, 1)
        np.add.at(wins, seen, total)
    np.testing.assert_allclose(student.values.weights[0, 0], wins / visits, atol=1e-5)
    np.testing.assert_allclose(wins / visits, WALK, atol=0.1)
    np.testing.assert_array_equal(student.values.visits[0, 0], visits)


def learned(student: Student, episodes: int) -> Student:
    for _ in range(episodes):
        student.episode()
    return student


@pytest.mark.parametrize("seed", range(2))
def test_sarsa_walks_safely_and_q_learning_on_the_edge(seed: int) -> None:
    """Sutton and Barto, example 6.6: what exploring costs on the edge is part of SARSA's values alone."""
    sarsa, q = (learned(Student(CLIFF, rule, 0.2, seed=seed), 2000) for rule in (SARSA, Q_LEARNING))
    edge = q.greedy_path()
    assert len(edge) - 1 == 13  # the shortest path
    assert sum(row == 2 for row, _ in edge) == 12
    safe = sarsa.greedy_path()
    assert safe[-1] == (3, 11)
    assert len(safe) - 1 > 13
    assert sum(row < 2 for row, _ in safe) >= 10
    earned = [np.mean([one.episode()[1] for _ in range(300)]) for one in (sarsa, q)]
    assert earned[0] > earned[1] + 5  # while it explores


@pytest.mark.parametrize(
    ("rule", "decay", "is_replacing"),
    [
        (SARSA, 0.0, False),
        (SARSA, 0.5, True),
        (SARSA, 0.3, False),
        (Q_LEARNING, 0.0, False),
        (Q_LEARNING, 0.5, True),
        (Q_LEARNING, 0.5, False),
    ],
)
def test_the_windy_grid_takes_fifteen_steps(rule: int, decay: float, is_replacing: bool) -> None:
    """Sutton and Barto, example 6.5."""
    student = Student(WINDY, rule, 0.3, decay=decay, is_replacing=is_replacing, seed=1)
    learned(student, 800)
    student.schedule = student.schedule._replace(epsilon=0.02)  # SARSA values what it does
    student.learner = student.learner._replace(rate=0.1)
    learned(student, 1500)
    assert len(student.greedy_path()) - 1 == 15


def test_the_actor_finds_the_way_too() -> None:
    student = Student(CLIFF, ACTOR_CRITIC, 0.1, policy="boltzmann", seed=2, first=-5.0)
    learned(student, 3000)
    assert 13 <= len(student.greedy_path()) - 1 <= 17
    assert np.mean([student.episode()[1] for _ in range(100)]) > -25


def test_traces_and_tiles_drive_the_mountain_car() -> None:
    """Sutton and Barto, example 12.2: replacing traces on tiles; no car is up in less than about 100 steps."""
    student = Student(
        mountain_car(tiles((8, 8), 8, 4096)), SARSA, 0.5, decay=0.9, epsilon=0.0, is_replacing=True, longest=5000
    )
    steps = [student.episode()[0] for _ in range(150)]
    assert np.mean(steps[:5]) > 300
    assert 100 <= np.mean(steps[-30:]) < 150


def test_an_update_worked_by_hand() -> None:
    """Two steps of SARSA(0.5) with gamma 0.8 through a table of three states."""
    values = function(table((3,)), 2)
    z = [np.array([(state + 0.5) / 3], np.float32) for state in range(3)]
    assert update(values, 0, z[0], 1, 2.0, 0.5, 0.4) == 2.0
    assert update(values, 0, z[1], 0, 1.0, 0.5, 0.4) == 1.0
    np.testing.assert_allclose(values.weights[0], [[0, 0.5, 0], [1.2, 0, 0]])
    np.testing.assert_allclose(values.traces[0], [[0, 0.4, 0], [0.16, 0, 0]], rtol=1e-6)


@pytest.mark.parametrize(("is_replacing", "trace"), [(False, 1.5), (True, 1.0)])
def test_a_second_visit(is_replacing: bool, trace: float) -> None:
    values = function(table((2,)), 1, is_replacing=is_replacing)
    here = np.array([0.25], np.float32)
    update(values, 0, here, 0, 0.0, 0.1, 0.5)
    update(values, 0, here, 0, 1.0, 0.1, 1.0)
    assert values.weights[0, 0, 0] == pytest.approx(0.1 * trace)
    assert values.traces[0, 0, 0] == pytest.approx(trace)


def test_a_path_is_learned_from_its_end() -> None:
    """Rewards 1, 2 and an end worth 10, discounted by a half: returns 4.5 and 7; the state is met twice."""
    values = function(table((2,)), 1)
    steps = path(4, 1, 1)
    steps.seen[:2, 0, 0] = 0.25
    steps.reward[:2, 0] = 1.0, 2.0
    steps.length[0] = 2
    learn_path(values, steps, 0.5, 0.5, np.array([10.0]))
    assert values.weights[0, 0].tolist() == [0.5 * 7 + 0.5 * (4.5 - 0.5 * 7), 0.0]
    assert steps.length[0] == 0


def test_watkins_cuts_traces_where_it_explores() -> None:
    student = Student(CLIFF, Q_LEARNING, 0.5, decay=1.0, epsilon=1.0, seed=5, longest=30)
    student.values.weights[:] = np.random.default_rng(0).normal(size=student.values.weights.shape)
    student.episode()
    greedy = Student(CLIFF, Q_LEARNING, 0.5, decay=1.0, epsilon=0.0, seed=5, longest=30)
    greedy.values.weights[:] = np.random.default_rng(0).normal(size=greedy.values.weights.shape)
    greedy.episode()
    assert student.values.traced[0] <= 2 < greedy.values.traced[0] + 1
