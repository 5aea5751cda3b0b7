"""The commands and programs of the README and of the pages it leads to, as a reader copies them."""

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).parent.parent
_HOW_TO = ("move", "see", "python", "new-arm")
PAGES = ("README.md", "docs/tutorial.md", *(f"docs/how-to/{name}.md" for name in _HOW_TO))
"""In the order in which a new user reads them: later ones use what earlier ones made."""


def blocks(language: str = r"\w*") -> list[str]:
    """Return what is in the blocks of code of a ``language``, by default any but Python."""
    pages = [(ROOT / page).read_text() for page in PAGES]
    found = [block for page in pages for block in re.findall(r"^```(.*?)\n(.*?)^```", page, re.S | re.M)]
    return [
        text
        for named, text in found
        if re.fullmatch(language, named) and (language == "python") == (named == "python")
    ]


def commands(language: str = r"\w*") -> list[list[str]]:
    """Return the calls of pneumarm in blocks of a ``language``, in order, as words."""
    lines = [shlex.split(line, comments=True) for block in blocks(language) for line in block.splitlines()]
    return [line for line in lines if line and line[0] == "pneumarm"]
