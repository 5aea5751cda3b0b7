"""The bound of an arm: the same begin states and goals for all, and figures that say what they are."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.arm import ArmSpec
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.bound import reaching as bound
from pneumarm.bound.reaching import BoundSettings, known_bound, measure_bound
from pneumarm.cli import main
from pneumarm.errors import UnusableInput
from pneumarm.planning import PlanSettings
from pneumarm.simulation import SimulationArm

GOALS = np.array([[250.0, 780.0]])
FEW = BoundSettings(episodes=8)


@pytest.mark.parametrize(("rate", "transitions"), [(30, 20_000), (60, 40_000), (1, 1_000)])
def test_the_range_of_goals_is_measured_for_as_long_at_any_rate(
    rate: int, transitions: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Asked(Exception):  # noqa: N818 - it is no error
        """For how many transitions."""

    def collect(arm: object, store: object, transitions: int, seed: int, **_: object) -> None:
        raise Asked(transitions)

    monkeypatch.setattr(bound, "collect", collect)
    with pytest.raises(Asked) as asked:
        bound.measured_goal_range(SimpleNamespace(spec=ArmSpec(period=1 / rate)))  # type: ignore[arg-type]
    assert asked.value.args == (transitions,)


@pytest.fixture(scope="module")
def planned():  # type: ignore[no-untyped-def]
    return measure_bound(VirtualArm(draw_parameters(9), name="ninth"), GOALS, FEW, seed=3)


def test_planners_reach_the_same_goals_and_none_beats_the_bound_by_far(planned) -> None:  # type: ignore[no-untyped-def]
    assert list(planned) == ["open_loop", "closed_loop"]
    open_, closed = (planned[baseline].made for baseline in planned)
    np.testing.assert_array_equal(open_.goal, closed.goal)
    assert open_.success.all()
    assert (np.abs(open_.angle_begin - closed.angle_begin) < 60).all()
    for planned_ in planned.values():
        results, made = planned_.results(), planned_.made
        assert results["episodes"] == 8
        assert results["unproven_plans"] == 0
        assert results["reward"] == pytest.approx(np.mean(51 * made.success - made.actions - 8 * made.all_switches))
        assert results["decision_ms"]["p99"] >= results["decision_ms"]["median"] > 0
    assert planned["open_loop"].results()["reward"] > 30
    assert planned["open_loop"].results()["at_most"] == planned["open_loop"].results()["reward"]  # proven
    assert "at_most" not in planned["closed_loop"].results()


def test_the_same_seed_gives_the_same_movements(planned) -> None:  # type: ignore[no-untyped-def]
    again = measure_bound(VirtualArm(draw_parameters(9), name="ninth"), GOALS, FEW, seed=3)
    for baseline in planned:
        assert again[baseline].made.rows() == planned[baseline].made.rows()
    other = measure_bound(VirtualArm(draw_parameters(9)), GOALS, FEW, seed=4)
    assert other["open_loop"].made.rows() != planned["open_loop"].made.rows()


def test_plans_of_two_joints_are_proven_or_it_is_said_what_no_plan_exceeds() -> None:
    goals, arm = np.array([[400.0, 560.0]] * 2), VirtualArm(draw_parameters(2, joints=2))
    at_most = []
    for nodes in (500, 20_000):
        settings = BoundSettings(episodes=4, plan=PlanSettings(nodes=nodes))
        found = measure_bound(arm, goals, settings, seed=3, baselines=("open_loop",))["open_loop"]
        assert found.at_most is not None
        assert (found.at_most >= found.made.reward).all()
        assert (found.at_most > found.made.reward).sum() <= found.unproven
        at_most.append(found.at_most)
    assert (found.made.reward <= at_most[0]).all()  # what more room found is within what less room allowed
    assert (at_most[1] <= at_most[0]).all()
    assert (at_most[1] < at_most[0]).any()


def test_the_arm_that_is_asked_about_is_not_moved() -> None:
    arm = VirtualArm(draw_parameters(9))
    before = arm.get_state()
    calls: list[tuple[float, float]] = []
    settings = BoundSettings(episodes=2, plan=PlanSettings(switches=0, cutoff=20))
    measure_bound(arm, GOALS, settings, progress=lambda done, total: calls.append((done, total)))
    assert arm.get_state() == before
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_command(capsys: pytest.CaptureFixture[str], small_run: Path) -> None:
    simulation = small_run / "simulation.safetensors"
    with pytest.raises(SystemExit) as exit_:
        main(["bound", "--arm", "virtual:seed=3", "--sim", str(simulation), "--episodes", "3", "--json"])
    assert exit_.value.code == 0
    printed = capsys.readouterr()
    result = json.loads(printed.out)
    assert result["arm"] == "virtual:seed=3"
    for baseline in ("open_loop", "closed_loop", "simulated"):
        assert result[baseline]["episodes"] == 3
        assert set(result[baseline]["intervals"]) == {"reward", "success_rate", "actions", "switches"}


def test_the_distance_is_taken_movement_by_movement(planned) -> None:  # type: ignore[no-untyped-def]
    best = planned["open_loop"].made.reward
    lost = np.array([0.0, 3.0, 1.0, 8.0, 0.0])
    assert planned["open_loop"].distance(best[:5] - lost) == {
        "episodes": 5,
        "planned": pytest.approx(best[:5].mean()),
        "reward": 2.4,
        "interval": None,
    }
    more = planned["open_loop"].distance(np.concatenate([best - 1.0, np.zeros(100)]))
    assert (more["episodes"], more["reward"]) == (8, pytest.approx(1.0))
    with pytest.raises(UnusableInput, match="at least 1"):
        planned["open_loop"].distance(np.zeros(0))


def test_a_bound_is_known_of_virtual_arms_only(planned) -> None:  # type: ignore[no-untyped-def]
    arm = VirtualArm(draw_parameters(9), name="ninth")
    rewards = {"before": np.full(20, 10.0), "after": np.full(20, 30.0)}
    known = known_bound(arm, GOALS, rewards, FEW, seed=3)
    for baseline in ("open_loop", "closed_loop"):
        mean = planned[baseline].results()["reward"]
        assert known[baseline]["reward"] == mean
        assert known["distance"]["before"][baseline]["reward"] == pytest.approx(mean - 10)
        assert known["distance"]["after"][baseline]["reward"] == pytest.approx(mean - 30)
    opened = SimulationArm(synthetic_simulation())
    assert "true physics is not known" in known_bound(opened, GOALS, rewards, FEW)["missing"]


def test_only_virtual_arms_have_a_bound(capsys: pytest.CaptureFixture[str], small_run: Path) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(["bound", "--arm", f"simulation:{small_run / 'simulation.safetensors'}"])
    assert exit_.value.code == 2
    assert "virtual arm" in capsys.readouterr().err


@pytest.mark.parametrize("arm", ["virtual:seed=9", "virtual:joints=2,seed=3"])
def test_few_movements_and_several_joints_have_their_table(arm: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Too few have no interval but of the rate of success, and every joint its own switches."""
    with pytest.raises(SystemExit) as exit_:
        main(["bound", "--arm", arm, "--episodes", "2"])
    assert exit_.value.code == 0
    assert capsys.readouterr().out.count("(0.") <= 2  # the rate's, of two planners


def test_settings_are_checked() -> None:
    with pytest.raises(UnusableInput, match="a whole number, 1 or more"):
        BoundSettings(episodes=0)
    with pytest.raises(UnusableInput, match="switches"):
        PlanSettings(switches=-1)
    with pytest.raises(UnusableInput, match="nodes"):
        PlanSettings(nodes=0)
