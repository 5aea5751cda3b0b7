"""What the pages name is there: links, files, functions, commands, targets of make, benchmarks, experiments."""

import re
from pathlib import Path

import pytest

from pneumarm.cli import COMMANDS
from pneumarm.experiments.registry import PLACES

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "pneumarm"
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("firmware/*.md")])


def code_of(page: str) -> str:
    """Return what the text of ``page`` says in code spans and blocks, one a line."""
    blocks = re.findall(r"```.*?\n(.*?)```", page, re.S)
    spans = re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", page, flags=re.S))
    return "\n".join([*blocks, *(" ".join(span.split()) for span in spans)])


def has_place(path: str, name: str) -> bool:
    """Return whether there is ``path``, from the package or the root, and in it the function or class ``name``."""
    found = [base / path for base in (SOURCE, ROOT) if (base / path).exists()]
    if not found and path.count("/") - path.endswith("/") == 0:
        found = list(SOURCE.rglob(path.rstrip("/")))
    return any(not name or re.search(rf"^\s*(def|class) {name}\b|^{name}\b.*=", f.read_text(), re.M) for f in found)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_a_page_names_is_there(page: Path) -> None:
    text = page.read_text()
    links = {link for link in re.findall(r"\]\(([^)#:]+)\)", text) if not (page.parent / link).exists()}
    code = code_of(text)
    places = re.findall(r"^([\w/]+/|\w+\.py|[\w/]+/\w+\.\w+)(?:::(\w+))?$", code, re.M)
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M))
    benchmarks = {path.stem for path in (ROOT / "benchmarks").iterdir()}
    commands = {command.split()[0] for command in COMMANDS}
    assert links == set()
    assert [place for place in places if not has_place(*place)] == []
    assert set(re.findall(r"^make ([a-z][\w-]*)", code, re.M)) <= targets
    assert set(re.findall(r"python -m benchmarks (\w+)", code)) <= benchmarks
    assert set(re.findall(r"^pneumarm ([a-z]+)", code, re.M)) <= commands
    assert set(re.findall(r"^pneumarm experiment ([a-z][\w-]+)", code, re.M)) <= {*PLACES}


def test_every_yes_of_what_may_be_expected_names_a_test() -> None:
    lines = (ROOT / "docs" / "how-to" / "expectations.md").read_text().splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| ")]
    answers = [row for row in rows if row[0] != "you expect"]
    assert len(answers) >= 30
    for expected, answer, shown in answers:
        if answer.startswith("no"):
            assert shown == "", expected
            continue
        assert answer.startswith("yes"), expected
        path, _, name = shown.strip("`").partition("::")
        found = (ROOT / path).read_text()
        assert re.search(rf"^def {name}\(" if name else r"^def test_", found, re.M), shown


def test_names_of_the_glossary_are_in_the_code() -> None:
    words = {word for file in SOURCE.rglob("*.py") for word in re.findall(r"\w+", file.read_text())}
    lines = (ROOT / "docs" / "glossary.md").read_text().splitlines()
    cells = [line.split("|")[-2] for line in lines if line.startswith("| ")]
    names = {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}
    assert len(names) >= 50
    assert names - words == set()
