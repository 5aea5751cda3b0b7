"""Whether a recording is enough is judged by what its second half was good for."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneumarm.arm import open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.simulation import FitResult, enough, fit
from pneumarm.simulation.enough import Enough, EnoughSettings, collect_enough, enough_data
from pneumarm.transitions import CollectResult, Store, collect


@pytest.fixture(scope="module")
def grown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("grown") / "arm.db"


def judged(path: Path, transitions: int) -> Enough | None:
    arm = VirtualArm(seed=3)
    with arm, Store.for_arm(path, arm.spec) as store:
        collect(arm, store, transitions, 1)
        return enough_data(store)


def test_five_minutes_are_enough_and_two_cannot_be_judged(grown: Path) -> None:
    """As the README says: what is recorded in the first five minutes is as good as more."""
    assert judged(grown, 2_000) is None
    five = judged(grown, 6_000)
    assert five is not None
    assert five.enough
    assert five.verdict.startswith("enough: ")


def test_both_halves_of_several_joints_are_judged_by_networks_of_one_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    networks = []

    def noted(*given: Any, **options: Any) -> FitResult:
        result = fit(*given, **options)
        networks.append(result.simulation.networks)
        return result

    monkeypatch.setattr(enough, "fit", noted)
    with open_arm("virtual:joints=2,seed=3") as arm, Store.for_arm(tmp_path / "db", arm.spec) as store:
        collect(arm, store, 4_000, 1)
        judged = enough_data(store)
    assert judged is not None
    assert judged.gain > 0  # a minute of two joints is not enough
    assert [len(each) for each in networks] == [1, 1]
    assert all(network.second_weights is not None for each in networks for network in each)


def test_the_verdict_says_what_was_gained() -> None:
    assert Enough(0.3, 0.1).verdict == "collect as much again: the second half lowers the simulation's error by 30%"
    assert Enough(0.04, 0.1).verdict.endswith("lowers the simulation's error by 4%, less than 10%")
    assert Enough(-0.01, 0.1).verdict.endswith("lowers the simulation's error not at all")
    assert not Enough(0.04, 0.1, wider=0.3).enough
    assert "30% of the range of angles" in Enough(0.04, 0.1, wider=0.3).verdict


def test_little_gain_is_not_enough_where_most_of_the_error_is_noise() -> None:
    """A fit to n transitions errs by s^2 (1 + c / n); half of them and all of them tell how much c / n is."""
    noise, networks = 0.6, 0.2
    whole, half = np.hypot(noise, networks), np.hypot(noise, networks * np.sqrt(2))
    judged = Enough(1 - whole / half, whole)
    assert judged.unknown == pytest.approx(networks)
    assert judged.gain < 0.1
    assert not judged.enough
    assert "20%" in judged.verdict


def test_an_interrupted_collecting_ends_at_the_same_place(tmp_path: Path) -> None:
    def ended(name: str, *limits: int) -> dict[str, Any]:
        for limit in (*limits, 10**9):
            with VirtualArm(seed=3) as arm, Store.for_arm(tmp_path / name, arm.spec) as store:

                def record(
                    wanted: int, arm: VirtualArm = arm, store: Store = store, limit: int = limit
                ) -> CollectResult:
                    if wanted > limit:
                        raise InterruptedError
                    return collect(arm, store, wanted, 1)

                with suppress(InterruptedError):
                    found = collect_enough(record, store, EnoughSettings(growth=1.1, most=260))
                    assert store.transitions >= found["transitions"][-1]
        return found

    at_once = ended("at once.db")
    assert at_once["transitions"][0] == 4000
    assert ended("interrupted.db", 4000, 4100) == at_once
    assert ended("interrupted.db") == at_once


def test_it_ends_in_time_however_slow_the_arm_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A person waits by the clock, and slow muscles take most of it between the sequences."""
    monkeypatch.setattr(enough, "enough_data", lambda store: Enough(0.5, 0.5))
    with open_arm("virtual:wide,seed=6008", 0) as arm, Store.for_arm(tmp_path / "slow.db", arm.spec) as store:
        found = collect_enough(lambda wanted: collect(arm, store, wanted, 1), store, EnoughSettings(most=400.0))
        recorded = collect(arm, store, 2_000, 1)
    assert 370 < recorded.seconds < 430
    assert found["transitions"][-1] <= recorded.transitions
    assert "it ended after 7 minutes" in found["verdict"]
    assert found["gain"] == [0.5] * len(found["transitions"])
