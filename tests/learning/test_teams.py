"""Who acts for several joints: what each agent of a team is paid, worked by hand."""

from typing import Any

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm.valves import to_valves
from pneumarm.errors import UnusableInput
from pneumarm.learning import TrainSettings, test, train
from pneumarm.learning.online.loop import learn, loop_workspace, spread
from pneumarm.learning.online.values import draw_networks, learner, network_shapes, pack, unpack
from pneumarm.transitions.window import Window

WINDOW = Window(2)


def learned(team: Any, reached: bool, paid: tuple[float, float], chosen: tuple[int, ...]) -> list[float]:
    """Return the values after a step in which joint 1 is at its goal and joint 2 is not, all having been 0 before."""
    settings = TrainSettings(team=team, learning_rate=0.1, discount=0.9, return_scale=1.0)
    weights = pack(network_shapes(WINDOW, settings.hidden, team), WINDOW)
    work = learner(weights, settings)
    memory = loop_workspace(work, 2)
    memory.chosen[:] = chosen
    memory.next_values[:] = (5.0, 7.0)[: len(chosen)]
    memory.paid[:] = paid
    memory.there[:] = True, False
    learn(work, memory, reached)
    values = unpack(weights, WINDOW, settings.hidden, team).output_bias
    assert np.count_nonzero(values) == len(chosen)
    return [float(values[agent, choice]) for agent, choice in enumerate(chosen)]


def test_a_common_goal_is_paid_to_all() -> None:
    assert learned("common", False, (-1, -9), (3, 4)) == pytest.approx([0.1 * (-1 + 4.5), 0.1 * (-9 + 6.3)])
    assert learned("common", True, (50, 42), (3, 4)) == pytest.approx([5.0, 4.2])


def test_an_own_goal_is_paid_to_its_agent_and_ends_what_it_looks_ahead_to() -> None:
    assert learned("own", False, (-9, -9), (3, 4)) == pytest.approx([0.1 * (50 - 8), 0.1 * (-9 + 6.3)])
    assert learned("own", True, (50, 42), (3, 4)) == pytest.approx([5.0, 4.2])


def test_one_agent_is_paid_the_goal_once_and_the_switches_of_all() -> None:
    both = (3 + 9 * 4,)
    assert learned("one", False, (-9, -9), both) == pytest.approx([0.1 * (-1 - 16 + 4.5)])
    assert learned("one", True, (42, 42), both) == pytest.approx([0.1 * (50 - 16)])


def test_every_combination_of_actions_is_a_choice_of_one_agent() -> None:
    seen = set()
    for choice in range(9**3):
        actions = np.zeros(3, np.int64)
        spread(np.array([choice]), actions)
        seen.add(tuple(actions))
    assert len(seen) == 9**3
    assert {action for actions in seen for action in actions} == set(range(9))


@pytest.mark.parametrize(("team", "count"), [("common", 3), ("own", 3), ("one", 9)])
def test_an_agent_of_joints_with_one_muscle_never_fills_the_other(team: Any, count: int) -> None:
    networks = draw_networks(WINDOW, TrainSettings(team=team), np.random.default_rng(0), muscles=1)
    for values in networks.output_bias:
        choices = np.flatnonzero(values > -1e3)
        assert len(choices) == count
        for choice in choices:
            actions = np.zeros(2 // len(networks.output_bias), np.int64)
            spread(np.array([choice]), actions)
            assert (to_valves(actions)[:, 1] == 0).all()


@pytest.mark.parametrize("team", ["common", "own", "one"])
def test_a_team_learns_and_is_the_same_again(team: Any) -> None:
    simulation = synthetic_simulation(2)
    begin = synthetic_begin_states(simulation)
    settings = TrainSettings(team=team, agents=1, max_episodes=200, validation_episodes=4, cutoff=20)
    agent = train(simulation, begin, settings, 2).agent
    assert agent.networks.hidden_weights.shape[:2] == ((1, 81) if team == "one" else (2, 9))
    np.testing.assert_array_equal(agent.with_weights(agent.weights()).weights(), agent.weights())
    assert test(agent, simulation, begin, 5).n == 5


def test_other_teams_are_refused() -> None:
    with pytest.raises(UnusableInput, match="team"):
        TrainSettings(team="none")  # type: ignore[arg-type]
