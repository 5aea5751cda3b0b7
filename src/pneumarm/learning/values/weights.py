"""All that an agent of a rule has learned as one vector of weights, and the learner that changes it."""

from math import prod

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS, possible_actions
from pneumarm.learning.values.approximators.coding import Coding
from pneumarm.learning.values.approximators.function import ValueFunction, function_shape, value_function
from pneumarm.learning.values.approximators.kanerva import kanerva
from pneumarm.learning.values.approximators.network import draw_weights, network
from pneumarm.learning.values.approximators.radial import radial
from pneumarm.learning.values.approximators.table import table
from pneumarm.learning.values.approximators.tiles import tiles
from pneumarm.learning.values.learner import ACTOR_CRITIC, MONTE_CARLO, Q_LEARNING, SARSA, TD, LearnedValues
from pneumarm.learning.values.policies import POLICIES
from pneumarm.learning.values.settings import Rule, ValueSettings
from pneumarm.learning.values.td import model_of
from pneumarm.learning.values.view import view_of
from pneumarm.simulation.layout import layout_of
from pneumarm.simulation.simulation import Simulation

RULES: dict[Rule, int] = {
    "td": TD,
    "monte-carlo": MONTE_CARLO,
    "sarsa-lambda": SARSA,
    "q-lambda": Q_LEARNING,
    "actor-critic": ACTOR_CRITIC,
    "dynamic-programming": Q_LEARNING,
}
"""What a kernel calls a rule; what was planned goes on learning as Q(lambda) does."""
NETWORKS = {"network", "networks"}
_CELLS = {
    "table": {"error": 21, "velocity": 9, "pressure_1": 6, "pressure_2": 6, "angle": 5},
    "dynamic-programming": {"error": 21, "velocity": 9, "pressure_1": 10, "pressure_2": 10, "angle": 8},
    "tiles": {"error": 10, "velocity": 6, "pressure_1": 4, "pressure_2": 4, "angle": 4},
    "kanerva": {"error": 20, "velocity": 12, "pressure_1": 8, "pressure_2": 8, "angle": 8},
}


def coding_of(settings: ValueSettings) -> Coding:
    """Return how ``settings`` have states coded."""
    default = _CELLS.get(settings.rule, _CELLS.get(settings.approximator, {}))
    cells = settings.cells or tuple(default.get(name, 1) for name in settings.variables)
    match settings.approximator:
        case "table":
            return table(cells)
        case "tiles":
            return tiles(cells, settings.tilings, settings.room)
        case "radial":
            return radial(len(cells), settings.centres, settings.width)
        case "kanerva":
            return kanerva(cells, settings.centres, settings.reach)
        case _:
            return network()


def weight_shapes(simulation: Simulation, settings: ValueSettings) -> dict[str, tuple[int, int, int]]:
    """Return the shapes of what the vector of weights holds, in its order."""
    joints, inputs = simulation.window.joints, layout_of(simulation.window).size
    is_network = settings.approximator in NETWORKS
    of_states = settings.rule in {"td", "actor-critic"}
    outputs = ACTIONS if not of_states else 1 if is_network else ACTIONS + 1
    coding = coding_of(settings)

    def shape(outputs: int) -> tuple[int, int, int]:
        return function_shape(coding, joints, outputs, inputs, settings.hidden, _groups(settings, outputs))

    none = joints, 0, 0
    shapes = {"values": shape(outputs), "actor": shape(ACTIONS) if settings.rule == "actor-critic" else none}
    is_averaging = settings.step_size == "1/k"
    return shapes | {f"{name} visits": shapes[name] if is_averaging else none for name in ("values", "actor")}


def weight_count(simulation: Simulation, settings: ValueSettings) -> int:
    """Return the length of the vector of weights."""
    return sum(prod(shape) for shape in weight_shapes(simulation, settings).values())


def first_weights(
    simulation: Simulation, settings: ValueSettings, random: np.random.Generator
) -> NDArray[np.float32]:
    """Return the weights that learning begins with: of networks drawn as the thesis', others 0."""
    count = weight_count(simulation, settings)
    if settings.approximator in NETWORKS:
        return draw_weights((count,), settings.initial_weight, random)
    return np.zeros(count, np.float32)


def learner_of(
    simulation: Simulation,
    settings: ValueSettings,
    weights: NDArray[np.float32],
    learning_rate: float | None = None,
) -> LearnedValues:
    """Return a learner that changes ``weights`` (n,) in place."""
    parts, begin = {}, 0
    for name, shape in weight_shapes(simulation, settings).items():
        parts[name] = weights[begin : begin + prod(shape)].reshape(shape)
        begin += prod(shape)
    coding, is_network = coding_of(settings), settings.approximator in NETWORKS

    def function(name: str, outputs: int) -> ValueFunction:
        if not parts[name].size:
            return value_function(table((1,)), np.zeros((simulation.window.joints, 1, 1), np.float32))
        return value_function(
            coding,
            parts[name],
            parts[f"{name} visits"],
            inputs=layout_of(simulation.window).size,
            groups=_groups(settings, outputs),
            scale=settings.return_scale if is_network else 1.0,
            is_replacing=settings.traces == "replacing",
        )

    rate = settings.learning_rate if learning_rate is None else learning_rate
    share = rate / settings.learning_rate if settings.learning_rate else 1.0
    return LearnedValues(
        rule=RULES[settings.rule],
        policy=POLICIES.index(settings.policy),
        values=function("values", 1 if settings.rule in {"td", "actor-critic"} else ACTIONS),
        actor=function("actor", ACTIONS),
        variables=view_of(simulation, settings),
        model=model_of(simulation, settings),
        possible=possible_actions(simulation.spec.muscles),
        rate=float(rate),
        actor_rate=float(settings.actor_rate * share),
        discount=float(settings.discount),
        decay=float(settings.trace_decay),
        switch=0.0 if is_network else float(settings.reward.switch),
    )


def _groups(settings: ValueSettings, outputs: int) -> int:
    return outputs if settings.approximator == "networks" else 1
