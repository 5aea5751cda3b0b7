"""Moving by the inverse simulation alone: what is in a cloud, and that the agent reaches goals of an arm."""

from pathlib import Path

import numpy as np
import pytest

from pneumarm.arm import ArmSpec, open_arm
from pneumarm.arm.valves import CLOSED
from pneumarm.control.named import open_tracking
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.experiments.there_and_back import Recipe, collect_until, greedy_movements
from pneumarm.learning.inverse.agent import InverseActor, InverseAgent
from pneumarm.learning.inverse.cloud import InverseSettings
from pneumarm.transitions import Store

pytest.importorskip("scipy.spatial")
SMALL = InverseSettings(depth=20, width=300)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store = tmp_path_factory.mktemp("inverse") / "arm.db"
    collect_until(store, "virtual:seed=3", 3, Recipe(transitions=20_000))
    return store


@pytest.fixture(scope="module")
def agent(recorded: Path) -> InverseAgent:
    with Store.open(recorded) as store:
        return InverseAgent.of(store, SMALL)


def test_a_cloud_begins_at_its_goal_and_fills_no_cell_twice(agent: InverseAgent) -> None:
    offset, scale = agent.scaling.observation_offset, agent.scaling.observation_scale
    for goal, cloud in zip(agent.goals_of_clouds, agent.clouds, strict=True):
        states = cloud.states.data
        at_goal = cloud.steps == 0
        np.testing.assert_allclose(offset[0] + scale[0] * states[at_goal, 0], goal)
        assert (cloud.actions[at_goal] == CLOSED).all()
        cells = np.floor(states[~at_goal] / SMALL.cell)
        assert len(np.unique(cells, axis=0)) == len(cells)
        assert np.bincount(cloud.steps).max() <= SMALL.width
        assert cloud.steps.max() > 5


def test_states_farther_back_are_farther_away(agent: InverseAgent) -> None:
    cloud, goal = agent.clouds[len(agent.clouds) // 2], agent.goals_of_clouds[len(agent.clouds) // 2]
    aim = (goal - agent.scaling.observation_offset[0]) / agent.scaling.observation_scale[0]
    distance = np.abs(cloud.states.data[:, 0] - aim)
    means = [distance[cloud.steps == step].mean() for step in (1, 3, 6)]
    assert means == sorted(means)


def test_it_reaches_goals_of_its_arm(agent: InverseAgent) -> None:
    with open_arm("virtual:seed=3", 0) as arm:
        made = greedy_movements(agent, arm, agent.goal_range, range(40), 0, None)
    assert np.mean([one.success for one in made]) > 0.7


def test_its_actor_shifts_the_cloud_to_the_goal(agent: InverseAgent) -> None:
    cloud, goal = agent.clouds[1], agent.goals_of_clouds[1]
    place = int(np.flatnonzero(cloud.steps == 3)[0])
    state = cloud.states.data[place].copy()
    actor = InverseActor(agent)
    with pytest.raises(PneumarmError, match="begin an episode"):
        actor.act()
    actor.begin(state, np.array([goal]))
    chosen = actor.act()
    state[0] += 5.0 / agent.scaling.observation_scale[0]
    actor.begin(state, np.array([goal + 5.0]))
    np.testing.assert_array_equal(actor.act(), chosen)


def test_it_is_a_controller_by_the_name_of_its_store(recorded: Path, tmp_path: Path) -> None:
    with open_arm("virtual:seed=3", 0) as arm:
        controller, spec, goals = open_tracking(f"inverse:{recorded}", arm)
        assert spec.joints == 1
        controller.reset(goals.range.mean(axis=1))
    two = tmp_path / "two.db"
    Store.create(two, ArmSpec(joints=2, name="two")).close()
    with open_arm("virtual:joints=2", 0) as arm, pytest.raises(UnusableInput, match="expected an arm of one joint"):
        open_tracking(f"inverse:{two}", arm)
