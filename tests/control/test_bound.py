"""The bound of an arm: the same begin states and goals for all, and figures that say what they are."""

import json
from pathlib import Path

import numpy as np
import pytest

from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.cli import main
from pneumarm.control import BoundSettings, PlanSettings, measure_bound
from pneumarm.errors import UnusableInput

GOALS = np.array([[250.0, 780.0]])
FEW = BoundSettings(episodes=8)


@pytest.fixture(scope="module")
def planned():  # type: ignore[no-untyped-def]
    return measure_bound(VirtualArm(draw_parameters(9), name="ninth"), GOALS, FEW, seed=3)


def test_planners_reach_the_same_goals_and_none_beats_the_bound_by_far(planned) -> None:  # type: ignore[no-untyped-def]
    assert list(planned) == ["open_loop", "closed_loop"]
    open_, closed = (planned[rival].episodes for rival in planned)
    assert [e.goal for e in open_] == [e.goal for e in closed]
    assert all(e.success for e in open_)
    assert all(abs(a.angle_begin[0] - b.angle_begin[0]) < 60 for a, b in zip(open_, closed, strict=True))
    for planned_ in planned.values():
        results = planned_.results()
        assert results["episodes"] == 8
        assert results["unproven_plans"] == 0
        assert results["reward"] == pytest.approx(
            np.mean([51 * e.success - e.actions - 8 * e.switches for e in planned_.episodes])
        )
        assert results["decision_ms"]["p99"] >= results["decision_ms"]["median"] > 0
    assert planned["open_loop"].results()["reward"] > 30


def test_the_same_seed_gives_the_same_movements(planned) -> None:  # type: ignore[no-untyped-def]
    again = measure_bound(VirtualArm(draw_parameters(9), name="ninth"), GOALS, FEW, seed=3)
    for rival in planned:
        assert again[rival].episodes == planned[rival].episodes
    other = measure_bound(VirtualArm(draw_parameters(9)), GOALS, FEW, seed=4)
    assert other["open_loop"].episodes != planned["open_loop"].episodes


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
    for rival in ("open_loop", "closed_loop", "simulated"):
        assert result[rival]["episodes"] == 3
        assert set(result[rival]["intervals"]) == {"reward", "success_rate", "actions", "switches"}


def test_only_virtual_arms_have_a_bound(capsys: pytest.CaptureFixture[str], small_run: Path) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(["bound", "--arm", f"simulation:{small_run / 'simulation.safetensors'}"])
    assert exit_.value.code == 2
    assert "virtual arm" in capsys.readouterr().err


def test_settings_are_checked() -> None:
    with pytest.raises(UnusableInput, match="at least 1"):
        BoundSettings(episodes=0)
    with pytest.raises(UnusableInput, match="switches"):
        PlanSettings(switches=-1)
    with pytest.raises(UnusableInput, match="nodes"):
        PlanSettings(nodes=0)
