"""The commands and programs of the README, as a reader copies them."""

import re
import shlex
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def blocks(language: str = r"\w*") -> list[str]:
    """Return what is in the README's blocks of code of a ``language``, by default any but Python."""
    found = re.findall(r"^```(\w*)\n(.*?)^```", README.read_text(), re.S | re.M)
    return [
        text
        for named, text in found
        if re.fullmatch(language, named) and (language == "python") == (named == "python")
    ]


def commands(language: str = r"\w*") -> list[list[str]]:
    """Return the README's calls of pneumarm in blocks of a ``language``, in order, as words."""
    lines = [shlex.split(line, comments=True) for block in blocks(language) for line in block.splitlines()]
    return [line for line in lines if line and line[0] == "pneumarm"]
