"""Make environments by the name of an arm."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from pneumarm.address import StoreAddress
from pneumarm.arm import Arm, open_arm
from pneumarm.arm.reference import Reference
from pneumarm.errors import UnusableInput
from pneumarm.gym.drawing import Counts, Drawing, Pose, renderable
from pneumarm.gym.follow import ArmFollow, FollowSettings
from pneumarm.gym.on_arm import ArmPointToPoint
from pneumarm.gym.simulated import SimulatedPointToPoint
from pneumarm.gym.spaces import View, nominal_view
from pneumarm.gym.vector import PointToPointVector
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.begin import BeginStates, begin_states
from pneumarm.task.reward import Reward
from pneumarm.task.settings import TaskSettings
from pneumarm.transitions import Store
from pneumarm.transitions.window import QUANTITIES, Window

_SIMULATION = "simulation:"


def point_to_point(
    arm: str | Arm | Simulation = "virtual",
    transitions: StoreAddress | BeginStates | None = None,
    like: str | Path | Simulation | None = None,
    goals: ArrayLike | None = None,
    reward: Reward = Reward(),
    cutoff: int = 100,
    noise: NoiseSettings = NoiseSettings(),
    seed: int = 0,
    render_mode: str | None = None,
) -> gymnasium.Env[Any, Any]:
    """Return an environment in which an arm of pneumatic muscles is to be moved to a goal and stopped there.

    ``gymnasium.make("pneumarm/PointToPoint-v0", arm="virtual:seed=7")``

    ## Description
    A joint is turned by two antagonistic pneumatic muscles with on/off valves. From rest at a random angle it is to
    reach a goal angle and be slow there, in few control periods and with few changes of the valves (thesis chapters 4
    and 5). The arm is a learned simulation of one, a virtual arm, or a real one.

    ## Action Space
    ``Discrete(9)``; ``MultiDiscrete([9] * joints)`` with several joints; ``Discrete(3)`` for an arm with one muscle a
    joint, whose valves are out, closed or in. Action ``3 * (v1 + 1) + (v2 + 1)`` sets the
    valves of muscle 1 and 2, each -1 (air out), 0 (closed) or +1 (air in), for a control period of 1/30 s:

    | Num | muscle 1 | muscle 2 |   | Num | muscle 1 | muscle 2 |   | Num | muscle 1 | muscle 2 |
    |-----|----------|----------|---|-----|----------|----------|---|-----|----------|----------|
    | 0   | out      | out      |   | 3   | closed   | out      |   | 6   | in       | out      |
    | 1   | out      | closed   |   | 4   | closed   | closed   |   | 7   | in       | closed   |
    | 2   | out      | in       |   | 5   | closed   | in       |   | 8   | in       | in       |

    On an arm, inlets stay closed while their muscle reads over the pressure limit.

    ## Observation Space
    ``Box`` of float32: the state window of thesis eq. 3.5 and the goal (eq. 4.12), scaled to about -1..1. With the
    history h (3 in the thesis) and one joint it holds, newest first,

    | Num        | Observation                                           |
    |------------|-------------------------------------------------------|
    | 4 i        | angle, i = 0..h-1 periods ago                         |
    | 4 i + 1    | angular velocity                                      |
    | 4 i + 2, 3 | pressures of muscle 1 and 2                           |
    | 4 h + 2 i  | valves of muscle 1 and 2, i+1 = 1..h-1 periods ago    |
    | last       | goal, scaled as an angle                              |

    The scaling is that of the simulation, or of ``like``, so that an agent trained in a simulation can be put onto
    the arm; without either it is by the sensors' ranges.

    ## Rewards
    -1 for each action, +50 instead for the one that reaches the goal, and -8 for each joint whose action differs from
    the one before it in the episode (thesis eq. 4.2, section 5.4.1). ``reward`` changes these.

    ## Starting State
    At rest with closed valves: in a simulation one of the recorded resting states; on an arm all muscles are vented
    for 2 s, inflated for up to 1.5 s each, and closed for 1 s (section 5.5). The goal is uniform in the range of
    goals, or ``reset(options={"goal": [counts]})`` or ``{"goal_deg": [degrees]}``.

    ## Episode End
    Termination: every joint is within 25 counts of its goal and not faster than 1 count/ms (eq. 5.1, 5.2), judged
    after each action. Truncation: 100 actions were taken. ``info["is_success"]`` tells the one from the other.

    ## Arguments
    * ``arm``: ``"simulation:FILE"`` or a ``Simulation`` (fast, needs ``transitions``), or any arm: ``"virtual"``,
      ``"virtual:seed=N"``, ``"python:module:callable"``, or an ``Arm``.
    * ``transitions``: the store that a simulation's begin states are taken from.
    * ``like``: on an arm, the simulation whose state window, scaling and goals are used.
    * ``goals``: lowest and highest goal (joints, 2) [counts]; by default those of the simulation, or the inner 80 %
      of the angle's range.
    * ``reward``, ``cutoff``, ``noise``: as in :class:`pneumarm.task.TaskSettings`; noise in a simulation only.
    * ``seed``: of a virtual arm's noise.
    * ``render_mode``: ``"rgb_array"``, or ``"human"`` for a window (``pip install 'pneumarm[window]'``).

    ## Version History
    * v0: the definitions of pneumarm 0.1

    Raises:
        UnusableInput: no such arm or file, or arguments that do not go together.

    """
    simulation = _simulation(arm)
    if simulation is not None:
        if like is not None:
            raise UnusableInput("like= is for arms; a simulation has a state window of its own")
        settings = TaskSettings(reward, cutoff, noise)
        within = SimulatedPointToPoint(_with_goals(simulation, goals), _begin(simulation, transitions), settings)
        return renderable(within, _pose_with_goal(simulation.scaling), simulation.spec, render_mode)
    if transitions is not None:
        raise UnusableInput("transitions= is for simulations; an arm is brought to its begin states")
    opened, view = _opened(arm, seed, like)
    if goals is not None:
        view = view._replace(goals=_goals(goals, view.window.joints))
    on_arm = ArmPointToPoint(opened, view, TaskSettings(reward, cutoff))
    return renderable(on_arm, _pose_with_goal(view.scaling), opened.spec, render_mode)


def follow(
    arm: str | Arm = "virtual",
    reference: str | Reference | None = None,
    like: str | Path | Simulation | None = None,
    seconds: float = FollowSettings.seconds,
    tolerance: float = FollowSettings.tolerance,
    change: float = FollowSettings.change,
    preview: tuple[float, ...] = FollowSettings.preview,
    seed: int = 0,
    render_mode: str | None = None,
) -> gymnasium.Env[Any, Any]:
    """Return an environment in which an arm of pneumatic muscles is to follow a reference, or to hold a goal.

    ``gymnasium.make("pneumarm/Follow-v0", arm="virtual:seed=7")``

    ## Description
    From rest at a random angle the arm is to be where a reference is, at every moment. A goal to settle at and to
    hold is a reference that stays. The arm is a virtual one, a learned simulation, or a real one.

    ## Action Space
    ``Box(-1, 1, (2 * joints,))``: for each muscle the share of the control period for which its inlet (above 0) or
    its exhaust (below 0) is open. On an arm, inlets stay closed while their muscle reads over the pressure limit, and
    pulses are rounded to what the valves can do.

    ## Observation Space
    ``Box`` of float32: the scaled state window, as in ``pneumarm/PointToPoint-v0`` without its goal, and then how far
    the reference is from the angle of each joint, scaled as an angle: now, and at each of the times ahead that
    ``preview`` says. Nothing of it is hidden from an agent that may not look ahead but by ``preview=()``.

    ## Rewards
    Minus the error in tolerances (the mean over the joints), minus ``change`` for each time that a muscle's valves
    change: -1 a step is a degree off. What is held within a tenth of a degree with closed valves costs 0.1 a step.

    ## Starting State
    At rest with closed valves: all muscles are vented for 2 s, inflated for up to 1.5 s each, and closed for 1 s. The
    reference is ``reference``, or ``reset(options={"reference": "sine:0.5Hz,20deg"})`` or
    ``reset(options={"goal_deg": 20})``; otherwise one is drawn: goals near and far, steps, sinusoids, smooth moves.

    ## Episode End
    Truncation after ``seconds``; nothing terminates an episode. ``info`` holds ``angle_deg``, ``wanted_deg``,
    ``error_deg`` (joints,) and ``valve_changes``.

    ## Arguments
    * ``arm``: ``"virtual"``, ``"virtual:seed=N"``, ``"simulation:FILE"``, ``"python:module:callable"`` or an ``Arm``.
    * ``reference``: a name as of :mod:`pneumarm.task.reference` or a ``Reference``, to be followed in every episode.
    * ``like``: the simulation whose state window, scaling and range of goals are used; that of ``simulation:FILE`` by
      itself.
    * ``seconds``: length of an episode.
    * ``tolerance``: what an error is measured in [degrees].
    * ``change``: price of a valve change.
    * ``preview``: how far ahead the reference is seen [s].
    * ``seed``: of a virtual arm's noise.
    * ``render_mode``: ``"rgb_array"``, or ``"human"`` for a window (``pip install 'pneumarm[window]'``).

    ## Version History
    * v0: the definitions of pneumarm 0.1

    Raises:
        UnusableInput: no such arm or file, a reference that leaves the range of goals, or a number out of its range.

    """
    settings = FollowSettings(seconds, tolerance, change, preview)
    if like is None and isinstance(arm, str) and arm.startswith(_SIMULATION):
        like = arm.removeprefix(_SIMULATION)
    opened, view = _opened(arm, seed, like)
    try:
        env = ArmFollow(opened, view, reference, settings)
    except UnusableInput:
        opened.close()
        raise
    return renderable(env, _pose_with_distance(view.window, view.scaling), opened.spec, render_mode)


def _opened(arm: str | Arm | Simulation, seed: int, like: str | Path | Simulation | None) -> tuple[Arm, View]:
    """Return an arm and the view of it: that of ``like``."""
    opened = arm if isinstance(arm, Arm) else open_arm(str(arm), seed)
    if like is None:
        return opened, nominal_view(opened.spec)
    try:
        model = like if isinstance(like, Simulation) else Simulation.load(Path(like))
        if model.window.joints != opened.spec.joints:
            raise UnusableInput(f"like= has {model.window.joints} joint(s), the arm has {opened.spec.joints}")
        model.window.require(opened.spec.further, opened.spec.name)
    except UnusableInput:
        opened.close()
        raise
    return opened, View(model.window, model.scaling, model.goal_range)


def _pose_with_goal(scaling: Scaling) -> Pose:
    """Return where the arm is and its goal, from an observation that ends with the goal."""
    joints = len(scaling.command_scale) // 2

    def pose(observation: NDArray[np.float32]) -> tuple[Counts, Counts, Counts]:
        now = _latest(observation, scaling)
        return now[:, 0], _angle(observation[-joints:], scaling), now[:, 2:]

    return pose


def _pose_with_distance(window: Window, scaling: Scaling) -> Pose:
    """Return where the arm is and is wanted, from an observation with the distances after the state."""
    joints, first = window.joints, window.state_size

    def pose(observation: NDArray[np.float32]) -> tuple[Counts, Counts, Counts]:
        at, now = observation[: joints * len(QUANTITIES) : len(QUANTITIES)], _latest(observation, scaling)
        return now[:, 0], _angle(at + observation[first : first + joints], scaling), now[:, 2:]

    return pose


def _latest(observation: NDArray[np.float32], scaling: Scaling) -> Counts:
    """Return the newest reading in an observation, shape (joints, 4) [counts]."""
    joints = slice(len(scaling.command_scale) // 2 * len(QUANTITIES))
    found = observation[joints] * scaling.observation_scale[joints] + scaling.observation_offset[joints]
    return np.asarray(found, np.float64).reshape(-1, len(QUANTITIES))


def _angle(scaled: NDArray[np.float32], scaling: Scaling) -> Counts:
    places = slice(0, len(scaled) * len(QUANTITIES), len(QUANTITIES))
    found: Counts = scaled * scaling.observation_scale[places] + scaling.observation_offset[places]
    return found


for _maker in (point_to_point, follow):
    setattr(_maker, "metadata", Drawing.metadata)  # noqa: B010 - by this Gymnasium makes windows and lists


def point_to_point_vector(
    arm: str | Simulation,
    transitions: StoreAddress | BeginStates,
    num_envs: int = 1,
    goals: ArrayLike | None = None,
    reward: Reward = Reward(),
    cutoff: int = 100,
    noise: NoiseSettings = NoiseSettings(),
    threads: int | None = None,
    autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    copy: bool = True,
    max_episode_steps: int | None = None,
) -> PointToPointVector:
    """Return ``num_envs`` environments like :func:`point_to_point` in one compiled step, over a simulation only.

    ``gymnasium.make_vec("pneumarm/PointToPoint-v0", 4096, vectorization_mode="vector_entry_point",
    arm="simulation:arm.sim", transitions="arm.db")``; the arguments are described there and in
    :class:`PointToPointVector`. ``max_episode_steps`` is Gymnasium's name for a cut-off; the smaller of both holds.

    Raises:
        UnusableInput: no simulation, or arguments that do not go together.

    """
    simulation = _simulation(arm)
    if simulation is None:
        raise UnusableInput(f"arm {arm!r}: only simulations are vectorised; give simulation:FILE")
    return PointToPointVector(
        _with_goals(simulation, goals),
        _begin(simulation, transitions),
        num_envs,
        TaskSettings(reward, cutoff if max_episode_steps is None else min(cutoff, max_episode_steps), noise),
        threads=threads,
        autoreset_mode=autoreset_mode,
        copy=copy,
    )


def _simulation(arm: str | Arm | Simulation) -> Simulation | None:
    """Return the simulation that is meant, or None for an arm."""
    if isinstance(arm, Simulation):
        return arm
    if isinstance(arm, str) and arm.startswith(_SIMULATION):
        return Simulation.load(Path(arm.removeprefix(_SIMULATION)))
    return None


def _begin(simulation: Simulation, transitions: StoreAddress | BeginStates | None) -> BeginStates:
    if isinstance(transitions, BeginStates):
        return transitions
    if transitions is None:
        raise UnusableInput(
            "a simulation knows no begin states: give transitions=, the store of the recordings that it was fitted to"
        )
    with Store.open(transitions) as store:
        return begin_states(store.blocks(), simulation.window, simulation.scaling, simulation.spec)


def _goals(goals: ArrayLike, joints: int) -> Any:
    range_ = np.asarray(goals, np.float64)
    if range_.size != 2 * joints or not np.isfinite(range_).all():
        raise UnusableInput(f"goals= needs a lowest and a highest angle for {joints} joint(s), got {goals!r}")
    range_ = range_.reshape(joints, 2)
    if not (range_[:, 0] <= range_[:, 1]).all():
        raise UnusableInput(f"goals= needs the lowest angle first, got {goals!r}")
    return range_


def _with_goals(simulation: Simulation, goals: ArrayLike | None) -> Simulation:
    if goals is None:
        return simulation
    return simulation.with_goals(_goals(goals, simulation.window.joints))
