"""The list of the thesis' figures: each has a counterpart, whose command and section exist."""

import inspect
import re
import shlex
from pathlib import Path

import pytest

import pneumarm.appendix_a
import pneumarm.report.sections
from pneumarm.cli import COMMANDS
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.registry import experiment

ERRORS = Path(pneumarm.appendix_a.__file__).with_name("errors.toml")
LIST = Path(__file__).parents[2] / "docs" / "figures.md"
WANTED = (
    ["2.8"]
    + [f"3.{n}" for n in range(1, 6)]
    + ["4.2", "4.3"]
    + [f"5.{n}" for n in range(1, 20)]
    + ["A.1", "A.2"]
    + [f"C.{n}" for n in range(1, 36)]
)
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in LIST.read_text().splitlines()
    if re.match(r"\| [2-5AC]\.", line)
]


DIFFERENCES = ("C.29", "C.33")
"""Figures in which the thesis shows differences of the spread, and the page its results."""


def test_every_figure_is_listed_once() -> None:
    assert [figure for row in ROWS for figure in row[0].split(", ")] == WANTED


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_its_command_and_section_exist(row: list[str]) -> None:
    _, _, command, section = row
    program, name, *rest = shlex.split(command.strip("`"))
    assert program == "pneumarm"
    if name == "arm":
        assert f"arm {rest[0]}" in COMMANDS
        assert f'title = "{section}"' in ERRORS.read_text()
        return
    assert name in COMMANDS
    if name != "experiment":
        assert f'"{section}"' in inspect.getsource(pneumarm.report.sections)
        return
    (chosen,) = rest
    made = experiment(chosen)
    if isinstance(made, Factorial):
        cited = ", ".join(made.cited[section.split(":")[0]].values())
        for figure in row[0].split(", "):
            if figure not in DIFFERENCES:
                assert re.search(rf"\b{re.escape(figure)}(?!\d)", cited)
        criterion, _, part = section.partition(": ")
        assert part == "effects"
        assert criterion in made.criteria
        assert len(made.thesis) >= 4
    else:
        assert section in [words.title for words in made.words.sections]
