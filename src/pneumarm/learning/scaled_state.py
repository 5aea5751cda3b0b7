"""The state of an agent in a graph of ONNX: as an arm's sensors say it, and scaled as networks see it."""

import numpy as np

from pneumarm.networks.onnx_graph import Graph
from pneumarm.simulation.simulation import Scaling
from pneumarm.transitions.window import Window


def add_scaled_state(graph: Graph, window: Window, scaling: Scaling) -> str:
    """Add the input ``state`` (samples, state_size) in sensor units; return it scaled."""
    history = window.history
    radii = np.tile(np.array(window.hysteresis), window.joints)
    rest = 2 * window.joints * (history - 1) + len(radii)
    offset = [np.tile(scaling.observation_offset, history), np.zeros(rest)]
    scale = [np.tile(scaling.observation_scale, history), np.tile(scaling.command_scale, history - 1), radii]
    state = graph.input("state", window.state_size)
    return graph.node("Div", graph.node("Sub", state, np.concatenate(offset)), np.concatenate(scale))


def state_words(window: Window) -> str:
    """Return what the input ``state`` holds."""
    radii = ", ".join(f"{radius:.6g}" for radius in window.hysteresis)
    stops = f"; last, joint after joint, stop operators of the radii {radii} counts [counts]" if radii else ""
    return (
        f"state: the observations of the last {window.history} control periods, newest first, each of "
        f"{window.observation_size} numbers in sensor units (of each joint angle [counts], velocity [counts/ms], "
        "pressures of muscle 1 and 2 [counts], then further sensors), and after them the commands of the "
        f"{window.history - 1} periods before, newest first{stops}. In the first period, with the arm at rest, all "
        "periods are alike, velocities and commands 0."
    )
