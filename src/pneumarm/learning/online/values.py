"""Action values in networks, one for each action of each joint, and their update (section 4.2.6, Algorithm 2).

    target  = r_{k+1} + gamma Q(s_{k+1}, a_{k+1})        SARSA (eq. 4.9); Q-learning: max_b Q(s_{k+1}, b) (eq. 4.10)
    delta   = target - Q(s_k, a_k)
    e       = e + grad Q(s_k, a_k)
    w       = w + beta delta e
    e       = gamma lambda e

A goal is terminal: its value is 0. A cut-off episode is not: its last update looks ahead as every other does,
because the number of actions is not part of the state and cannot be blamed (section 4.2.2).

With Q-learning the traces are Watkins': they are cut where an exploring action is taken, because what follows is not
what the target assumes (Sutton and Barto, Reinforcement Learning, section 7.6; the thesis does not say which).

With several joints each has an agent with networks of its own that see the whole state and all goals. They share
the reward of the goal (section 6.1.2); each pays for its own switches. With own goals an agent is paid as soon as its
joint is at its goal, and what follows is worth nothing to it. One agent for all joints has a network for each
combination of their actions: what it chooses, ``c``, has the action ``c // 9^j mod 9`` of joint ``j``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS, NEVER, possible_actions
from pneumarm.kernels import part
from pneumarm.learning.online.settings import Team, TrainSettings
from pneumarm.networks.tansig import tansig
from pneumarm.simulation.kernel import UNIT_BLOCK
from pneumarm.simulation.layout import layout_of, padded
from pneumarm.task.reward import RewardParameters
from pneumarm.transitions.window import Window
from pneumarm.vectors import LANES, add_products, follow, weighted_sums

_IN_ORDER = {"contract"}
"""A product and a sum may become one instruction, but sums keep their order."""


class ActionValues(NamedTuple):
    """The networks of an agent as a kernel changes them. Made by :func:`learner`."""

    weights: NDArray[np.float32]
    """Shape (agents, inputs + 2, units): by input, then the output weights, then the output biases. The networks of
    the actions lie side by side: hidden unit ``h`` of action ``a`` is at ``a width + h``, its output bias at
    ``a width``. There is an agent a joint, or one for all."""
    traces: NDArray[np.float32]
    """Eligibility of each weight, same shape; not used if ``decay`` is 0."""
    traced: NDArray[np.bool_]
    """Which networks have traces that are not 0, shape (agents, choices); 9 choices for each joint of an agent."""
    hidden: NDArray[np.float32]
    """Workspace for all networks of an agent, shape (units,)."""
    activation: NDArray[np.float32]
    """Workspace for the hidden units of one network, shape (width,); 0 beyond them."""
    slope: NDArray[np.float32]
    """Workspace, same shape."""
    size: int
    """Hidden units of one network."""
    rate: float
    """beta."""
    discount: float
    """gamma."""
    decay: float
    """lambda."""
    scale: float
    """Return that an output of 1 stands for."""
    off_policy: bool
    """Q-learning."""
    own: bool
    """Whether each agent has a goal of its own."""
    reward: RewardParameters
    """What is paid."""


def learner(
    weights: NDArray[np.float32],
    settings: TrainSettings,
    learning_rate: float | None = None,
    choices: int | None = None,
) -> ActionValues:
    """Return a learner that changes ``weights`` in place; an agent has ``choices``, by default those of its team."""
    width = padded(settings.hidden, LANES)
    return ActionValues(
        weights=weights,
        traces=np.zeros_like(weights),
        traced=np.zeros((len(weights), choices or _choices(weights.shape[2] // width, settings.team)), np.bool_),
        hidden=np.zeros(weights.shape[2], np.float32),
        activation=np.zeros(width, np.float32),
        slope=np.zeros(width, np.float32),
        size=settings.hidden,
        rate=float(settings.learning_rate if learning_rate is None else learning_rate),
        discount=float(settings.discount),
        decay=float(settings.trace_decay),
        scale=float(settings.return_scale),
        off_policy=settings.method == "q-learning",
        own=settings.team == "own",
        reward=settings.reward.parameters,
    )


def _choices(networks: int, team: Team) -> int:
    """Return how many choices there are where there is room for so many ``networks`` an agent."""
    choices = ACTIONS
    while team == "one" and choices * ACTIONS <= networks:
        choices *= ACTIONS
    return choices


class Networks(NamedTuple):
    """The weights of an agent's networks without padding, one network an action of each joint.

    One agent for all joints has 9^joints networks in place of (joints, 9): (1, 9^joints).
    """

    hidden_weights: NDArray[np.float32]
    """Shape (joints, 9, state_size + joints, hidden); inputs are sigma and the goals (thesis eq. 4.12)."""
    hidden_bias: NDArray[np.float32]
    """Shape (joints, 9, hidden)."""
    output_weights: NDArray[np.float32]
    """Shape (joints, 9, hidden)."""
    output_bias: NDArray[np.float32]
    """Shape (joints, 9)."""


def network_shapes(window: Window, hidden: int, team: Team = "common") -> Networks:
    """Return empty networks whose arrays have the right shapes."""
    joints, inputs = window.joints, window.state_size + window.joints
    networks = (1, ACTIONS**joints) if team == "one" else (joints, ACTIONS)
    shapes = (*networks, inputs, hidden), (*networks, hidden), (*networks, hidden), networks
    return Networks(*(np.zeros(shape, np.float32) for shape in shapes))


def draw_networks(window: Window, settings: TrainSettings, random: np.random.Generator, muscles: int = 2) -> Networks:
    """Return networks with all weights and biases uniform in the initial range (section 4.2.6).

    Actions that joints with so many ``muscles`` do not have are worth so little that none is ever taken or changed.
    """
    most = settings.initial_weight
    shapes = network_shapes(window, settings.hidden, settings.team)
    networks = Networks(*(random.uniform(-most, most, array.shape).astype(np.float32) for array in shapes))
    possible = each = possible_actions(muscles)
    while len(possible) < networks.output_bias.shape[1]:  # one agent has combinations of what its joints have
        possible = (possible[:, None] & each).ravel()
    networks.output_bias[:, ~possible] = NEVER
    return networks


def pack(networks: Networks, window: Window) -> NDArray[np.float32]:
    """Return ``networks`` as the weights of a :class:`ActionValues`."""
    layout, state = layout_of(window), window.state_size
    agents, choices, _, size = networks.hidden_weights.shape
    width = padded(size, LANES)
    weights = np.zeros((agents, layout.size + 2, padded(choices * width, UNIT_BLOCK)), np.float32)
    rows = _by_action(weights, width, choices)
    rows[:, :, :state, :size] = networks.hidden_weights[:, :, :state]
    rows[:, :, layout.goal : layout.one, :size] = networks.hidden_weights[:, :, state:]
    rows[:, :, layout.one, :size] = networks.hidden_bias
    rows[:, :, -2, :size] = networks.output_weights
    rows[:, :, -1, 0] = networks.output_bias
    return weights


def unpack(weights: NDArray[np.float32], window: Window, hidden: int, team: Team = "common") -> Networks:
    """Return what :func:`pack` packed."""
    layout, state = layout_of(window), window.state_size
    width = padded(hidden, LANES)
    rows = _by_action(weights, width, _choices(weights.shape[2] // width, team))
    return Networks(
        np.concatenate([rows[:, :, :state, :hidden], rows[:, :, layout.goal : layout.one, :hidden]], axis=2),
        rows[:, :, layout.one, :hidden].copy(),
        rows[:, :, -2, :hidden].copy(),
        rows[:, :, -1, 0].copy(),
    )


def _by_action(weights: NDArray[np.float32], width: int, choices: int) -> NDArray[np.float32]:
    """Return ``weights`` of a :class:`ActionValues` by network, shape (agents, choices, inputs + 2, width)."""
    used = weights[:, :, : choices * width]
    return used.reshape(*used.shape[:2], choices, width).transpose(0, 2, 1, 3)


@part(entry=True)
def action_values(learner, agent, x, values):  # type: ignore[no-untyped-def]
    """Set ``values`` (choices,) to the action values of ``agent`` in the state and goal ``x``, in units of reward."""
    weights, hidden = learner.weights[agent], learner.hidden
    row, width = x.shape[0], learner.activation.shape[0]
    weighted_sums(x, weights, 0, hidden)
    tansig(hidden)
    for action in range(values.shape[0]):
        value = weights[row + 1, action * width]
        for h in range(learner.size):
            u = np.uint64(action * width + h)  # an unsigned index needs no test for wrapping around
            value += hidden[u] * weights[row, u]
        values[action] = value * np.float32(learner.scale)


@part
def td_target(reward, discount, next_value, terminal):  # type: ignore[no-untyped-def]
    """Return what Q(s_k, a_k) should have been: r_{k+1} + gamma Q(s_{k+1}, .), where a terminal state has 0."""
    return reward if terminal else reward + discount * next_value


@part(fastmath=_IN_ORDER)
def backpropagate(learner, agent, x, action):  # type: ignore[no-untyped-def]
    """Return the value of ``action`` in ``x`` and leave its network's activations and slopes in the learner.

    ``slope`` is the derivative of the network's output by what enters each hidden unit.
    """
    weights, activation, slope = learner.weights[agent], learner.activation, learner.slope
    row, first = x.shape[0], action * activation.shape[0]
    weighted_sums(x, weights, first, activation)
    tansig(activation)
    output = weights[row + 1, first]
    for h in range(learner.size):
        weight = weights[row, np.uint64(first + h)]
        output += activation[h] * weight
        slope[h] = weight * (np.float32(1.0) - activation[h] * activation[h])
    return output * np.float32(learner.scale)


@part(fastmath=_IN_ORDER)
def add_gradient(learner, table, x, action, factor):  # type: ignore[no-untyped-def]
    """Add ``factor`` times the gradient that :func:`backpropagate` left to ``table`` (inputs + 2, units).

    Leaves ``factor`` times the slopes in the learner.
    """
    activation, slope = learner.activation, learner.slope
    row, first = x.shape[0], action * activation.shape[0]
    for h in range(learner.size):
        slope[h] *= factor
        table[row, np.uint64(first + h)] += factor * activation[h]
    table[row + 1, first] += factor
    add_products(table, first, x, slope)


@part
def update(learner, agent, x, action, target):  # type: ignore[no-untyped-def]
    """Move the value of ``action`` in ``x`` towards ``target``; return the error delta, in units of reward."""
    delta = target - backpropagate(learner, agent, x, action)
    factor = np.float32(learner.rate * delta / learner.scale)
    if learner.decay == 0.0:
        add_gradient(learner, learner.weights[agent], x, action, factor)
    else:
        add_gradient(learner, learner.traces[agent], x, action, np.float32(1.0))
        learner.traced[agent, action] = True
        follow_traces(learner, agent, factor)
    return delta


@part
def follow_traces(learner, agent, factor):  # type: ignore[no-untyped-def]
    """Move all weights of ``agent`` by ``factor`` along their traces, and let these decay."""
    weights, traces = learner.weights[agent], learner.traces[agent]
    decay, width = np.float32(learner.discount * learner.decay), learner.activation.shape[0]
    for action in range(learner.traced.shape[1]):
        if learner.traced[agent, action]:
            follow(weights, traces, action * width, width, factor, decay)


@part
def forget_traces(learner, agent):  # type: ignore[no-untyped-def]
    """Set the traces of ``agent`` to 0, as at the start of every episode."""
    traces, width = learner.traces[agent], learner.activation.shape[0]
    for action in range(learner.traced.shape[1]):
        if learner.traced[agent, action]:
            learner.traced[agent, action] = False
            for i in range(traces.shape[0]):
                for u in range(action * width, (action + 1) * width):
                    traces[i, np.uint64(u)] = np.float32(0.0)
