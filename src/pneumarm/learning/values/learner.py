"""Acting and learning step by step, by any rule, on any approximator.

    begin: choose a in s
    each step, after a led to r and s': choose a' in s'; learn from (s, a, r, s', a'); s, a = s', a'

What differs between the rules is in their own files. What a switch costs is known, so where an approximator does not
see the action before, it learns what an action is worth without it, and what the switch costs is added where values
are looked at (an afterstate: Sutton and Barto, Reinforcement Learning, section 6.8).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import NEVER
from pneumarm.kernels import kernel, part
from pneumarm.learning.online.schedule import Retry, no_retry
from pneumarm.learning.online.values import td_target
from pneumarm.learning.values.actor_critic import move_actor
from pneumarm.learning.values.approximators.function import (
    ValueFunction,
    forget_traces,
    look,
    update,
    value,
)
from pneumarm.learning.values.monte_carlo import Path, learn_path, note_step, path
from pneumarm.learning.values.policies import act_by, boltzmann
from pneumarm.learning.values.q_lambda import look_ahead_q
from pneumarm.learning.values.sarsa import look_ahead_sarsa
from pneumarm.learning.values.td import Foreseen, foresee_values, row_of
from pneumarm.learning.values.view import Seen, see

TD, MONTE_CARLO, SARSA, Q_LEARNING, ACTOR_CRITIC = range(5)


class LearnedValues(NamedTuple):
    """Values, and how they are learned."""

    rule: int
    """:data:`TD` or another of these."""
    policy: int
    """Place in :data:`~.policies.POLICIES`."""
    values: ValueFunction
    """Of actions; for TD and a critic of states."""
    actor: ValueFunction
    """Preferences of an actor."""
    variables: Seen
    """What each agent sees."""
    model: Foreseen
    possible: NDArray[np.bool_]
    """Actions that a joint has, shape (choices,)."""
    rate: float
    """beta; 0 where nothing is learned."""
    actor_rate: float
    discount: float
    """gamma."""
    decay: float
    """lambda."""
    switch: float
    """What a switch is paid, where the approximator does not see the action before; otherwise 0."""


class ValueMemory(NamedTuple):
    """What is remembered from one step to the next. Made by :func:`value_memory`."""

    before: NDArray[np.float32]
    """State vector before the action, shape (inputs,)."""
    z: NDArray[np.float32]
    """What an agent sees, shape (variables,)."""
    values: NDArray[np.float32]
    """What actions are worth to an agent, shape (choices,)."""
    odds: NDArray[np.float32]
    """Workspace for exploring, same shape."""
    last: NDArray[np.int64]
    """The actions that led to the state before, -1 for none, shape (agents,)."""
    chosen: NDArray[np.int64]
    """The actions taken there, same shape."""
    next_actions: NDArray[np.int64]
    """The actions chosen in the state after, same shape."""
    next_values: NDArray[np.float64]
    """What the targets look ahead to, same shape."""
    cut: NDArray[np.bool_]
    """Whether traces are cut, same shape."""
    paid: NDArray[np.float64]
    """What each was paid, same shape."""
    path: Path
    """The episode so far, for Monte Carlo."""
    retry: Retry


def value_memory(learner: LearnedValues, inputs: int, steps: int) -> ValueMemory:
    """Return workspace for states of so many ``inputs`` and episodes of so many ``steps``."""
    agents, choices = len(learner.values.weights), len(learner.possible)
    variables = learner.variables.place.shape[1] or inputs
    return ValueMemory(
        before=np.zeros(inputs, np.float32),
        z=np.zeros(variables, np.float32),
        values=np.zeros(choices, np.float32),
        odds=np.zeros(choices, np.float32),
        last=np.full(agents, -1, np.int64),
        chosen=np.full(agents, -1, np.int64),
        next_actions=np.full(agents, -1, np.int64),
        next_values=np.zeros(agents),
        cut=np.zeros(agents, np.bool_),
        paid=np.zeros(agents),
        path=path(steps if learner.rule == MONTE_CARLO else 0, agents, variables),
        retry=no_retry(agents),
    )


@part
def all_values(learner, function, agent, before, values):  # type: ignore[no-untyped-def]
    """Set ``values`` (choices,) to the outputs of ``function`` in the state looked at, and what switches cost."""
    for action in range(values.shape[0]):
        switch = learner.switch if before >= 0 and action != before else 0.0
        values[action] = value(function, agent, action) + np.float32(switch)
        if not learner.possible[action]:
            values[action] = np.float32(NEVER)


@part(entry=True)
def weigh(learner, agent, x, before, z, values):  # type: ignore[no-untyped-def]
    """Set ``values`` (choices,) to what ``agent`` prefers in the state ``x``, the actions ``before`` led to it."""
    if learner.rule == TD:
        about = learner.model, learner.variables, learner.values, learner.discount
        foresee_values(about, agent, x, before, z, values)
        for action in range(values.shape[0]):
            if not learner.possible[action]:
                values[action] = np.float32(NEVER)
    else:
        see(learner.variables, agent, x, z)
        function = learner.actor if learner.rule == ACTOR_CRITIC else learner.values
        look(function, agent, z)
        all_values(learner, function, agent, before[agent], values)


@part
def decide(learner, schedule, x, memory, random):  # type: ignore[no-untyped-def]
    """Choose the next actions in ``x`` and find what the targets look ahead to."""
    values, z = memory.values, memory.z
    for agent in range(memory.chosen.shape[0]):
        weigh(learner, agent, x, memory.chosen, z, values)
        chosen = act_by(learner.policy, values, schedule.epsilon, schedule.temperature, memory.odds, random)
        memory.next_actions[agent], memory.cut[agent] = chosen, False
        if learner.rule == TD or learner.rule == ACTOR_CRITIC:
            see(learner.variables, agent, x, z)
            look(learner.values, agent, z)
            memory.next_values[agent] = value(learner.values, agent, row_of(learner.values, memory.chosen[agent]))
        elif learner.rule == Q_LEARNING:
            memory.next_values[agent], memory.cut[agent] = look_ahead_q(values, chosen)
        else:
            memory.next_values[agent], memory.cut[agent] = look_ahead_sarsa(values, chosen)


@part
def begin_learning(learner, memory):  # type: ignore[no-untyped-def]
    """Begin an episode after ``memory.next_actions``, -1 for an arm at rest; learn from one that was cut off."""
    end_episode(learner, memory)
    for agent in range(memory.chosen.shape[0]):
        memory.chosen[agent] = memory.next_actions[agent]
        if learner.rate > 0.0:
            forget_traces(learner.values, agent)
            forget_traces(learner.actor, agent)


@kernel
def begin_acting(learner, schedule, x, memory, random):  # type: ignore[no-untyped-def]
    """Begin an episode in the state and goal ``x``, see :func:`begin_learning`: choose its first actions."""
    begin_learning(learner, memory)
    decide(learner, schedule, x, memory, random)


@part
def end_episode(learner, memory):  # type: ignore[no-untyped-def]
    """Learn from the whole episode, as Monte Carlo does, if there is one."""
    if memory.path.length[0] > 0:
        learn_path(learner.values, memory.path, learner.rate, learner.discount, memory.next_values)


@part
def remember(memory, x):  # type: ignore[no-untyped-def]
    """Remember the state ``x`` (inputs,) and what was chosen there."""
    for i in range(x.shape[0]):
        memory.before[i] = x[i]
    for agent in range(memory.chosen.shape[0]):
        memory.last[agent] = memory.chosen[agent]
        memory.chosen[agent] = memory.next_actions[agent]


@part
def learn(learner, schedule, memory, is_over):  # type: ignore[no-untyped-def]
    """Learn from the last step; what follows it is worth nothing if the episode ``is_over``."""
    function, z, decay = learner.values, memory.z, learner.discount * learner.decay
    for agent in range(memory.chosen.shape[0]):
        last, chosen, reward = memory.last[agent], memory.chosen[agent], memory.paid[agent]
        see(learner.variables, agent, memory.before, z)
        if learner.rule == TD or learner.rule == ACTOR_CRITIC:
            target = td_target(reward, learner.discount, memory.next_values[agent], is_over)
            delta = update(function, agent, z, row_of(function, last), target, learner.rate, decay)
            if learner.rule == ACTOR_CRITIC:
                look(learner.actor, agent, z)
                all_values(learner, learner.actor, agent, last, memory.values)
                boltzmann(memory.values, schedule.temperature, memory.odds)
                move_actor(learner.actor, agent, z, chosen, memory.odds, delta, learner.actor_rate, decay)
            continue
        if last >= 0 and chosen != last:
            reward -= learner.switch
        if learner.rule == MONTE_CARLO:
            note_step(memory.path, agent, z, chosen, reward)
            continue
        target = td_target(reward, learner.discount, memory.next_values[agent], is_over)
        update(function, agent, z, chosen, target, learner.rate, decay)
        if memory.cut[agent]:
            forget_traces(function, agent)
    if learner.rule == MONTE_CARLO:
        memory.path.length[0] += 1
        if is_over:
            for agent in range(memory.chosen.shape[0]):
                memory.next_values[agent] = 0.0
            end_episode(learner, memory)


@kernel
def learn_and_act(learner, schedule, x, memory, random, seen, is_over):  # type: ignore[no-untyped-def]
    """Go on in the state that ``seen`` ends in, having been paid what it begins with (agents,)."""
    paid, next_state = seen
    remember(memory, x)
    for i in range(next_state.shape[0]):
        x[i] = next_state[i]
    if not is_over:
        decide(learner, schedule, x, memory, random)
    if learner.rate > 0.0:
        for agent in range(memory.chosen.shape[0]):
            memory.paid[agent] = paid[agent]
        learn(learner, schedule, memory, is_over)
