"""The filter of guarantees: its function falls along plans, passes what is good, and replaces what leads nowhere."""

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.learning.evolution import EvolutionSettings, EvolvedAgent
from pneumarm.learning.evolution.acting import input_count
from pneumarm.learning.guarantee.actor import GuaranteedActor
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.task.acting import test_acting as moved_step_by_step
from pneumarm.task.environment import environment

QUIET = EvolutionSettings(noise=NoiseSettings(kind="none"), cutoff=60)


def idle_agent() -> EvolvedAgent:
    """Return an agent that keeps its valves closed."""
    simulation = synthetic_simulation()
    genes = input_count(simulation.window, QUIET) + QUIET.hidden
    return EvolvedAgent(simulation, np.zeros(QUIET.hidden * genes, np.float32), QUIET)


def a_state() -> NDArray[np.float32]:
    return synthetic_begin_states(synthetic_simulation()).states[0]


def test_the_distance_falls_by_one_along_the_plan() -> None:
    actor = GuaranteedActor(idle_agent())
    state, goal = a_state(), np.array([600.0])
    actor.begin(state, goal)
    distance, first = actor.distance(state)
    assert 1 < distance < 60
    assert first.shape == (1,)
    assert actor.expected(state, first) <= distance - 0.5
    assert actor.expected(state, np.array([4])) > distance - 0.5, "closed valves lead nowhere"


def test_an_idle_agent_is_brought_to_its_goals() -> None:
    agent = idle_agent()
    env = environment(agent.simulation, synthetic_begin_states(agent.simulation), QUIET)
    alone = moved_step_by_step(agent.actor(), env, 10, (0,))
    filtered = GuaranteedActor(agent)
    guarded = moved_step_by_step(filtered, env, 10, (0,))
    assert alone.success.mean() < 0.5
    assert guarded.success.all()
    assert filtered.replaced > filtered.without
    assert filtered.passed + filtered.replaced + filtered.without == guarded.actions.sum()


class AsTold:
    """What acts as it is told."""

    def __init__(self, actions: NDArray[np.int64]) -> None:
        self.actions = actions

    def begin(self, state: object, goal: object) -> None: ...

    def act(self) -> NDArray[np.int64]:
        return self.actions

    def follow(self, next_state: object) -> None: ...


def test_what_the_plan_would_do_is_passed() -> None:
    told = AsTold(np.array([4]))
    actor = GuaranteedActor(idle_agent(), actor=told)
    state, goal = a_state(), np.array([600.0])
    actor.begin(state, goal)
    _, planned = actor.distance(state)
    told.actions = planned
    np.testing.assert_array_equal(actor.act(), planned)
    assert (actor.passed, actor.replaced, actor.without) == (1, 0, 0)


def test_before_a_movement_it_does_not_act_and_agents_that_settle_are_refused() -> None:
    class Settling(EvolvedAgent):
        settles = True

    agent = idle_agent()
    with pytest.raises(PneumarmError, match="begin an episode"):
        GuaranteedActor(agent).act()
    with pytest.raises(UnusableInput, match="expected an agent that reaches goals"):
        GuaranteedActor(Settling(agent.simulation, agent.policy, agent.settings))
