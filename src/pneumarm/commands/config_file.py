"""Options from a file: ``--config FILE`` reads them, ``pneumarm run --write-config FILE`` writes them.

The file is TOML. A table is called as the command, ``[run]`` or ``[arm.check]``, its keys are the options without the
dashes before them, and what follows a dot is in a table of its own::

    [run]
    arm = "serial:/dev/ttyACM0,spec=arm.toml"
    transitions = 20000

    [run.servo]
    tolerance = 0.5

What is given on the command line goes before what is in the file.
"""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cyclopts import App
from cyclopts.config import Dict

from pneumarm.commands.help_pages import CONFIG
from pneumarm.errors import UnusableInput

_WIDTH = 100


def take_config(arguments: Sequence[str], app: App) -> tuple[list[str], Dict | None]:
    """Return ``arguments`` without ``--config FILE``, and what that file says, if it is given.

    Raises:
        UnusableInput: the file cannot be read, is no TOML, or has no table for the command.

    """
    left, file = take_option(arguments, CONFIG, "a file")
    if file is None:
        return left, None
    from pneumarm.files import read_toml

    found = read_toml(file, "a TOML file with options")
    command, _, _ = app.parse_commands(left)
    table: Any = found
    for name in command:
        table = table.get(name) if isinstance(table, dict) else None
    if not isinstance(table, dict):
        raise UnusableInput(
            f"{file}: has no table [{'.'.join(command)}]; its tables are {', '.join(found) or 'none'}"
        )
    return left, Dict(found, source=file)


def take_option(arguments: Sequence[str], option: str, expected: str) -> tuple[list[str], str | None]:
    """Return ``arguments`` without ``option`` and its value, and that value, if it is given.

    Raises:
        UnusableInput: nothing comes after it, where ``expected`` was.

    """
    given = list(arguments)
    for place, one in enumerate(given):
        if one == "--":
            break
        if one.startswith(f"{option}="):
            return given[:place] + given[place + 1 :], one.partition("=")[2]
        if one == option:
            if place + 1 == len(given):
                raise UnusableInput(f"{option}: expected {expected} after it")
            return given[:place] + given[place + 2 :], given[place + 1]
    return given, None


def as_config(command: str, settings: Mapping[str, Any], app: App) -> str:
    """Return the options among ``settings``, by their names in Python, as a file for ``command`` with their words."""
    collection = app[command].assemble_argument_collection(parse_docstring=True)
    words = {one.name.removeprefix("--"): str(one.parameter.help or "") if one.parse else None for one in collection}
    lines = ["# Options for pneumarm --config; the command line overrides them."]
    return "\n".join([*lines, *_table((command,), settings, words)]) + "\n"


def _table(path: tuple[str, ...], settings: Mapping[str, Any], words: Mapping[str, str | None]) -> Iterator[str]:
    from pneumarm.files import as_toml

    yield from ("", f"[{'.'.join(path)}]")
    inner = {}
    for name, value in settings.items():
        key = name.replace("_", "-")
        said = words.get(".".join((*path[1:], key)), "")
        if said is None:  # for Python only
            continue
        if isinstance(value, Mapping):
            inner[key] = value
            continue
        yield from (f"# {line}" for line in textwrap.wrap(" ".join(said.split()), _WIDTH))
        yield f"# {key} =" if value is None else f"{key} = {as_toml(value)}"
    for key, table in inner.items():
        if table:
            yield from _table((*path, key), table, words)
