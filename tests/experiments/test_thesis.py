"""The thesis' own tables: its rankings, its derivation, its slips, and what its tables agree on."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from pneumarm.cli import main
from pneumarm.experiments import design as design_
from pneumarm.experiments.design import analyse_table, thesis_design
from pneumarm.experiments.design.table import packaged_table
from pneumarm.experiments.errata import ERRATA, Erratum, implied_success, page

# Thesis tables 5.6 and 5.9.
MEAN, STD = (4, 12, 2, 5, 6, 1, 8, 11), (4, 8, 2, 6, 12, 13, 1, 15)
MEAN_OF_GAIN, STD_OF_GAIN = (11, 14, 7, 10, 4, 9, 1), (4, 10, 13, 3, 6, 9, 15)


def thesis(experiment: str, name: str) -> np.ndarray:
    return packaged_table(f"pneumarm.experiments.{experiment}", f"thesis_{name}")


def test_the_rankings_of_table_5_6() -> None:
    found = analyse_table(thesis_design(), thesis("all_goals", "reward")).effects
    assert found["mean"].ranking[:8] == MEAN
    assert found["std"].ranking[:8] == STD


def test_the_rankings_of_table_5_9() -> None:
    found = analyse_table(thesis_design(), thesis("long_training", "gain")).effects
    assert found["mean"].ranking[:7] == MEAN_OF_GAIN
    assert found["std"].ranking[:7] == STD_OF_GAIN


def test_the_rule_of_the_thesis_leads_to_trial_10() -> None:
    best = analyse_table(thesis_design(), thesis("all_goals", "reward")).best
    assert best.settings == {"a": 0.10, "b": 5, "c": "sarsa", "d": 0.0, "e": 0.98}
    assert best.trial == 10
    # The order of section 5.4.2: SARSA, gamma by column 8, 5 neurons, the learning rate by column 5, traces.
    assert [(step.factor, step.column) for step in best.steps[:4]] == [("c", 4), ("e", 8), ("b", 2), ("a", 5)]
    assert best.steps[4].factor == "d"


def test_both_settings_are_confirmed() -> None:
    """Table C.14 confirms the printed settings; trial 10 itself lies above what the larger effects predict."""
    analysis = analyse_table(thesis_design(), thesis("all_goals", "reward"))
    printed = {**analysis.best.settings, "a": 0.05}
    observed = thesis("optimal_settings", "reward")[0]
    found = analysis.confirm(observed, printed)
    assert found.confirmed
    assert found.observed == pytest.approx(6.69, abs=0.005)
    trial_10 = analysis.confirm(analysis.results[9])
    assert trial_10.confirmed
    assert trial_10.predicted > found.predicted
    assert trial_10.observed == pytest.approx(10.18, abs=0.005)


@pytest.mark.parametrize("erratum", ERRATA, ids=lambda erratum: erratum.place)
def test_errata_are_shown_by_the_numbers(erratum: Erratum) -> None:
    shown, evidence = erratum.evidence()
    assert shown
    assert evidence


def test_the_page_of_errata_is_up_to_date() -> None:
    file = Path(__file__).parents[2] / "docs" / "errata.md"
    assert file.read_text(encoding="utf-8") == page()


def test_the_tables_agree_with_our_reward() -> None:
    """No implied success rate is above 1 but for rounding: two decimals of three numbers, 0.05 / 51 at most."""
    for name, rates in implied_success().items():
        assert rates.max() < 1 + 0.05 / 51 + 1e-9, name
        assert np.median(rates) > 0.997


def test_gains_are_differences_of_the_tables() -> None:
    """Table C.11 against C.7: all 48, up to the rounding of three numbers."""
    difference = thesis("long_training", "reward") - thesis("all_goals", "reward")[:, :3]
    np.testing.assert_allclose(difference, thesis("long_training", "gain"), atol=0.015 + 1e-9)


def write(path: Path, results: np.ndarray, heading: str = "run") -> Path:
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["trial", *(f"{heading} {run + 1}" for run in range(results.shape[1]))])
        rows.writerows([[trial, *values] for trial, values in enumerate(results, 1)])
    return path


def analysed(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    with pytest.raises(SystemExit) as ended:
        main(["taguchi", "analyse", *map(str, arguments), "--json"])
    assert ended.value.code == 0
    (line,) = capsys.readouterr().out.splitlines()
    return json.loads(line)


def test_the_command_gives_the_rankings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = write(tmp_path / "c_7.csv", thesis("all_goals", "reward"))
    confirmation = write(tmp_path / "c_14.csv", thesis("optimal_settings", "reward"))
    found = analysed(capsys, table, "--confirmation", confirmation, "--out", tmp_path / "page")
    assert tuple(found["ranking"]["mean"][:8]) == MEAN
    assert tuple(found["ranking"]["std"][:8]) == STD
    assert found["best"]["trial"] == 10
    assert found["confirmation"]["observed"] == pytest.approx(6.69)
    page_ = (tmp_path / "page" / "page.html").read_text()
    assert page_.count("data:image/svg") == 5
    # Nobody said what was varied, so nobody is told what is best.
    assert "Best settings" not in page_
    assert "as thesis" not in page_


def said_of(capsys: pytest.CaptureFixture[str], code: int, *arguments: object) -> str:
    with pytest.raises(SystemExit) as ended:
        main(["taguchi", "analyse", *map(str, arguments)])
    assert ended.value.code == code
    return "".join(capsys.readouterr())


def test_best_settings_are_told_of_a_design(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = write(tmp_path / "c_7.csv", thesis("all_goals", "reward"))
    confirmation = ("--confirmation", write(tmp_path / "c_14.csv", thesis("optimal_settings", "reward")))
    alone = said_of(capsys, 0, table)
    assert "Best settings" not in alone
    assert "--design FILE" in alone
    assert "no best settings to confirm" in said_of(capsys, 2, table, *confirmation)
    design = ("--design", Path(design_.__file__).with_name("design.toml"), "--out", tmp_path / "page")
    named = said_of(capsys, 0, table, *confirmation, *design)
    assert "Best settings by rank: learning rate 0.1, number of neurons 5" in named
    assert "6.69 was found: " in named
    page_ = (tmp_path / "page" / "page.html").read_text()
    assert "Trial 10 has them" in page_
    assert ">Best settings<" in page_
    assert "as thesis" not in page_


def test_the_design_in_the_docs_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page_ = (Path(__file__).parents[2] / "docs" / "how-to" / "experiments.md").read_text()
    (text,) = re.findall(r"```toml\n(.*?)```", page_, re.S)
    design = tmp_path / "design.toml"
    design.write_text(text)
    found = analysed(capsys, write(tmp_path / "table.csv", np.arange(16.0).reshape(8, 2)), "--design", design)
    assert set(found["best"]["settings"]) == {"s", "h", "p"}


def test_columns_can_be_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As in table C.11, where rewards and their changes alternate."""
    reward, gain = thesis("long_training", "reward"), thesis("long_training", "gain")
    both = np.stack([reward, gain], axis=2).reshape(16, 6)
    table = write(tmp_path / "c_11.csv", both)
    header = "trial,run 1,delta run 1,run 2,delta run 2,run 3,delta run 3"
    table.write_text("\n".join([header, *table.read_text().splitlines()[1:]]))
    found = analysed(capsys, table, "--columns", "delta run")
    assert tuple(found["ranking"]["mean"][:7]) == MEAN_OF_GAIN
    rewards = analysed(capsys, table)
    alone = analysed(capsys, write(tmp_path / "reward.csv", reward))
    assert rewards["ranking"] == alone["ranking"]


def test_another_design(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Any array with any factors: nine trials of two factors of three levels, one run."""
    design = tmp_path / "design.toml"
    design.write_text(
        'array = "L9"\n'
        '[[factors]]\nlabel = "p"\nname = "pressure"\nlevels = [1, 2, 3]\n'
        '[[factors]]\nlabel = "q"\nname = "load"\nlevels = ["none", "half", "full"]\n'
    )
    table = tmp_path / "table.csv"
    table.write_text("trial,error\n" + "".join(f"{t + 1},{10 + (t // 3) * 2 + abs(t % 3 - 1)}\n" for t in range(9)))
    found = analysed(capsys, table, "--design", design, "--goal", "smaller")
    assert found["ranking"]["mean"][:2] == [1, 2]
    assert "std" not in found["ranking"]
    assert found["best"]["settings"] == {"p": 1, "q": "half"}
    assert found["columns"] == {"1": "p", "2": "q", "3": "pq", "4": "pq"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected a table"),
        ("trial,run 1\n", "it has 1 lines"),
        ("trial;run 1\n1;2\n", "separated by commas; it has 2 lines, the first 'trial;run 1'"),
        ("trial,run 1\n1,x\n", "line 2"),
        ("trial,run 1\n1,1\n1,2\n", "trial 1 is there twice"),
        ("trial,run 1\n1,1\n3,2\n", "expected the trials 1 to 2"),
        ("trial,run 1\n1,1,2\n", "expected 2 cells"),
        ("trial,run 1\n1,nan\n", "finite"),
        ("trial,run 1\n1,1\n2,2\n", "L16 needs 16 trials"),
    ],
)
def test_what_is_no_table_is_refused(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "table.csv"
    table.write_text(text)
    with pytest.raises(SystemExit) as ended:
        main(["taguchi", "analyse", str(table), "--json"])
    out, err = capsys.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
