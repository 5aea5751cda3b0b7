"""The compiled loop on a virtual arm is ``move`` behind the guard with a learning agent, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.arm import BeginState, ControlCycle, guarded
from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_parameters, preset_parameters
from pneumarm.control.agent import AgentController
from pneumarm.control.movement import move
from pneumarm.control.playing import Player
from pneumarm.control.transfer import draw_movement
from pneumarm.errors import UnusableInput
from pneumarm.learning import Agent, Exploration, TrainSettings
from pneumarm.learning.online.learner import OnlineLearner
from pneumarm.learning.online.loop import Schedule
from pneumarm.learning.online.values import draw_networks
from pneumarm.task.movements import joined, of_rows

COUNT = 12
RANGE = np.array([[150.0, 850.0]])


def new_agent(**settings: object) -> Agent:
    simulation = synthetic_simulation()
    chosen = TrainSettings(cutoff=40, **settings)  # type: ignore[arg-type]
    networks = draw_networks(simulation.window, chosen, np.random.default_rng(2))
    spec = VirtualArm().spec
    return Agent(spec, simulation.window, simulation.scaling, RANGE, networks, chosen)


def draws(begin: BeginState) -> tuple[np.ndarray, np.ndarray]:
    """What :func:`draw_movement` and ``reach`` draw for the first movements."""
    drawn = [draw_movement(RANGE, 7, False, i) for i in range(COUNT)]
    return np.array([g for _, g in drawn]), np.array([r.uniform(0.0, begin.inflate, (1, 2)) for r, _ in drawn])


@pytest.mark.parametrize(
    ("parameters", "settings", "begin"),
    [
        (draw_parameters(3), {"method": "sarsa", "learning_rate": 0.1}, BeginState()),
        (draw_parameters(4), {"method": "q-learning", "learning_rate": 0.1, "trace_decay": 0.3}, BeginState()),
        # A supply of 2 bar: the limit of the pressure closes inlets, on the way to begin states too.
        (preset_parameters("C"), {"learning_rate": 0.05}, BeginState(deflate=0.3, inflate=3.0)),
        (draw_parameters(5), {"learning_rate": 0.0}, BeginState()),
    ],
)
def test_it_is_move_bit_for_bit(parameters: ArmParameters, settings: dict[str, object], begin: BeginState) -> None:
    agent, exploration = new_agent(**settings), Exploration(0.2, 5.0)
    rate = agent.settings.learning_rate
    one, other = (VirtualArm(parameters, seed=9) for _ in range(2))
    learning = OnlineLearner(agent, rate, exploration, seed=4)
    cycle, controller = ControlCycle(guarded(one)), AgentController(agent, learning)
    made = []
    for i in range(COUNT):
        random, goal = draw_movement(RANGE, 7, False, i)
        begin.reach(cycle.arm, random)
        made.append(move(cycle, controller, goal, agent.settings.reward, agent.settings.cutoff))
    player = Player(agent, other, rate, exploration, seed=4, begin=begin)
    first, second = (player.play(*(a[part] for a in draws(begin))) for part in (slice(0, 5), slice(5, COUNT)))
    played, expected = joined([first, second]), of_rows(one.row() for one in made)
    for name in played._fields:
        np.testing.assert_array_equal(getattr(played, name), getattr(expected, name), err_msg=name)
    np.testing.assert_array_equal(player.learned.weights(), learning.weights())
    assert other.get_state() == one.get_state()
    assert (rate == 0) == np.array_equal(learning.weights(), agent.weights())
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
