"""The table of baselines: a killed run goes on after its last whole row, and the table is made of the rows alone."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.baselines import METHODS, Wanted, append, each, place_of, read_rows
from benchmarks.baselines.table import (
    and_adapted,
    below,
    bound_of,
    by_method,
    curves,
    floor,
    line,
    pooled,
    write_page,
)

from pneumarm.errors import UnusableInput
from pneumarm.statistics import summarise

WANTED = Wanted(movements=40, tests=300, steps=1_000, planned=40, adapting=0, minutes=0)
LEVELS = {"open loop": 40, "planning": 39, "policy": 38, "ppo": 35}


def row(arm: int, method: str, seed: int = 0) -> dict:
    random = np.random.default_rng([arm, len(method), seed])
    switches = random.integers(0, 3, WANTED.movements)
    actions = 51 - LEVELS[method] + seed + random.integers(0, 4, WANTED.movements)
    reward = 51 - actions - 8 * switches
    trained = method in ("policy", "ppo")
    return {
        "arm": arm, "method": method, "seed": seed, "wanted": vars(WANTED),
        "wall": 3.0 * trained, "cpu": 5.0 * trained,
        "curve": [[50_000, 6.0, 20.0 + seed], [100_000, 12.0, 30.0]] if method == "ppo" else [],
        "simulation": summarise(reward, reward > -1000, actions, switches) if trained else None,
        "reward": reward.tolist(), "success": [1] * len(reward), "actions": actions.tolist(),
        "switches": switches.tolist(), "p99_ms": 0.5, "memory_mb": 300.0,
    }  # fmt: skip


ROWS = [row(arm, method, seed) for arm in (1, 2) for method in LEVELS for seed in range(2 if method == "ppo" else 1)]


def test_recordings_of_an_arm_lie_apart(tmp_path: Path) -> None:
    assert place_of(tmp_path, 0) == tmp_path
    assert place_of(tmp_path, 2) == place_of(tmp_path, 2) == tmp_path / "recording-2"
    assert (tmp_path / "recording-2").is_dir()


def test_rows_come_back_and_one_that_was_cut_short_is_measured_again(tmp_path: Path) -> None:
    file = tmp_path / "baselines.jsonl"
    assert read_rows(file, WANTED) == {}
    append(file, ROWS[0])
    with open(file, "a") as opened:
        opened.write(json.dumps(ROWS[1])[:100])  # killed here
    assert list(read_rows(file, WANTED)) == [(1, "open loop", 0)]
    append(file, ROWS[1])
    assert read_rows(file, WANTED) == {(r["arm"], r["method"], r["seed"]): r for r in ROWS[:2]}
    assert read_rows(file, replace(WANTED, movements=41)) == {}


def test_methods_are_asked_for_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PNEUMARM_BASELINES_SEEDS", "4")
    assert dict(each("open loop, planning,policy,dqn:1")) == {"open loop": 1, "planning": 1, "policy": 4, "dqn": 1}
    assert list(dict(each(",".join(METHODS)))) == list(METHODS)
    with pytest.raises(UnusableInput, match="there are open loop"):
        list(each("magic"))


def test_the_distance_is_paired_by_arm_and_movement() -> None:
    found = by_method(ROWS)
    lost = below(found["ppo"], found["open loop"])
    assert lost is not None
    expected = [
        np.subtract(row(arm, "open loop")["reward"], row(arm, "ppo", s)["reward"]) for arm in (1, 2) for s in (0, 1)
    ]
    np.testing.assert_array_equal(lost, np.concatenate(expected))
    assert below(found["ppo"], found["open loop"][:1]) is None
    few = [one | {"reward": one["reward"][:5]} for one in found["open loop"]]
    np.testing.assert_array_equal(below(found["planning"], few)[:5], lost_by_planning(5))


def lost_by_planning(movements: int) -> np.ndarray:
    return np.subtract(row(1, "open loop")["reward"], row(1, "planning")["reward"])[:movements]


def test_the_bound_of_an_arm_is_the_better_planner() -> None:
    lower = [one | {"method": "closed loop", "reward": [20.0] * 40} for one in ROWS if one["method"] == "open loop"]
    lower[1]["reward"] = [60.0] * 40
    best = bound_of(by_method(ROWS + lower))
    assert [(one["arm"], one["method"]) for one in best] == [(1, "open loop"), (2, "closed loop")]


def test_what_an_agent_does_after_it_has_adapted_is_a_row_of_its_own() -> None:
    first = row(1, "policy") | {"adapted": None}
    assert and_adapted(first) == [first]
    later = {name: [1.0] * 40 for name in ("reward", "success", "actions", "switches")}
    before, after = and_adapted(first | {"adapted": later})
    assert before["reward"] == first["reward"]
    assert (after["method"], after["reward"], after["arm"]) == ("policy adapted", [1.0] * 40, 1)


def test_the_table_tells_every_method_and_the_floor() -> None:
    assert all(one["method"] in line(one) and f"{np.mean(one['reward']):.2f}" in line(one) for one in ROWS)
    lines = list(pooled(ROWS))
    assert len(lines) == len(LEVELS)
    bound = np.mean([r["reward"] for r in ROWS if r["method"] == "open loop"])
    policy = np.mean([r["reward"] for r in ROWS if r["method"] == "policy"])
    assert f"below the bound {bound - policy:.2f}" in next(text for text in lines if "policy" in text)
    for arm, text in zip((1, 2), floor(ROWS), strict=True):
        best = max(np.mean(row(arm, "ppo", seed)["reward"]) for seed in (0, 1))
        gain = np.mean(row(arm, "policy")["reward"]) - best
        told = re.match(rf"arm {arm}: policy above the best of 2 of PPO by (\S+) \(", text)
        assert told is not None
        assert float(told[1]) == pytest.approx(gain, abs=0.0051)


def test_the_curve_is_the_mean_of_the_agents() -> None:
    assert list(curves(ROWS)) == [
        "ppo while learning: reward (steps, processor time) 20.5 (50k, 6 s), 30.0 (100k, 12 s)"
    ]


def test_the_page_holds_all_arms_and_each(tmp_path: Path) -> None:
    write_page(tmp_path, ROWS)
    text = (tmp_path / "baselines.html").read_text()
    assert all(method in text for method in LEVELS)
    assert all(words in text for words in ("All arms together (2)", "Arm 1", "Arm 2"))
    assert (tmp_path / "baselines.png").read_bytes().startswith(b"\x89PNG")
