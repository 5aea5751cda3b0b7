"""The compiled loop on a virtual arm is ``move`` behind the guard with a learning agent, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.arm import BeginState, ControlCycle, guarded
from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_parameters, preset_parameters
from pneumarm.control.agent import AgentController
from pneumarm.control.movement import drawn, move
from pneumarm.control.playing import Player
from pneumarm.errors import UnusableInput
from pneumarm.learning import Agent, Exploration, TrainSettings
from pneumarm.learning.online.agent import OnlineLearner
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.values import draw_networks
from pneumarm.task.movements import join_movements

COUNT = 12
RANGE = np.array([[150.0, 850.0]])
LATE = {"jitter": 0.02}
"""Turns are late by up to several control periods."""


def new_agent(joints: int = 1, **settings: object) -> Agent:
    simulation = synthetic_simulation(joints)
    chosen = TrainSettings(cutoff=40, **settings)  # type: ignore[arg-type]
    networks = draw_networks(simulation.window, chosen, np.random.default_rng(2))
    spec = replace(VirtualArm().spec, joints=joints, links=())
    goals = np.repeat(RANGE, joints, axis=0)
    return Agent(spec, simulation.window, simulation.scaling, goals, networks, chosen)


def draws(begin: BeginState, joints: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """What :func:`drawn` and ``reach`` draw for the first movements."""
    found = list(drawn(np.repeat(RANGE, joints, axis=0), 7, range(COUNT), test=False))
    durations = [one.random.uniform(0.0, begin.inflate, (joints, 2)) for one in found]
    return np.array([one.goal for one in found]), np.array(durations)


@pytest.fixture
def two_joints(monkeypatch: pytest.MonkeyPatch) -> ArmParameters:
    """An arm as its physics can have it, though none is drawn yet."""
    monkeypatch.setattr(ArmParameters, "_valid", lambda self: {})
    one, other = draw_parameters(7), draw_parameters(8)
    return replace(one, joints=(*one.joints, *other.joints), **LATE)


@pytest.mark.parametrize(
    ("parameters", "settings", "begin"),
    [
        (draw_parameters(3), {"method": "sarsa", "learning_rate": 0.1}, BeginState()),
        (draw_parameters(4), {"method": "q-learning", "learning_rate": 0.1, "trace_decay": 0.3}, BeginState()),
        # A supply of 2 bar: the limit of the pressure closes inlets, on the way to begin states too.
        (preset_parameters("C"), {"learning_rate": 0.05}, BeginState(deflate=0.3, inflate=3.0)),
        (draw_parameters(5), {"learning_rate": 0.0}, BeginState()),
        (replace(draw_parameters(6), **LATE), {"learning_rate": 0.1}, BeginState()),
    ],
)
def test_it_is_move_bit_for_bit(parameters: ArmParameters, settings: dict[str, object], begin: BeginState) -> None:
    check_it_is_move(parameters, settings, begin)


def test_it_is_move_bit_for_bit_with_two_joints(two_joints: ArmParameters) -> None:
    check_it_is_move(two_joints, {"learning_rate": 0.1}, BeginState())


def check_it_is_move(parameters: ArmParameters, settings: dict[str, object], begin: BeginState) -> None:
    joints = len(parameters.joints)
    agent, exploration = new_agent(joints, **settings), Exploration(0.2, 5.0)
    rate = agent.settings.learning_rate
    one, other = (VirtualArm(parameters, seed=9) for _ in range(2))
    learning = OnlineLearner(agent, rate, exploration, seed=4)
    cycle, controller = ControlCycle(guarded(one)), AgentController(agent, learning)
    expected = []
    for draw in drawn(agent.goal_range, 7, range(COUNT), test=False):
        begin.reach(cycle.arm, draw.random)
        expected.append(move(cycle, controller, draw.goal, agent.settings).row())
    player = Player(agent, other, rate, exploration, seed=4, begin=begin)
    played = join_movements(
        player.play(*(a[part] for a in draws(begin, joints))) for part in (slice(0, 5), slice(5, COUNT))
    )
    assert played.rows() == expected
    np.testing.assert_array_equal(player.learned.weights(), learning.weights())
    assert other.get_state() == one.get_state()
    assert (rate == 0) == np.array_equal(learning.weights(), agent.weights())
    assert (cycle.missed_deadlines > 0) == (parameters.jitter == LATE["jitter"])
    if parameters == preset_parameters("C"):
        assert cycle.arm.interventions.pressure > 0


def test_goals_near_to_where_the_arm_stands() -> None:
    """Within the deviation and the range of goals, as far as there is one within both."""
    agent, (goals, durations) = new_agent(), draws(BeginState())
    player = Player(agent, VirtualArm(draw_parameters(2), seed=1), 0.05, seed=1)
    near = player.play(goals, durations, Schedule(60.0, 0.5, 20.0, 0.002))
    inside = np.clip(near.angle_begin, *RANGE[0])
    assert np.abs(near.goal - inside).max() <= 62.0  # another reading of the angle: its noise
    assert ((near.goal >= RANGE[0, 0]) & (near.goal <= RANGE[0, 1])).all()
    assert len(np.unique(near.goal)) == COUNT
    far = Player(agent, VirtualArm(draw_parameters(2), seed=1)).play(goals, durations)
    np.testing.assert_array_equal(far.goal, goals)


def test_goals_near_to_where_each_joint_stands_lie_in_its_own_range(two_joints: ArmParameters) -> None:
    agent = replace(new_agent(2), goal_range=np.array([[150.0, 300.0], [600.0, 850.0]]))
    player = Player(agent, VirtualArm(two_joints, seed=1), 0.05, seed=1)
    near = player.play(*draws(BeginState(), 2), Schedule(60.0, 0.5, 20.0, 0.002))
    low, high = agent.goal_range.T
    assert ((near.goal >= low) & (near.goal <= high)).all()
    assert (np.abs(near.goal - np.clip(near.angle_begin, low, high)) <= 62.0).all()


def test_it_ends_where_the_performance_is_enough() -> None:
    generous = replace(TrainSettings().reward, angle_tolerance=1e4, velocity_tolerance=1e4)
    player = Player(new_agent(reward=generous), VirtualArm(seed=1), 0.05)
    played = player.play(*draws(BeginState()), Schedule(np.inf, 0.1, 1.0, 0.5, enough=0.9))
    assert played.n == 4  # 1 - 0.5^4 is the first above 0.9
    assert player.performance == 1 - 0.5**4
    assert (played.actions == 1).all()


def test_visits_are_begin_states() -> None:
    agent, (goals, durations) = new_agent(), draws(BeginState())
    quiet = [VirtualArm(seed=3) for _ in range(2)]
    angle, pressure = Player(agent, quiet[0]).visit(durations)
    assert angle.shape == (COUNT, 1)
    assert pressure.shape == (COUNT, 1, 2)
    played = Player(agent, quiet[1]).play(goals[:1], durations[:1])
    assert played.angle_begin[0] == angle[0]


def test_arms_that_do_not_fit_are_refused() -> None:
    arm = VirtualArm()
    arm.spec = replace(arm.spec, angle_limits=(100.0, 900.0))
    with pytest.raises(UnusableInput, match="without limits of the angle"):
        Player(new_agent(), arm)
