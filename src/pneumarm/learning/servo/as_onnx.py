"""A servo as a graph of ONNX: what :mod:`pneumarm.learning.servo.as_c` is, for runtimes of networks."""

import numpy as np

from pneumarm.learning.scaled_state import add_scaled_state, state_words
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.commands import GAIN, WHOLE
from pneumarm.learning.servo.inputs import BENDS, FAR, PRESSURE_CHANGE
from pneumarm.networks.layers import split
from pneumarm.networks.onnx_graph import Graph


def servo_as_onnx(agent: ServoAgent) -> bytes:
    """Return the policy of ``agent`` with its scaling: of state and reference to pulses (samples, joints, 2).

    Raises:
        UnusableInput: the library that writes it is not installed.

    """
    window, steps = agent.window, agent.task.inputs.steps
    graph = Graph()
    x = add_scaled_state(graph, window, agent.scaling)
    reference = graph.input("reference", len(steps), window.joints)
    said = graph.network(split(agent.policy, agent.sizes), _seen(graph, agent, x, reference))
    graph.output(graph.reshaped(_pulses(graph, agent, x, said), window.joints, 2), "pulses", window.joints, 2)
    words = (
        f"{state_words(window)} reference: where each joint is wanted to be {', '.join(map(str, steps.tolist()))} "
        "control periods from now [counts]. pulses: for each muscle the share of the period for which its inlet "
        "(above 0) or exhaust (below 0) is open. Single pulses near a goal that stays and the guard are not in it."
    )
    notes = {"arm": agent.spec.name, "period": repr(agent.spec.period), "ahead": ",".join(map(str, steps.tolist()))}
    return graph.model("servo", words, notes)


def _seen(graph: Graph, agent: ServoAgent, x: str, reference: str) -> str:
    """Return what the network sees, see :mod:`pneumarm.learning.servo.inputs`."""
    window, scaling, seen = agent.window, agent.scaling, agent.task.inputs
    layout, columns = seen.layout, list[str]()
    for joint, place in enumerate(layout.angles):
        angle = graph.columns(x, [place])
        columns.append(angle)
        for lag in range(1, window.history):
            then = graph.columns(x, [lag * layout.observed + place])
            columns.append(graph.node("Mul", graph.node("Sub", angle, then), seen.rate[joint] / np.float32(lag)))
        for place in layout.pressures[2 * joint : 2 * joint + 2]:
            pressure = graph.columns(x, [place])
            before = graph.columns(x, [layout.observed + place]) if window.history > 1 else pressure
            columns += [pressure, graph.node("Mul", graph.node("Sub", pressure, before), PRESSURE_CHANGE)]
    if window.history > 1:
        columns.append(graph.columns(x, range(layout.history * layout.observed, layout.command)))
    offset, scale = (window.of_joints(one)[:, 0] for one in (scaling.observation_offset, scaling.observation_scale))
    wanted = graph.node("Div", graph.node("Sub", reference, offset), scale)
    angles = graph.reshaped(graph.columns(x, layout.angles), 1, window.joints)
    distance = graph.node("Mul", graph.node("Sub", wanted, angles), seen.tolerances)
    parts = [graph.node("Mul", distance, FAR)]
    parts += [graph.node("Tanh", graph.node("Mul", distance, bend)) for bend in BENDS]
    each = graph.joined([graph.reshaped(one, len(seen.steps), window.joints, 1) for one in parts], axis=3)
    by_joint = graph.node("Transpose", each, perm=[0, 2, 1, 3])
    columns.append(graph.reshaped(by_joint, 3 * window.joints * len(seen.steps)))
    return graph.joined(columns)


def _pulses(graph: Graph, agent: ServoAgent, x: str, said: str) -> str:
    """Return the pulses (samples, 2 joints), see :mod:`pneumarm.learning.servo.commands`."""
    made = agent.task.commands
    shortest, whole = np.float32(made.shortest), min(float(WHOLE), 1 - made.shortest / 2)
    v = graph.node("Mul", graph.node("Tanh", said), GAIN)
    size = graph.node("Div", graph.node("Sub", graph.node("Abs", v), made.dead), 1 - made.dead)
    pressures = graph.columns(x, made.layout.pressures)
    over = graph.node("Greater", pressures, made.inlet.ravel())
    closed = graph.node("And", graph.node("Greater", v, 0.0), over)
    size = graph.node("Clip", graph.node("Where", closed, 0.0, size), 0.0, 1.0)
    if made.step > 0:
        steps = graph.node("Round", graph.node("Div", size, made.step))
        pulse = graph.node("Min", graph.node("Mul", steps, made.step), 1.0)
    else:
        pulse = graph.node("Max", size, shortest)
        pulse = graph.node("Where", graph.node("Greater", size, whole), 1.0, pulse)
        pulse = graph.node("Where", graph.node("Less", size, shortest / 2), 0.0, pulse)
    return graph.node("Mul", graph.node("Sign", v), pulse)
