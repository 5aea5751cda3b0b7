"""Full updates against closed forms and the answers of textbooks (section 4.2.3)."""

import numpy as np
import pytest
from textbook import CLIFF, WINDY, Problem

from pneumarm.learning.values.dynamic_programming import NotedSteps, sweep


def solved(noted: NotedSteps, cells: int, discount: float = 1.0, switch: float = 0.0) -> np.ndarray:
    """Return the values (choices, cells) that sweeps end at."""
    values = np.zeros((noted.reward.shape[1], cells), np.float32)
    workspace = np.zeros((3, *values.shape))
    for _ in range(2000):
        if sweep(noted, discount, switch, values, workspace) < 1e-7:
            break
    return values


def test_the_random_walk() -> None:
    """Each state is noted twice, once for either way."""
    after = np.array([(s - 1, s + 1) for s in range(5)]).ravel()
    reward = (after == 5).astype(float)
    after[(after < 0) | (after > 4)] = -1
    noted = NotedSteps(np.repeat(np.arange(5), 2), after[:, None], reward[:, None])
    np.testing.assert_allclose(solved(noted, 5)[0], np.arange(1, 6) / 6, atol=1e-4)


def test_the_return_of_equation_4_3() -> None:
    """A chain of 30 states to a goal: R(d) = 50 gamma^(d-1) - sum_{k<d-1} gamma^k for the d-th action before it.

    The thesis counts d from the action that reaches the goal, which is paid 50: eq. 4.3 has its exponents.
    """
    n, discount = 30, 0.98
    ahead, back = np.arange(1, n + 1), np.maximum(np.arange(n) - 1, 0)
    ahead[-1] = -1
    reward = np.full((n, 2), -1.0)
    reward[-1, 0] = 50.0
    values = solved(NotedSteps(np.arange(n), np.stack([ahead, back], axis=1), reward), n, discount)
    d = np.arange(n)[::-1]
    expected = 50 * discount**d - (1 - discount**d) / (1 - discount)
    np.testing.assert_allclose(values[0], expected, atol=1e-3)
    np.testing.assert_allclose(values[1], -1 + discount * expected[back], atol=1e-3)


def test_a_switch_is_paid_once() -> None:
    """Two actions, two states, no end: staying with an action costs 1 a step, the first step of a change 8 more."""
    cell, discount = np.arange(2), 0.5
    noted = NotedSteps(cell, np.array([[0, 1], [1, 1]]), np.array([[-1.0, -1.0], [-3.0, 0.0]]))
    values = solved(noted, 2, discount, -8.0)
    stay = 0.0  # in state 1 by action 1 for ever
    expected_10 = -3 / (1 - discount)  # action 0 in state 1: it is not worth 8 to leave it
    np.testing.assert_allclose(values[1], [-1 + discount * stay, stay], atol=1e-5)
    np.testing.assert_allclose(values[0], [-1 / (1 - discount), expected_10], atol=1e-5)


def noted_in(problem: Problem, rows: int, columns: int) -> NotedSteps:
    cells = [(row, column) for row in range(rows) for column in range(columns)]
    next_cell, reward = np.zeros((len(cells), 4), np.int64), np.zeros((len(cells), 4))
    for s, cell in enumerate(cells):
        for action in range(4):
            after, reward[s, action], is_over = problem.step(cell, action)
            next_cell[s, action] = -1 if is_over else cells.index(after)
    return NotedSteps(np.arange(len(cells)), next_cell, reward)


@pytest.mark.parametrize(("problem", "rows", "columns", "steps"), [(CLIFF, 4, 12, 13), (WINDY, 7, 10, 15)])
def test_the_shortest_way_through_a_grid(problem: Problem, rows: int, columns: int, steps: int) -> None:
    values = solved(noted_in(problem, rows, columns), rows * columns)
    assert values[:, problem.begin[0] * columns + problem.begin[1]].max() == pytest.approx(-steps, abs=1e-4)


def test_a_cell_that_was_never_seen_keeps_its_value() -> None:
    noted = NotedSteps(np.zeros(1, np.int64), np.full((1, 1), -1), np.array([[7.0]]))
    values = np.array([[0.0, 3.0]], np.float32)
    assert sweep(noted, 0.9, 0.0, values, np.zeros((3, 1, 2))) == 7.0
    assert values.tolist() == [[7.0, 3.0]]
