"""Problems of textbooks with known answers, and a rule that learns them step by step, as it does on an arm."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from synthetic_arm import synthetic_simulation

from pneumarm.kernels import direct
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.values.approximators.coding import Coding
from pneumarm.learning.values.approximators.function import ValueFunction, value_function
from pneumarm.learning.values.approximators.table import table
from pneumarm.learning.values.learner import (
    ACTOR_CRITIC,
    TD,
    LearnedValues,
    begin_acting,
    learn_and_act,
    value_memory,
)
from pneumarm.learning.values.policies import POLICIES, PolicyName
from pneumarm.learning.values.td import model_of
from pneumarm.learning.values.view import whole_view
from pneumarm.random import random_state
from pneumarm.task import TaskSettings

_MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1))
_begin, _learn = direct(begin_acting), direct(learn_and_act)
Step = tuple[Any, float, bool]
"""The next state, the reward, and whether the episode is over."""


@dataclass
class Problem:
    """A Markov decision process: where episodes begin, what an action does, and how a state is seen."""

    actions: int
    begin: Any
    step: Callable[[Any, int], Step]
    seen: Callable[[Any], list[float]]
    coding: Coding = field(default_factory=lambda: table((1,)))


def random_walk(length: int, seed: int) -> Problem:
    """Return a walk that ends on the left for nothing or on the right for 1; the one action goes either way."""
    random = np.random.default_rng(seed)

    def step(state: int, _: int) -> Step:
        after = state + (1 if random.random() < 0.5 else -1)
        return after, float(after == length), after in (-1, length)

    return Problem(1, length // 2, step, lambda state: [(state + 0.5) / length], table((length,)))


def grid(rows: int, columns: int, start: tuple[int, int], goal: tuple[int, int], **what: Any) -> Problem:
    """Return a grid in which each step costs 1, with a ``wind`` upwards by column or a ``cliff`` between the ends."""
    wind, cliff = what.get("wind", [0] * columns), what.get("cliff", False)

    def step(state: tuple[int, int], action: int) -> Step:
        row = min(max(state[0] + _MOVES[action][0] - wind[state[1]], 0), rows - 1)
        column = min(max(state[1] + _MOVES[action][1], 0), columns - 1)
        if cliff and row == rows - 1 and 0 < column < columns - 1:
            return start, -100.0, False
        return (row, column), -1.0, (row, column) == goal

    def seen(state: tuple[int, int]) -> list[float]:
        return [(state[0] + 0.5) / rows, (state[1] + 0.5) / columns]

    return Problem(4, start, step, seen, table((rows, columns)))


CLIFF = grid(4, 12, (3, 0), (3, 11), cliff=True)
WINDY = grid(7, 10, (3, 0), (3, 7), wind=[0, 0, 0, 1, 1, 1, 2, 2, 1, 0])


def mountain_car(coding: Coding) -> Problem:
    """Return the car that has to swing before it gets up the hill (Sutton and Barto, example 10.1)."""

    def step(state: tuple[float, float], action: int) -> Step:
        position, velocity = state
        velocity = min(max(velocity + 0.001 * (action - 1) - 0.0025 * np.cos(3 * position), -0.07), 0.07)
        position += velocity
        if position < -1.2:
            position, velocity = -1.2, 0.0
        return (position, velocity), -1.0, position >= 0.5

    def seen(state: tuple[float, float]) -> list[float]:
        return [(state[0] + 1.2) / 1.7, (state[1] + 0.07) / 0.14]

    return Problem(3, (-0.5, 0.0), step, seen, coding)


class Student:
    """A rule learning a problem."""

    def __init__(
        self,
        problem: Problem,
        rule: int,
        rate: float,
        *,
        policy: PolicyName = "epsilon-greedy",
        epsilon: float = 0.1,
        decay: float = 0.0,
        discount: float = 1.0,
        first: float = 0.0,
        seed: int = 0,
        longest: int = 2000,
        is_replacing: bool = False,
        is_averaging: bool = False,
        weights: np.ndarray | None = None,
        **network: Any,
    ) -> None:
        self.problem, self.longest = problem, longest
        simulation = synthetic_simulation()
        outputs = 1 if rule in {TD, ACTOR_CRITIC} else problem.actions
        coding = problem.coding
        if weights is None:
            weights = np.full((1, outputs, coding.size), first, np.float32)
        visits = np.zeros_like(weights) if is_averaging else None
        actor = table((1,)), np.zeros((1, problem.actions, 1), np.float32)
        if rule == ACTOR_CRITIC:
            actor = coding, np.zeros((1, problem.actions, coding.size), np.float32)
        self.inputs = len(problem.seen(problem.begin))
        self.values = value_function(coding, weights, visits, is_replacing=is_replacing, **network)
        self.learner = LearnedValues(
            rule=rule,
            policy=POLICIES.index(policy),
            values=self.values,
            actor=value_function(*actor),
            variables=whole_view(1),
            model=model_of(simulation, TaskSettings()),
            possible=np.ones(problem.actions, bool),
            rate=rate,
            actor_rate=rate,
            discount=discount,
            decay=decay,
            switch=0.0,
        )
        self.schedule = Schedule(np.inf, epsilon, 1.0, 0.0)
        self.memory = value_memory(self.learner, self.inputs, longest)
        self.random, self.x = random_state(seed), np.zeros(self.inputs, np.float32)

    def episode(self) -> tuple[int, float]:
        """Learn from an episode; return its steps and the sum of its rewards."""
        state, total = self.problem.begin, 0.0
        self.x[:] = self.problem.seen(state)
        self.memory.next_actions[:] = -1
        _begin(self.learner, self.schedule, self.x, self.memory, self.random)
        for k in range(self.longest):
            state, reward, is_over = self.problem.step(state, int(self.memory.next_actions[0]))
            total += reward
            seen = np.array([reward]), np.array(self.problem.seen(state), np.float32)
            _learn(self.learner, self.schedule, self.x, self.memory, self.random, seen, is_over)
            if is_over:
                return k + 1, total
        return self.longest, total

    def greedy_path(self) -> list[Any]:
        """Return the states that the best actions lead through, as it believes."""
        state, states = self.problem.begin, [self.problem.begin]
        greedy = self.learner._replace(policy=POLICIES.index("greedy"), rate=0.0)
        while len(states) <= self.longest:
            self.x[:] = self.problem.seen(state)
            self.memory.next_actions[:] = -1
            _begin(greedy, self.schedule, self.x, self.memory, self.random)
            state, _, is_over = self.problem.step(state, int(self.memory.next_actions[0]))
            states.append(state)
            if is_over:
                break
        return states


def function(coding: Coding, outputs: int = 1, **options: Any) -> ValueFunction:
    """Return a function of zeros."""
    return value_function(coding, np.zeros((1, outputs, coding.size), np.float32), **options)
