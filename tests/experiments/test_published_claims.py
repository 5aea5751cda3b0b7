"""The published page of claims: rebuilt from its rows, and in agreement with itself; how its rows are computed."""

import importlib.util
import re
import shutil
from pathlib import Path
from types import ModuleType

import pytest

from pneumarm.experiments.claims import conclusions, judge, running
from pneumarm.experiments.claims.page import PAGE, PICTURES, ROWS, believed, publish
from pneumarm.experiments.claims.running import KINDS, THESIS_LIKE, Sizes, arms_of, kind_of, run
from pneumarm.experiments.experiment import LaboratorySettings
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.row_file import read_trial_rows
from pneumarm.experiments.sweep import ROWS as ROW_FILE
from pneumarm.progress import silent

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SMALL = LaboratorySettings(transitions=2_000, test_episodes=20, max_episodes=20)
NAME = "optimal-settings"


def checker() -> ModuleType:
    """Return the script that checks the page."""
    spec = importlib.util.spec_from_file_location("check_claims", ROOT / "tools" / "check_claims.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("docs")
    shutil.copytree(DOCS / ROWS, folder / ROWS)
    assert publish(folder) == []  # what is to be believed rests on verdicts as they are
    return folder


def test_the_page_is_made_of_its_rows(rebuilt: Path) -> None:
    assert (rebuilt / PAGE).read_text() == (DOCS / PAGE).read_text()
    pictures = {path.name for path in (DOCS / PICTURES).glob("*.svg")}
    assert pictures == {path.name for path in (rebuilt / PICTURES).glob("*.svg")}
    for name in pictures:
        assert (rebuilt / PICTURES / name).read_text() == (DOCS / PICTURES / name).read_text(), name


def test_sentences_numbers_and_pictures_agree() -> None:
    assert list(checker().disagreements(DOCS)) == []


@pytest.mark.parametrize(
    ("file", "pattern", "changed"),
    [
        (PAGE, r"Verdict: cannot be decided\.", "Verdict: holds."),
        (PAGE, r"\| does not hold \|", "| holds |"),
        (PAGE, r"holds above 2.5, refuted below 2.5", "holds above −2.5, refuted below −2.5"),
        (PAGE, r"mean over arms: [\d.]+", "mean over arms: 9"),
        ("claims/fewest-switches.svg", r'class="mean" stroke="#d1602b"', 'class="mean" stroke="#12476b"'),
        ("claims/fewest-switches.svg", r'x1="[\d.]+"( y1="[\d.]+")? x2="[\d.]+"', 'x1="519" y1="12" x2="519.5"'),
    ],
)
def test_the_check_notices_a_change(rebuilt: Path, tmp_path: Path, file: str, pattern: str, changed: str) -> None:
    shutil.copytree(rebuilt, tmp_path / "docs")
    page = tmp_path / "docs" / file
    text, count = re.subn(pattern, changed, page.read_text(), count=1)
    assert count == 1
    page.write_text(text)
    assert list(checker().disagreements(tmp_path / "docs")) != []


def test_all_conclusions_are_on_the_page_and_undecided_ones_say_what_would_decide_them(rebuilt: Path) -> None:
    text = (rebuilt / PAGE).read_text()
    assert len(conclusions()) == 63
    for each in conclusions():
        part = text.split(f'<a id="{each.key}"></a>')[1].split("<a id=")[0]
        assert each.says in part
        if "Verdict: cannot be decided." in part:
            assert "arms would decide" in part or "arms at least" in part


def test_what_is_to_be_believed_is_left_out_where_verdicts_are_others() -> None:
    paragraphs, others = believed(judge({}))
    assert not any("**" in one for one in paragraphs)  # no finding
    assert len(paragraphs) == 2
    assert {other.split(".")[0] for other in others} <= {each.key for each in conclusions()}
    assert any("." in other for other in others)


def test_every_experiment_has_its_turn_and_its_arms() -> None:
    assert sorted(running.ORDER) == sorted(PLACES)
    for name in PLACES:
        for kind in KINDS:
            arms = arms_of(experiment(name), kind, 3)
            assert len(arms) == (3 if kind != "wide" or "joints" not in experiment(name).arms[0] else 0)
            assert {kind_of(arm) for arm in arms} <= {kind}
    assert kind_of("serial:/dev/ttyACM0") == "your own"


@pytest.mark.thorough
def test_a_pilot_goes_on_and_plans_the_full_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm that was interrupted is not published; a second call computes it alone; the plan is never changed."""
    monkeypatch.setattr(running, "ORDER", (NAME,))
    monkeypatch.setattr(running, "FEWEST_ARMS", 2)
    told: list[str] = []
    pilot = Sizes("pilot", (THESIS_LIKE,), 1, settings=SMALL)
    laboratory, rows = tmp_path / "laboratory", tmp_path / "docs" / ROWS
    run(pilot, laboratory, rows, silent, told.append)
    file = laboratory / NAME / ROW_FILE
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:-1]))
    running.publish_rows(laboratory, rows)
    assert {row.arm for row in read_trial_rows(rows / NAME / ROW_FILE)} == {"virtual:seed=1"}
    run(pilot, laboratory, rows, silent, told.append)
    published = read_trial_rows(rows / NAME / ROW_FILE)
    assert {row.arm for row in published} == {"virtual:seed=1", "virtual:seed=2"}
    assert file.read_text().startswith("".join(lines[:-1]))  # what was there is not computed again
    monkeypatch.setattr(running, "_MOST", 3)
    another = tmp_path / "another"  # takes up what is published
    run(pilot._replace(size="full"), another, rows, silent, told.append)
    assert (another / NAME / ROW_FILE).read_text().startswith((laboratory / NAME / ROW_FILE).read_text()[:200])
    assert {row.arm for row in read_trial_rows(rows / NAME / ROW_FILE)} == {f"virtual:seed={n}" for n in (1, 2, 3)}
    assert running.plan(rows) == {NAME: {THESIS_LIKE: 3}}
    assert told == []


@pytest.mark.thorough
def test_no_arm_is_begun_when_the_time_is_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "ORDER", (NAME,))
    monkeypatch.setattr(running, "_HOURS", {"pilot": 1e-9, "full": 1e-9})
    told: list[str] = []
    run(Sizes("pilot", (THESIS_LIKE,), 1, settings=SMALL), tmp_path, tmp_path / ROWS, silent, told.append)
    assert told == [f"{NAME}: its time on {THESIS_LIKE} arms is over, without virtual:seed=2"]
