"""The page of the thesis: every number of it has a row, and what the rows name is there."""

import ast
import importlib
import re
import shlex
from dataclasses import fields
from pathlib import Path

import pytest

from pneumarm.cli import COMMANDS, app
from pneumarm.experiments.registry import PLACES
from pneumarm.learning.methods import METHODS

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "pneumarm"
PAGE = (ROOT / "docs" / "thesis.md").read_text()
SECTIONS = """
1 1.1 1.2 1.3 1.4 2 2.1 2.2 2.2.1 2.2.2 2.2.3 2.3 2.3.1 2.3.2 2.3.3 2.3.4 2.4 2.4.1 2.4.2 2.4.3
3 3.1 3.2 3.2.1 3.2.2 3.2.3 3.2.4 3.3 3.4 3.5 4 4.1 4.2 4.2.1 4.2.2 4.2.3 4.2.4 4.2.5 4.2.6
4.3 4.3.1 4.3.2 4.3.2.1 4.3.2.2 4.3.3 4.4 4.5 4.5.1 4.5.2 4.6 5 5.1 5.2 5.3 5.4 5.4.1 5.4.2 5.4.3 5.4.4
5.5 5.5.1 5.5.2 5.6 5.6.1 5.6.2 6 6.1 6.1.1 6.1.2 6.1.3 6.1.4 6.2 6.3 7 7.1 7.2 7.3 8
A A.1 A.1.1 A.1.2 A.1.3 A.1.4 B B.1 C C.1 C.2 C.3 C.4 C.5
"""


def numbered(**most: int) -> list[str]:
    """Return numbers such as 2.1, 2.2, ... of each chapter, up to its highest."""
    return [f"{chapter.strip('_')}.{n}" for chapter, last in most.items() for n in range(1, last + 1)]


NUMBERS = {
    "Sections": SECTIONS.split(),
    "Equations and algorithms": [*numbered(_2=4, _3=9, _4=17, _5=3, A=1, B=11), "Algorithm 1", "Algorithm 2"],
    "Tables": numbered(_2=1, _4=1, _5=9, _8=1, C=22),
    "Figures": numbered(_2=8, _3=5, _4=3, _5=19, A=2, C=35),
}
"""All numbers of the thesis, by the table of the page that they are in."""
NOT_BUILT = "not built: "


def rows_of(title: str) -> list[list[str]]:
    """Return the cells of the rows of the table under the heading ``title``."""
    part = PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]
    lines = [line for line in part.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


ROWS = [row for title in NUMBERS for row in rows_of(title)]


def names_in(file: Path) -> set[str]:
    """Return the classes and functions of ``file``, and what it assigns outside of them."""
    found = set()
    for node in ast.parse(file.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


def check_command(words: list[str]) -> None:
    """Check that the command ``words`` and its options exist."""
    name = next(known for known in COMMANDS if words[: len(known.split())] == known.split())
    command = app
    for word in name.split():
        command = command[word]
    known = {one for argument in command.assemble_argument_collection() for one in argument.names}
    method = METHODS[words[words.index("--method") + 1]] if "--method" in words else None
    for option in (word for word in words if word.startswith("--")):
        if option.startswith("--own."):
            assert method is not None
            place = option.removeprefix("--own.").replace("-", "_")
            assert place.split(".")[0] in {one.name for one in fields(method.settings)}, option
        else:
            assert option in known, option
    if name == "experiment" and not words[1].startswith("--"):
        assert words[1] in PLACES


@pytest.mark.parametrize("title", NUMBERS)
def test_every_number_of_the_thesis_has_a_row(title: str) -> None:
    rows = rows_of(title)
    assert all(len(row) == 5 for row in rows)
    listed = [number for row in rows for number in row[0].split(", ")]
    assert set(listed) == set(NUMBERS[title])
    if title != "Sections":  # these have a row for each thing that they describe
        assert len(listed) == len(set(listed))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}: {row[1]}"[:60])
def test_what_a_row_names_is_there(row: list[str]) -> None:
    _, _, built, reached, shown = row
    for place in re.findall(r"`([\w/]+(?:/|\.py)(?:::\w+)?)`", built):
        path, _, name = place.partition("::")
        file = next(base / path for base in (SOURCE, ROOT) if (base / path).exists())
        assert not name or name in names_in(file), place
    for span in re.findall(r"`(pneumarm.*?)`", reached):
        program, *words = shlex.split(span)
        if words:
            check_command(words)
        else:
            module, _, name = program.rpartition(".")
            assert hasattr(importlib.import_module(module), name), program
    for test in re.findall(r"`(.*?)`", shown):
        path, _, name = test.partition("::")
        assert re.search(rf"^def {name}\(", (ROOT / path).read_text(), re.M), test


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}: {row[1]}"[:60])
def test_a_row_says_what_shows_it_or_that_it_is_not_built(row: list[str]) -> None:
    _, _, built, reached, shown = row
    if built.startswith(NOT_BUILT) or built == "text alone":
        assert (reached, shown) == ("", "")
    else:
        assert shown


def test_the_page_counts_its_rows() -> None:
    missing = sum(row[2].startswith(NOT_BUILT) for row in ROWS)
    assert f'**{len(ROWS)} rows; {missing} of them say "not built"**' in PAGE
