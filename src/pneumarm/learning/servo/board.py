"""A servo as a board drives it: window, policy, reference and holding, without plans and without looking ahead.

Everything that acts is in kernels: those of a :class:`~.controller.ServoController`, in its order. A board runs the
same statements, written as C by :mod:`~.translate`; :class:`BoardController` runs them here. What is left out is
what no small board can compute: plans (:mod:`~.predictive`) and the simulation that is asked how long a single pulse
has to be (:mod:`~.foresight`); the policy's own pulse is taken.
"""

from typing import NamedTuple

import numpy as np

from pneumarm.arm.guard import guarded
from pneumarm.arm.reference import Reference, constant
from pneumarm.arm.seam import Reading, checked
from pneumarm.kernels import kernel
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.at_rest import (
    Bools,
    Floats,
    Resting,
    RestParameters,
    Singles,
    blank,
    choose_joints,
    leave_goals,
    limit_pulses,
    look_at_joints,
    note_pulses,
)
from pneumarm.learning.servo.commands import CommandParameters, write_commands
from pneumarm.learning.servo.correction import (
    FEATURES,
    CorrectionParameters,
    correction_of,
    correction_parameters,
    learn_correction,
    write_features,
)
from pneumarm.learning.servo.following import TAUGHT_BY
from pneumarm.learning.servo.inputs import SeenParameters, input_size, write_inputs
from pneumarm.learning.servo.networks import FloatNetwork, network_of, run_network
from pneumarm.learning.servo.quantised import Quantised, Units, quantised_of, run_quantised, units_of
from pneumarm.learning.servo.rest import rest_parameters, resting
from pneumarm.learning.servo.spreading import spread_pulses
from pneumarm.learning.servo.two_ways import is_second_better
from pneumarm.simulation.arm import SimulationArm
from pneumarm.simulation.kernel import stops_by_angle
from pneumarm.simulation.layout import Layout
from pneumarm.task.tracker import write_observation

_GOALS, _HELD = 40, 1.5  # goals that inputs are looked at for, and for how long each [s]


class BoardParameters(NamedTuple):
    """What does not change while a board drives. Made by :func:`board_parameters`."""

    layout: Layout
    scale: Floats
    """Offsets and scales of an observation, shape (2, observed)."""
    by_angle: Singles
    """Change of stop operators by that of their angle, both scaled, shape (joints, remembered)."""
    command_scale: Floats
    """Shape (2 joints,)."""
    inputs: SeenParameters
    commands: CommandParameters
    rest: RestParameters
    correction: CorrectionParameters
    middle: Floats
    """Of the goals, shape (joints,) [counts]."""
    silence: Singles
    """No noise, as the kernel of the inputs takes it, shape (history, 3 joints, 1)."""
    spreads: bool
    """Whether pulses are spread over whole periods, for an arm without any."""


class BoardState(NamedTuple):
    """What changes. Shapes are (joints,) where none is given."""

    fresh: Bools
    """Whether the next reading is one at rest with closed valves, shape (1,)."""
    observation: Floats
    command: Floats
    """Given last, scaled, shape (2 joints,)."""
    x: Singles
    """The window, shape (state_size, 1)."""
    stays: Bools
    moves: Bools
    remains: Bools
    acts: Bools
    underway: Bools
    """Shape (joints, 1)."""
    error: Floats
    features: Floats
    """Shape (joints, 3), as those that follow."""
    weights: Floats
    largest: Floats
    preview: Singles
    """Shape (previews, joints, 1)."""
    inputs: Singles
    """Shape (inputs, 1)."""
    said: Singles
    """Shape (2 joints, 1), as those that follow."""
    slope: Singles
    pulses: Singles
    due: Floats
    """Shape (joints, 2)."""
    rest: Resting


@kernel
def begin_board(parameters, board):  # type: ignore[no-untyped-def]
    """Begin an episode: the arm is at rest with closed valves, and was perhaps moved by others."""
    board.fresh[0] = True
    board.rest.seen[0] = 0
    for i in range(board.x.shape[0]):
        board.x[i, 0] = np.float32(0.0)
    for i in range(board.command.shape[0]):
        board.command[i] = 0.0
    ask_board(parameters, board)


@kernel
def ask_board(parameters, board):  # type: ignore[no-untyped-def]
    """Note that something else is asked for."""
    leave_goals(parameters.rest, board.rest)
    for j in range(board.weights.shape[0]):
        for i in range(FEATURES):
            board.weights[j, i] = 0.0
            board.largest[j, i] = 0.0


@kernel
def see_board(parameters, board, angle, pressure, path, follows):  # type: ignore[no-untyped-def]
    """Take in a reading and write what the policy sees of it, ``board.inputs``.

    ``angle`` (joints,) and ``pressure`` (joints, 2) are read [counts]; ``path`` (3 + ahead, joints) is what was asked
    for a period ago, is now, and will be in those to come, and ``follows`` whether it ever moves.
    """
    observe_board(parameters, board, angle, pressure)
    joints = angle.shape[0]
    for j in range(joints):
        low = path[0, j]
        high = low
        for k in range(1, path.shape[0]):
            low = min(low, path[k, j])
            high = max(high, path[k, j])
        board.moves[j] = high > low
        board.stays[j] = not board.moves[j]
        board.remains[j] = True
    look_at_joints(parameters.rest, board.rest, path[1], board.stays, angle)
    choose_joints(parameters.rest, board.rest, path[1], board.stays, board.remains, board.acts)
    if follows:
        write_features(path, 0, parameters.middle, board.features)
        for j in range(joints):
            board.error[j] = path[1, j] - angle[j] if board.moves[j] else 0.0
        learn_correction(parameters.correction, board.weights, board.largest, board.error, board.features)
    preview_board(parameters, board, path, follows)
    write_inputs(
        parameters.inputs, board.x, parameters.silence, parameters.layout.history - 1, board.preview, board.inputs
    )


@kernel
def observe_board(parameters, board, angle, pressure):  # type: ignore[no-untyped-def]
    """Put a reading into the window. No velocity: the policy sees how the angle changed instead."""
    for j in range(angle.shape[0]):
        board.observation[4 * j] = angle[j]
        board.observation[4 * j + 2] = pressure[j, 0]
        board.observation[4 * j + 3] = pressure[j, 1]
    write_observation(
        parameters.layout,
        parameters.scale,
        parameters.by_angle,
        board.observation,
        board.fresh[0],
        board.command,
        board.x.ravel(),
    )
    board.fresh[0] = False


@kernel
def preview_board(parameters, board, path, follows):  # type: ignore[no-untyped-def]
    """Write where the reference will be, as the policy is asked for it, ``board.preview``."""
    for p in range(board.preview.shape[0]):
        ahead = parameters.inputs.steps[p]
        if follows:
            write_features(path, ahead, parameters.middle, board.features)
        for j in range(board.moves.shape[0]):
            added = board.rest.bias[j]
            if board.moves[j]:
                added = correction_of(parameters.correction, board.weights, board.features, j)
            wanted = path[ahead + 1, j] + added
            board.preview[p, j, 0] = np.float32((wanted - parameters.scale[0, 4 * j]) / parameters.scale[1, 4 * j])


@kernel
def act_board(parameters, board, pressure, command):  # type: ignore[no-untyped-def]
    """Set the ``command`` (joints, 2) by what the policy said of the inputs, ``board.said``."""
    joints, rest = board.moves.shape[0], board.rest
    for j in range(joints):
        board.underway[j, 0] = board.stays[j] and not rest.calm[j] and not is_second_better(rest.active, j)
    write_commands(parameters.commands, board.x, board.underway, board.said, board.slope, board.pulses)
    for j in range(joints):
        for muscle in range(2):
            command[j, muscle] = board.pulses[2 * j + muscle, 0]
    limit_pulses(parameters.rest, rest, pressure, board.acts, command)
    note_pulses(rest, board.acts, command)
    if parameters.spreads:
        spread_pulses(board.due, command)
    for j in range(joints):
        for muscle in range(2):
            board.command[2 * j + muscle] = command[j, muscle] / parameters.command_scale[2 * j + muscle]


def board_parameters(agent: ServoAgent) -> BoardParameters:
    """Return what a board needs of ``agent`` besides its network."""
    spec, window, scaling, task = agent.spec, agent.window, agent.scaling, agent.task
    rest = rest_parameters(spec, agent.simulation, agent.settings)
    return BoardParameters(
        layout=task.inputs.layout,
        scale=np.stack([scaling.observation_offset, scaling.observation_scale]),
        by_angle=stops_by_angle(window, scaling),
        command_scale=scaling.command_scale,
        inputs=task.inputs,
        commands=task.commands,
        rest=rest,
        correction=correction_parameters(TAUGHT_BY * rest.tolerance),
        middle=agent.goal_range.mean(axis=1),
        silence=np.zeros((window.history, 3 * window.joints, 1), np.float32),
        spreads=not spec.pulses,
    )


def board_state(parameters: BoardParameters, ways: tuple[float, ...] = ()) -> BoardState:
    """Return what changes, at first, with what was learned of the joints in the ``ways`` of the settings."""
    joints, previews = parameters.layout.joints, parameters.inputs.steps.size
    shapes: dict[str, tuple[int, ...]] = {
        "fresh": (1,),
        "observation": (parameters.layout.observed,),
        "command": (2 * joints,),
        "x": (parameters.layout.command, 1),
        "underway": (joints, 1),
        "preview": (previews, joints, 1),
        "inputs": (input_size(parameters.inputs), 1),
        "due": (joints, 2),
    }
    shapes |= dict.fromkeys(("features", "weights", "largest"), (joints, FEATURES))
    shapes |= dict.fromkeys(("said", "slope", "pulses"), (2 * joints, 1))
    return BoardState(**blank(BoardState, joints, **shapes), rest=resting(parameters.rest, joints, ways))


class BoardController:
    """Drives an arm as a board does: with the network of ``agent``, or with that of 8-bit weights.

    A reference whose future is not known is taken to stay where it is.
    """

    def __init__(self, agent: ServoAgent, quantised: Quantised | None = None) -> None:
        self.spec, self.goal_range = agent.spec, agent.goal_range
        self.parameters = board_parameters(agent)
        self.state = board_state(self.parameters, agent.settings.ways)
        self.network: FloatNetwork | Quantised = network_of(agent) if quantised is None else quantised
        self.units: Singles | Units = (
            units_of(agent.sizes) if quantised else np.zeros((2, max(agent.sizes)), np.float32)
        )
        self._ahead = int(self.parameters.inputs.steps.max())
        self._reference, self._begin = constant(self.goal_range.mean(axis=1)), -1.0
        self._before: Floats | None = None
        begin_board(self.parameters, self.state)

    @property
    def path_length(self) -> int:
        """Periods that a path takes: the one before, now and those ahead."""
        return 3 + self._ahead

    def reset(self, goal: Floats) -> None:
        """Begin a movement to ``goal`` (joints,) [counts]; the arm is at rest with its valves closed."""
        begin_board(self.parameters, self.state)
        self._reference, self._begin, self._before = constant(goal), -1.0, None

    def track(self, reference: Reference) -> None:
        """Follow ``reference``, which begins at the time of the next reading, from whatever the arm is doing."""
        ask_board(self.parameters, self.state)
        self._reference, self._begin, self._before = reference, -1.0, None

    def path(self, time: float) -> Floats:
        """Return what was asked for a period ago, is now and will be, shape (path_length, joints)."""
        now, steps = self._reference.at(time), range(1, self.path_length - 1)
        ahead = (
            [self._reference.at(time + k * self.spec.period) for k in steps] if self._reference.known_ahead else []
        )
        before, self._before = now if self._before is None else self._before, now
        return np.array([before, now, *(ahead or [now for _ in steps])])

    def act(self, reading: Reading) -> Floats:
        """Return the commands (joints, 2) after ``reading``, shares of the period for which a valve is open."""
        reading = checked(reading, self.spec)
        if self._begin < 0.0:
            self._begin = reading.time
        return self.step(reading.angle, reading.pressure, self.path(reading.time - self._begin))

    def step(self, angle: Floats, pressure: Floats, path: Floats) -> Floats:
        """Return the commands (joints, 2) after what is read, [counts], where a ``path`` is asked for."""
        parameters, board = self.parameters, self.state
        see_board(parameters, board, angle, pressure, path, not self._reference.stays)
        if isinstance(self.network, Quantised):
            run_quantised(self.network, board.inputs, self.units, board.said)
        else:
            run_network(self.network, board.inputs, self.units, board.said)
        command = np.empty(pressure.shape)
        act_board(parameters, board, pressure, command)
        return command


def quantised(agent: ServoAgent, seed: int = 0) -> Quantised:
    """Return the network of ``agent`` in whole numbers, scaled by what it sees while it moves its simulation."""
    controller, random, seen = BoardController(agent), np.random.default_rng(seed), []
    low, high = agent.goal_range.T
    with guarded(SimulationArm(agent.simulation, seed=seed)) as arm:
        for _ in range(_GOALS):
            controller.reset(low + (high - low) * random.random(arm.spec.joints))
            for _ in range(round(_HELD / arm.spec.period)):
                arm.decide(controller.act(arm.read()))
                seen.append(controller.state.inputs[:, 0].copy())
                arm.wait(arm.spec.period)
    return quantised_of(agent, np.array(seen))
