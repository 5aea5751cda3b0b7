"""Experiments of one's own, from a file: their trials, their settings, and one from the arm to its page."""

import json
from pathlib import Path

import numpy as np
import pytest

from pneumarm.cli import main
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import LaboratorySettings
from pneumarm.experiments.own_design import OwnDesign, full_array, load_own_design
from pneumarm.experiments.preparation import claim

EXAMPLE = Path(__file__).parents[2] / "examples" / "design.toml"
SMALL = """
title = "Small"
method = "sarsa"
runs = 1

[train]
agents = 1
max_episodes = 500
validation_episodes = 10

[fit]
epochs = 3
hidden = 4

[[factors]]
label = "a"
name = "discount factor"
levels = [0.95, 0.98]
setting = "train.discount"

[[factors]]
label = "b"
name = "n of the filter"
levels = [1, 5]
setting = "fit.grid.per_cell"
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "small.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(("counts", "columns"), [((2, 2, 2), (1, 2, 4)), ((3, 3), (1, 2)), ((2, 3, 4), (1, 2, 3))])
def test_in_full_every_combination_is_a_trial(counts: tuple[int, ...], columns: tuple[int, ...]) -> None:
    array, placed = full_array(counts)
    assert placed == columns
    factors = array.levels[:, np.array(placed) - 1]
    assert array.trials == np.prod(counts) == len({tuple(row) for row in factors.tolist()})
    assert tuple(factors.max(axis=0) + 1) == counts
    if counts == (2, 2, 2):
        assert array.interaction(1, 2) == (3,)


def test_too_many_combinations_are_refused() -> None:
    with pytest.raises(UnusableInput, match="2,048 combinations"):
        full_array((2,) * 11)


def test_levels_reach_the_training_the_fit_and_the_recording() -> None:
    made = load_own_design(EXAMPLE)
    assert (made.name, made.method, len(made.trials)) == ("design", "sarsa-lambda", 8)
    settings = LaboratorySettings()
    for trial in made.trials:
        level = made.design.settings(trial)
        train, recipe = made.train_settings(trial), made.recipe(trial, settings)
        assert (train.cutoff, train.policy, train.max_episodes) == (level["a"], level["b"], 20_000)
        assert (recipe.fit.hidden, recipe.fit.epochs) == (level["c"], level["d"])
        assert recipe.fit.grid.per_cell == level["e"]
    assert len({json.dumps(one, sort_keys=True) for one in made.settings()["trials"].values()}) == 8


def test_the_frequency_can_be_a_factor(tmp_path: Path) -> None:
    text = SMALL.replace("fit.grid.per_cell", "arm.frequency").replace("[1, 5]", "[20.0, 30.0]")
    made = load_own_design(written(tmp_path, text))
    assert [made.recipe(trial, LaboratorySettings()).frequency for trial in made.trials] == [20.0, 30.0] * 2


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("train.discount", "discount", "expected a setting of train, fit, arm"),
        ("train.discount", "train.nothing", "TrainSettings has no setting 'nothing'"),
        ("0.98", "1.5", "discount"),
        ("hidden = 4", "neurons = 4", "FitSettings has no setting 'neurons'"),
        ('method = "sarsa"', 'method = "dqn"', "method 'dqn'"),
        ('method = "sarsa"', 'method = "servo"', "its agents settle"),
        ('title = "Small"', "", "title"),
    ],
)
def test_what_is_no_design_is_refused_with_its_file(tmp_path: Path, old: str, new: str, expected: str) -> None:
    file = written(tmp_path, SMALL.replace(old, new))
    with pytest.raises(UnusableInput, match=expected) as refused:
        load_own_design(file)
    assert str(file) in str(refused.value)


def test_one_from_the_arm_to_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = written(tmp_path, SMALL), tmp_path / "laboratory"
    command = ["experiment", "--design", str(file), "--arms", "virtual:seed=3", "--out", str(out)]
    sizes = ["--transitions", "2400", "--test-episodes", "10", "--json"]

    def done() -> dict:
        with pytest.raises(SystemExit) as ended:
            main([*command, *sizes])
        assert ended.value.code == 0
        return json.loads(capsys.readouterr().out)

    first = done()
    assert (first["experiment"], first["rows"], first["computed"]) == ("small", 4, 4)
    assert {"reward", "success_rate", "actions", "switches", "episodes"} <= first["ours"].keys()
    page = Path(first["page"]).read_text()
    assert "discount factor" in page
    assert "n of the filter" in page
    assert done()["computed"] == 0
    file.write_text(SMALL.replace("0.98", "0.99"))
    with pytest.raises(SystemExit) as ended:
        main([*command, *sizes])
    assert ended.value.code == 2
    assert "other settings" in capsys.readouterr().err


def test_a_name_or_a_design_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["all-goals", "--design", str(EXAMPLE)]):
        with pytest.raises(SystemExit) as ended:
            main(["experiment", *arguments])
        assert ended.value.code == 2
        assert "--design FILE.toml" in capsys.readouterr().err


def test_laboratories_of_before_are_gone_on_with(tmp_path: Path) -> None:
    """Settings that came later and are as usual are not told apart; others are."""
    made = load_own_design(written(tmp_path, SMALL))
    assert isinstance(made, OwnDesign)
    wanted = made.settings()["trials"]["2"]
    before = json.loads(json.dumps(wanted))
    del before["train"]["help"], before["train"]["goal"], before["train"]["noise"]["share"]
    del before["train"]["shaping"]["sides"], before["train"]["shaping"]["each"], before["fit"]["grid"]
    claim(tmp_path / "lab", before)
    claim(tmp_path / "lab", wanted)
    with pytest.raises(UnusableInput, match="grid"):
        claim(tmp_path / "lab", made.settings()["trials"]["1"])
