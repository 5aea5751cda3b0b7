"""Mutants: the list names what is there, and a change that no test notices is found, told of and not forgotten."""

import json
import re
import tomllib
from collections import Counter
from pathlib import Path

import pytest

import mutate

MANY = {"guard", "cycle", "store", "link", "firmware", "live", "task", "servo", "monitor"}
"""Safety, data or truth depend on these."""


def test_the_list_names_what_is_there() -> None:
    mutants = mutate.read_list(mutate.ROOT)  # each snippet is found once, each test is there
    counts = Counter(mutant.package for mutant in mutants)
    assert min(counts[package] for package in MANY) >= 5
    assert len(mutants) >= 80
    assert {mutant.folder for mutant in mutants} == mutate.folders(mutate.ROOT)
    assert len(mutate.folders(mutate.ROOT)) >= 20


def test_quick_tests_are_those_of_make_test() -> None:
    (line,) = re.findall(r"^test:.*\n\t(.*)$", (mutate.ROOT / "Makefile").read_text(), re.M)
    assert line.endswith(f" -m '{mutate.QUICK}'")


ENTRY = """
[[mutant]]
name = "{name}"
package = "sum"
file = "src/total.py"
snippet = "{snippet}"
replacement = "{replacement}"
tests = ["tests/test_total.py::{test}"]
"""
SOURCE = "def total(a, b):\n    return a + b\n\n\ndef twice(a):\n    return 2 * a\n"
TESTS = """
import pytest
from total import total, twice

def test_total():
    assert total(2, 2) == 4

def test_twice():
    assert twice(0) == 0

@pytest.mark.skip(reason="no tools")
def test_with_tools():
    assert total(2, 1) == 3

def test_that_fails_anyway():
    assert total(1, 1) == 3

@pytest.mark.thorough
def test_thoroughly():
    assert total(2, 1) == 3

@pytest.mark.parametrize("a", [0, pytest.param(2, marks=pytest.mark.thorough)])
def test_some(a):
    assert total(1, a) == 1 + a
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for folder in ("src", "tests", "firmware"):
        (tmp_path / folder).mkdir()
    (tmp_path / "src" / "total.py").write_text(SOURCE)
    (tmp_path / "tests" / "test_total.py").write_text(TESTS)
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    return tmp_path


def listed(project: Path, *entries: tuple[str, str, str, str]) -> None:
    keys = ("name", "snippet", "replacement", "test")
    text = "".join(ENTRY.format(**dict(zip(keys, entry, strict=True))) for entry in entries)
    (project / mutate.LIST).write_text(text)


KILLED = ("minus", "a + b", "a - b", "test_total")


def test_each_mutant_is_killed_or_told_of_and_what_was_killed_is_not_run_again(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listed(
        project,
        KILLED,
        ("three times", "2 * a", "3 * a", "test_twice"),
        ("without tools", "a + b", "a - b", "test_with_tools"),
        ("no Python", "a + b", "a +", "test_total"),
        ("of no use", "a + b", "a - b", "test_that_fails_anyway"),
    )
    assert mutate.main(["--workers", "1"], project) == 2
    said = capsys.readouterr().out
    assert "killed    minus" in said
    assert "SURVIVED three times: src/total.py, '2 * a' -> '3 * a'; pass: tests/test_total.py::test_twice" in said
    assert "NOT RUN without tools: tests/test_total.py::test_with_tools is skipped: no tools" in said
    assert "WRONG no Python: its tests neither pass nor fail" in said
    assert "WRONG of no use: tests/test_total.py::test_that_fails_anyway does not pass without the change" in said
    assert "5 mutants: 1 killed, 1 not run, 1 survived, 2 wrong" in said
    assert "min left)" in said
    assert (project / "src" / "total.py").read_text() == SOURCE

    listed(project, KILLED, ("three times", "2 * a", "3 * a", "test_twice"))
    assert mutate.main([], project) == 1
    said = capsys.readouterr().out
    assert "1 of 2 are killed by what was kept" in said
    assert "killed    minus" not in said

    assert mutate.main(["--only", "minus"], project) == 0
    assert "1 mutants: 1 killed" in capsys.readouterr().out

    (project / "src" / "total.py").write_text(SOURCE + "\n# something else\n")  # nothing is known of other sources
    assert mutate.main(["--only", "sum"], project) == 1
    assert "killed    minus" in capsys.readouterr().out


def test_quickly_there_is_one_for_each_folder_by_tests_that_are_quick(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    thorough = ("thorough", "a + b", "a - b", "test_thoroughly")
    listed(project, thorough, ("slow part", "a + b", "a - b", "test_some"), KILLED)
    assert mutate.main(["--quick"], project) == 1  # what is told by the thorough case alone is not told
    said = capsys.readouterr().out
    assert "SURVIVED slow part" in said
    assert "1 mutants: 0 killed, 0 not run, 1 survived" in said
    listed(project, thorough, KILLED, ("slow part", "a + b", "a - b", "test_some"))
    assert mutate.main(["--quick"], project) == 0
    assert "1 mutants: 1 killed" in capsys.readouterr().out
    assert mutate.main(["--only", "slow part"], project) == 0

    listed(project, thorough)
    assert mutate.main(["--quick"], project) == 2
    assert "src: make test runs the tests of no mutant" in capsys.readouterr().err
    (project / "tests" / "test_total.py").write_text("import nothing_like_this\n\ndef test_total(): ...\n")
    listed(project, KILLED)
    assert mutate.main(["--quick"], project) == 2
    assert "tests cannot be collected" in capsys.readouterr().err


def test_what_was_killed_before_an_interruption_stays_so(project: Path) -> None:
    file, found = project / "results.json", mutate.Found("killed", "", 1.5)
    mutate.Results(file, "sources").keep("minus", {"a": 1}, found)
    assert mutate.Results(file, "sources").of("minus", {"a": 1}) == found
    assert mutate.Results(file, "sources").of("minus", {"a": 2}) is None
    assert mutate.Results(file, "others").of("minus", {"a": 1}) is None
    assert mutate.Results(file, "others").seconds("minus") == 1.5
    file.write_text(json.dumps({})[:1])
    assert mutate.Results(file, "sources").of("minus", {"a": 1}) is None


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (
            [("gone", "a * b", "a", "test_total")],
            "snippet is there 0 times in src/total.py, not once: 'a * b'",
        ),
        ([("often", "return", "pass", "test_total")], "often: the snippet is there 2 times"),
        ([("nothing", "a + b", "a + b", "test_total")], "nothing: the replacement changes nothing"),
        ([("no test", "a + b", "a", "test_tot")], "no test: there is no test tests/test_total.py::test_tot"),
        ([KILLED, KILLED], "minus: there are 2 of this name"),
    ],
)
def test_a_list_that_is_wrong_is_refused(
    project: Path, entries: list[tuple[str, str, str, str]], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    listed(project, *entries)
    assert mutate.main([], project) == 2
    assert message in capsys.readouterr().err
    assert not (project / mutate.KEPT).exists()


def test_what_is_not_in_the_list_is_told(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    listed(project, KILLED)
    assert mutate.main(["--only", "plus"], project) == 2
    assert "no mutant or package plus" in capsys.readouterr().err
    assert mutate.main(["--list"], project) == 0
    assert capsys.readouterr().out == "sum: minus\n"


def test_the_list_can_be_read_by_others() -> None:
    """By whoever runs one mutant of each package."""
    entries = tomllib.loads((mutate.ROOT / mutate.LIST).read_text())["mutant"]
    assert all({"name", "package", "file", "snippet", "replacement", "tests"} <= {*entry} for entry in entries)
