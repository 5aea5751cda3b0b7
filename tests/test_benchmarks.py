"""What long benchmarks rely on: rows that outlast a kill, the same movements for all, failures told apart."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks import _environment as environment
from benchmarks import chosen, minutes, success
from benchmarks.__main__ import main
from benchmarks._trials import Rows, collected, greedy_movements, names_of, recorded

from pneumarm.arm.seam import Reading
from pneumarm.arm.virtual import VirtualArm
from pneumarm.errors import UnusableInput
from pneumarm.learning import load_agent
from pneumarm.transitions import CollectSettings, Recorded, Store


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("PNEUMARM_FEW_ARMS", "5-3", "expected seeds such as 1,2,3 or 5000-5009, got '5-3'"),
        ("PNEUMARM_FEW_GOALS", "0", "expected a whole number, 1 or more, got '0'"),
        ("PNEUMARM_FEW_FOLDER", __file__, "expected a folder"),
        ("PNEUMARM_MINUTES_MINUTES", "5,0", "expected numbers above 0 divided by commas, got '5,0'"),
        (
            "PNEUMARM_CHOSEN_WAYS",
            "random,best",
            "expected some of random, chosen, chosen of a kind, divided by commas, got",
        ),
    ],
)
def test_what_the_environment_says_wrong_is_told_in_a_line(
    variable: str,
    value: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(variable, value)
    benchmark = {"FEW": "few_sensors"}.get(variable.split("_")[1], variable.split("_")[1].lower())
    assert main([benchmark]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"pneumarm: {variable}: {said}")
    assert told.count("\n") == 1


def test_only_one_file_reads_the_environment() -> None:
    """What comes from it is checked there, and what is wrong is told in a line."""
    folder = Path(environment.__file__).parent
    reading = [file for file in folder.rglob("*.py") if re.search(r"\bos\.(environ|getenv)", file.read_text())]
    assert reading == [Path(environment.__file__)]


def test_a_folder_is_kept_where_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with environment.kept_folder("PNEUMARM_KEPT") as folder:
        assert folder.is_dir()
    assert not folder.exists()
    monkeypatch.setenv("PNEUMARM_KEPT", str(tmp_path / "a" / "b"))
    with environment.kept_folder("PNEUMARM_KEPT") as folder:
        assert folder == tmp_path / "a" / "b"
    assert folder.is_dir()


def test_a_benchmark_that_there_is_not_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nonsense"]) == 2
    assert "benchmark 'nonsense': expected one of adaptation, " in capsys.readouterr().err


def test_arms_are_read_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PNEUMARM_ARMS", "3,10-12")
    assert environment.seeds("PNEUMARM_ARMS", "1") == [3, 10, 11, 12]
    assert names_of("7-8", "virtual:wide,seed=") == ["virtual:wide,seed=7", "virtual:wide,seed=8"]
    assert names_of("virtual:seed=3 virtual", "virtual:seed=") == ["virtual:seed=3", "virtual"]
    with pytest.raises(UnusableInput, match="arm 'robot'"):
        names_of("robot", "virtual:seed=")


def test_rows_outlast_a_kill_in_the_middle_of_a_line(tmp_path: Path) -> None:
    rows = Rows(tmp_path / "rows", "arm", "block")
    for block in range(3):
        rows.add({"arm": 1, "block": block, "reward": [block, 1.5]})
    written = (tmp_path / "rows").read_bytes()
    (tmp_path / "rows").write_bytes(written[:-4])
    resumed = Rows(tmp_path / "rows", "arm", "block")
    assert resumed.get(1, 1) == {"arm": 1, "block": 1, "reward": [1, 1.5]}
    assert resumed.get(1, 2) is None
    resumed.add({"arm": 1, "block": 2, "reward": [2, 1.5]})
    assert (tmp_path / "rows").read_bytes() == written
    assert list(Rows(tmp_path / "rows", "arm", "block")) == [json.loads(line) for line in written.splitlines()]


def test_a_row_measured_again_counts_once(tmp_path: Path) -> None:
    rows = Rows(tmp_path / "rows", "arm")
    rows.add({"arm": 1, "reward": 1})
    rows.add({"arm": 1, "reward": 2})
    assert list(Rows(tmp_path / "rows", "arm")) == [{"arm": 1, "reward": 2}]


def test_collecting_ends_with_the_first_sequence_after_the_minutes(tmp_path: Path) -> None:
    transitions, took = collected(tmp_path / "db", arm=3, seed=0, minutes=2.5)
    assert 2.5 <= took < 2.5 + 0.2
    again = collected(tmp_path / "db", arm=3, seed=0, minutes=2.5)  # there is enough already
    assert again == (transitions, took)
    more, longer = collected(tmp_path / "db", arm=3, seed=0, transitions=transitions + 1)
    assert (more, longer > took) == (transitions + 200, True)


def test_what_is_chosen_is_what_simulations_disagree_about(tmp_path: Path) -> None:
    collected(tmp_path / "db", arm=3, seed=0, transitions=2_000)
    with Store.open(tmp_path / "db") as store:
        first, second, third = chosen.quickly_fitted(store)
        chooser = chosen.Chooser(store, CollectSettings(pulses=0.0), seed=0, of_a_kind=False)
        chooser.reset(np.zeros(1))
        middle = store.percentiles().mean(axis=1)
    reading = Reading(0.0, middle, np.full((1, 2), 400.0))
    filling, nothing = np.ones((1, 30, 1, 2)), np.zeros((1, 30, 1, 2))
    pair = [first, second]
    (same,), (little,), (much,) = (
        chosen.disagreement(simulations, sequences, reading)
        for simulations, sequences in (([first, first], filling), (pair, nothing), (pair, filling))
    )
    assert same == 0
    assert 0 < little < much  # muscles that fill for a second burst; nobody has seen it
    candidates = np.array(chooser._candidates)
    assert len(candidates) == chosen.CANDIDATES
    found = chosen.disagreement([first, second, third], candidates, reading)
    taken = np.array([chooser.act(reading) for _ in range(candidates.shape[1])])
    np.testing.assert_array_equal(taken, candidates[found.argmax()])


def test_arms_are_recorded_as_in_a_default_run(tmp_path: Path) -> None:
    how = recorded("virtual:seed=3", tmp_path / "arm.db", 0)
    assert 4_000 <= how["transitions"] <= 20_000
    assert 3 < how["minutes"] < 11
    assert how["refused"] == how["marked"] == 0


@pytest.mark.parametrize(
    ("angle", "goal", "kind"),
    [
        ([500.0] * 30, 540.0, "stands still near the goal"),
        ([500.0] * 30, 700.0, "stands still far from the goal"),
        ([500.0, 560.0] * 15, 530.0, "moves about near the goal"),
        ([500.0, 560.0] * 15, 800.0, "moves about far from the goal"),
    ],
)
def test_failures_are_told_apart_and_counted(angle: list[float], goal: float, kind: str) -> None:
    n, spec = len(angle), VirtualArm().spec
    column, muscles = np.array(angle, np.float64)[:, None], np.zeros((n, 1, 2))
    recorded = Recorded(np.arange(n) / 30, column, muscles, muscles, np.arange(n))
    failed = success.failure(recorded, spec, np.array([goal]), twice=True)
    row = json.loads(json.dumps({"arm": "virtual:seed=7", "task": "reach", "number": 1203, **failed}))
    assert row["kind"] == kind
    assert row["goal"] == pytest.approx([spec.degrees(goal)], abs=0.01)
    lines = list(success.table([row]))
    assert lines[0].split() == [*kind.split(), "1,", "most:", "1", "on", "virtual:seed=7"]
    assert "movement 1203" in lines[-1]
    assert "second try failed" in lines[-1]


def test_movements_of_success_are_made_in_blocks_and_go_on(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = small_run / "agent.safetensors"
    shutil.copy(agent, success.place(tmp_path, "virtual", "reach"))
    for name, value in {
        "ARMS": "virtual",
        "SETTLE": "0",
        "REACH": "3",
        "PROCESSES": "1",
        "FOLDER": str(tmp_path),
    }.items():
        monkeypatch.setenv(f"PNEUMARM_SUCCESS_{name}", value)
    first = list(success.measure())
    kept = (tmp_path / "movements.jsonl").read_bytes()
    assert json.loads(kept)["movements"] == 3
    assert list(success.measure()) == first
    assert (tmp_path / "movements.jsonl").read_bytes() == kept


def test_movements_depend_on_their_numbers_alone(small_run: Path) -> None:
    agent = load_agent(small_run / "agent.safetensors")
    together = greedy_movements(agent, 1, agent.goal_range, range(4), seed=0)
    later = greedy_movements(agent, 1, agent.goal_range, range(2, 4), seed=0)
    for one, other in zip(together[2:], later, strict=True):
        np.testing.assert_array_equal(one.goal, other.goal)
        # from the same inflations; what the muscles did before is felt a little
        np.testing.assert_allclose(one.recorded.angle[0], other.recorded.angle[0], atol=25)
    assert len({float(one.goal[0]) for one in together}) == 4


def rows_of(rewards: list[float], took: float) -> list[dict[str, Any]]:
    same = {"minutes": took, "asked": took, "movements": 100, "successes": 99}
    return [{**same, "reward": reward} for reward in rewards]


def test_differences_to_the_longest_are_taken_arm_by_arm() -> None:
    longest, short = rows_of([30.0, 40.0, 38.0], 110.0), rows_of([29.0, 38.0, 35.0], 5.0)
    gained = minutes.differences(short, longest)
    np.testing.assert_array_equal(gained, [-1, -2, -3])
    assert minutes.half_width(gained) == pytest.approx(4.302653 / np.sqrt(3), rel=1e-6)  # t of two degrees of freedom
    left, right = minutes.curve([short, longest]).axes
    assert [label.get_text() for label in left.get_xticklabels()] == ["5", "110"]
    np.testing.assert_allclose(right.lines[-1].get_ydata(), [1, 1])  # percent failed


def test_a_run_that_a_benchmark_makes_and_that_is_refused_is_told_in_lines(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PNEUMARM_HELD_OUT_ARMS", "virtual:seed=x")
    assert main(["held_out"]) == 2
    told = capfd.readouterr().err
    assert "Traceback" not in told
    assert told.splitlines()[-1].startswith("pneumarm: the run on virtual:seed=x ended with 2")
