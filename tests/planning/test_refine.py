"""Movements made better command by command, in any world, and the bound of settling and tracking made with it."""

import json
from pathlib import Path

import numpy as np
import pytest

from learning.synthetic_arm import synthetic_simulation
from pneumarm.arm.virtual import VirtualArm, draw_parameters, without_noise
from pneumarm.arm.virtual.rollout import capture, physics_of, physics_states
from pneumarm.bound.moving import WAYS, MovingBoundSettings, _settling, measure_moving_bound
from pneumarm.cli import main
from pneumarm.learning.servo import ServoAgent, ServoSettings
from pneumarm.learning.servo.task import servo_sizes
from pneumarm.moving.movement import MoveSettings
from pneumarm.moving.settling import settled_at
from pneumarm.networks.layers import initial_weights
from pneumarm.planning import refine
from pneumarm.planning.refine import Wanted, refined
from pneumarm.task.price import PriceParameters

STEPS = 20
PRICES = PriceParameters(precision=0.3, far=0.06, flat=0.1, change=0.0)
SMALL = ServoSettings(hidden=(8, 8))
FEW = MovingBoundSettings(goals=2, hold=1.0, frequencies=(1.0,), seconds=1.0, sweeps=1)


@pytest.fixture(scope="module")
def agent() -> ServoAgent:
    simulation = synthetic_simulation(1, 3)
    weights = initial_weights(servo_sizes(simulation, SMALL), 1.0, np.random.default_rng(0))
    return ServoAgent(simulation, weights, SMALL)


def test_a_movement_gets_better_and_the_arm_moves_as_planned() -> None:
    with VirtualArm(without_noise(draw_parameters(9)), seed=1) as arm:
        arm.wait(1.0)
        world = physics_of(arm)
        states = physics_states(world, STEPS + 2)
        capture(arm, world, states, 0)
        goal = states.angle[0] + 100
        wanted = Wanted(np.tile(goal, (STEPS, 1)), np.full(1, 11.378), PRICES, 0.09, 1 / 30)
        plan = refined(world, states, wanted, np.zeros((STEPS, 1, 2)), 2, np.random.default_rng(0))
        planned, begin = states.angle[1 : STEPS + 1].copy(), arm.time
        for step, command in enumerate(plan):
            arm.wait(arm.spec.latency)
            arm.set_pulses(command)
            arm.wait_until(begin + (step + 1) * arm.spec.period)
            assert arm.read().angle == pytest.approx(planned[step], abs=1.0)
    assert np.abs(planned[-5:] - goal).max() < 25
    assert (np.abs(plan) <= 1).all()
    assert not ((np.abs(plan) > 0) & (np.abs(plan) < 0.09)).any(), "the valve can be no faster"


@pytest.mark.parametrize(("period", "widest"), [(1 / 30, 4), (1 / 60, 8), (0.5, 1)])
def test_as_long_a_part_of_a_movement_is_changed_at_any_rate(
    period: float, widest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    widths: list[int] = []
    monkeypatch.setattr(refine, "keep_states", lambda *_: None)
    monkeypatch.setattr(refine, "best_change", lambda *given: widths.append(given[5].shape[1]))
    wanted = Wanted(np.zeros((200, 1)), np.ones(1), PRICES, 0.09, period)
    refined(None, None, wanted, np.zeros((200, 1, 2)), 1, np.random.default_rng(0))
    assert max(widths) == widest


def test_the_bound_takes_for_settled_what_a_move_does() -> None:
    """Readings that scatter at the goal are no reason to have left it; to pass it at the end is not to settle."""
    period = 1 / 30
    noise = np.random.default_rng(1).normal(0, 0.5, (60, 1))
    coming = 20 * np.maximum(1 - np.arange(60) / 12, 0.0)[:, None]
    passing = np.where(np.arange(60) < 55, 4.0, 0.3)[:, None]
    found = _settling([coming + noise, passing], period, 30, 1.0)
    assert found["settled"] == 0.5
    assert found["median_seconds"] == settled_at(
        period * np.arange(1, 61), coming + noise, MoveSettings.tolerance, MoveSettings.dwell
    )
    assert found["median_seconds"] == pytest.approx(12 * period, abs=0.1)


def test_five_ways_have_figures_and_a_better_plan_is_not_worse(agent: ServoAgent) -> None:
    calls: list[float] = []
    with VirtualArm(draw_parameters(9)) as arm:
        found = measure_moving_bound(arm, agent, FEW, seed=1, progress=lambda done, total: calls.append(done / total))
    assert set(found["settle"]) == set(found["track"]) == set(WAYS)
    assert found["track"]["physics"]["1"] < found["track"]["quiet"]["1"]
    assert found["track"]["simulated"]["1"] < found["track"]["simulation"]["1"]
    assert calls == sorted(calls)
    assert calls[-1] == 1.0


def test_the_command_says_what_parts_an_agent_from_its_arm(
    agent: ServoAgent, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "arm.agent"
    agent.save(file)
    few = ["--moving.goals", "1", "--moving.hold", "1", "--moving.seconds", "1", "--moving.sweeps", "1"]
    with pytest.raises(SystemExit) as ended:
        main(["bound", "--arm", "virtual:seed=3", "--agent", str(file), *few, "--json"])
    assert ended.value.code == 0
    assert set(json.loads(capsys.readouterr().out)["moving"]["settle"]) == set(WAYS)
