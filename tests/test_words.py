"""What people read is a native technical writer's English: words and turns of phrase that never appear there."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from pneumarm.cli import COMMANDS, main

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/index.md", "docs/tutorial.md", "docs/where-it-runs.md", "docs/how-to/*.md")
LITERALS = ("commands", "report", "live", "console.py", "errors.py", "cli.py", "progress.py", "moving/told.py")
"""Modules whose texts people see."""

NEVER = {
    r"\bthat (?:is|are|was|were) to be\b": "relative clauses on 'that is to be'",
    r"(?:^|[.!?:;]\s+|[│*]\s+)Of [a-z]": "openings with 'Of ...'",
    r"[-−]0(?:\.0+)?(?=\s?[°%]|\s(?:deg|degrees|bar)\b)": "a negative zero",
    r"\b(?:turn by turn|every turn|each turn)\b": "a turn for a control step",
    r"\bnobody foresaw\b|\bare foreseen\b": "foreseen for predicted",
    r"\bis not heard\b|\bhad nothing to prevent\b": "passives of machines",
    r"\bdrawn wide\b": "a private word",
    r"\btaken back\b|\bmade anew\b|\bfits? it anew\b": "for rolled back, trained again",
    r"\bgoes before them\b|\bgo before them\b": "for overrides",
    r"\bdoes as well\b|\bcomes along\b|\bno pneumarm\b": "words that were translated one by one",
    r"\bit is said\b|\bis told all the same\b": "passives where the command says something",
    r"\b(?:[Ss]ettle[sd]?|reach(?:es|ed)?|[Ss]uccess(?: rate)?)\b(?: \w+){0,3} 0\.\d{2,}(?!\d*\s?(?:°|s\b|deg|bar))":
        "a decimal for a percentage",
}  # fmt: skip
"""Patterns and what each stands for."""


def offences(text: str) -> list[str]:
    """Return what is in ``text`` that people are never to read."""
    return [
        f"{words}: {text[max(found.start() - 30, 0) : found.end() + 30]!r}"
        for pattern, words in NEVER.items()
        for found in re.finditer(pattern, text, re.M)
    ]


def literals(path: Path) -> Iterator[str]:
    """Yield the texts in a module, the parts of f-strings too, but for docstrings, which people do not see."""
    tree = ast.parse(path.read_text())
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {
        id(one.value)
        for node in ast.walk(tree)
        if isinstance(node, documented)
        for one in node.body
        if isinstance(one, ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.value


@pytest.mark.parametrize("command", COMMANDS)
def test_helps_are_native(command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "400")  # so that sentences are not broken
    with pytest.raises(SystemExit):
        main([*command.split(), "--help-all"])
    lines = re.sub(r" {2,}", "  ", capsys.readouterr().out)
    assert offences(re.sub(r"(--[\w.-]+ [A-Z]+)[ .]*", r"\1. ", lines)) == []


@pytest.mark.parametrize(
    "page",
    sorted(p for pattern in PAGES for p in ROOT.glob(pattern)),
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
def test_pages_are_native(page: Path) -> None:
    assert offences(" ".join(page.read_text().split("\n"))) == []


@pytest.mark.parametrize("place", LITERALS)
def test_texts_in_the_code_are_native(place: str) -> None:
    path = ROOT / "src" / "pneumarm" / place
    files = [path] if path.is_file() else sorted(path.rglob("*.py"))
    assert files
    assert [(file.name, found) for file in files for text in literals(file) for found in offences(text)] == []


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("The action that is to be taken.", 1),
        ("Random seed. Of everything that is drawn.", 1),
        ("Settled at 0.9999 of the goals", 1),
        ("it is at -0.0°", 1),
        ("Ten of the goals; settled after 0.25 s, at -0.5°, or settled 99.99 %.", 0),
    ],
)
def test_they_are_found(text: str, count: int) -> None:
    assert len(offences(text)) == count
