"""A policy that reaches goals as a graph of ONNX: its greedy action, without looking ahead."""

import numpy as np

from pneumarm.arm.valves import ACTIONS, VALVES
from pneumarm.learning.policy.agent import PolicyAgent
from pneumarm.learning.policy.proximal import FORBIDDEN
from pneumarm.learning.scaled_state import add_scaled_state, state_words
from pneumarm.networks.onnx_graph import Graph


def policy_as_onnx(agent: PolicyAgent) -> bytes:
    """Return the policy of ``agent`` with its scaling: of state, goal and last action to action (samples, joints).

    Raises:
        UnusableInput: the library that writes it is not installed.

    """
    window, mind, graph = agent.window, agent.mind(), Graph()
    joints = window.joints
    x = add_scaled_state(graph, window, agent.scaling)
    goal = graph.input("goal", joints)
    last, still = graph.input("last_action", joints), graph.input("still", joints)
    offset, scale = (
        window.of_joints(one)[:, 0] for one in (agent.scaling.observation_offset, agent.scaling.observation_scale)
    )
    wanted = graph.node("Div", graph.node("Sub", goal, offset), scale)
    angles = graph.columns(x, mind.inputs.layout.angles)
    away = graph.node("Sub", wanted, angles)
    squashed = graph.node("Mul", graph.reshaped(away, joints, 1), mind.inputs.gain)
    bent = graph.reshaped(graph.node("Tanh", squashed), joints * mind.inputs.gain.shape[1])
    first = graph.node("Where", graph.node("Less", graph.columns(last, [0]), 0.0), 1.0, 0.0)
    logits = graph.reshaped(graph.network(mind.layers, graph.joined([x, wanted, bent, first])), joints, ACTIONS)
    again = graph.node("Equal", graph.reshaped(last, joints, 1), np.arange(ACTIONS))
    held = graph.node("Where", again, np.float32(mind.hold), 0.0)
    useless = _useless(graph, agent, x, away, again, still)
    bias = graph.node("Where", useless, FORBIDDEN, held)
    action = graph.node("ArgMax", graph.node("Add", logits, bias), axis=2, keepdims=0)
    graph.output(logits, "logits", joints, ACTIONS)
    graph.output(action, "action", joints, whole=True)
    words = (
        f"{state_words(window)} goal: of each joint [counts]. last_action: 0 to 8, -1 before the first. still: for "
        "how many control periods in a row the last action has changed neither angle nor pressures by more than "
        f"{agent.settings.still:g} counts; 0 where that is not counted. action: of each joint, thesis table 2.1, "
        "the most probable of those that are of use; logits: what the network says. Looking ahead and the guard are "
        "not in it."
    )
    return graph.model("policy", words, {"arm": agent.spec.name, "period": repr(agent.spec.period)})


def _useless(graph: Graph, agent: PolicyAgent, x: str, away: str, again: str, still: str) -> str:
    """Return which actions are of no use (samples, joints, 9), see :func:`pneumarm.task.fleet.is_useful`."""
    limits, joints = agent.mind().limits, agent.window.joints
    pressures = graph.columns(x, limits.layout.pressures)
    over = graph.reshaped(graph.node("Greater", pressures, limits.inlet.ravel()), joints, 1, 2)
    opens = graph.node("And", over, graph.constant(VALVES > 0, bool))
    useless = graph.node("Or", *(graph.node("Gather", opens, graph.constant(m, np.int64), axis=3) for m in range(2)))
    if limits.patience == 0:
        return useless
    far = graph.node("Greater", graph.node("Abs", away), limits.tolerance)
    stuck = graph.node("And", graph.node("GreaterOrEqual", still, np.float32(limits.patience)), far)
    return graph.node("Or", useless, graph.node("And", again, graph.reshaped(stuck, joints, 1)))
