"""``pneumarm versions``."""

import math
from pathlib import Path
from typing import Any

from pneumarm.adaptation import Event
from pneumarm.commands.common import Json
from pneumarm.console import say, show, table
from pneumarm.control import put_back, read_history
from pneumarm.control.versions import ADAPTED, HISTORY, kept_versions


def versions_(folder: Path, /, *, to: int | None = None, json: Json = False) -> None:
    """List the versions of an agent that adapted on an arm, and put one back.

    Parameters
    ----------
    folder
        The folder of a transfer or a run.
    to
        Number of the version to put back into adapted.safetensors. The others are kept.
    """
    history = read_history(folder) if to is None else put_back(folder, to)
    made = {event.version: event for event in history.events if event.what == "accepted"}
    taken = {event.figures["taken_back"] for event in history.events if event.what == "rolled back"}
    rows = [_row(number, made.get(number), number in taken, history.version) for number in kept_versions(folder)]
    if to is not None:
        say(f"{folder / ADAPTED} is version {to} now")
    say_history(folder)
    result = {"version": history.version, "versions": rows}
    show(result, json, lambda: [table(_HEADER, [_cells(row) for row in rows])])


def say_history(folder: Path) -> None:
    """Say when the arm in ``folder`` was found to have changed and what the agent did about it."""
    if (folder / HISTORY).exists():
        for sentence in read_history(folder).sentences:
            say(sentence)


def _row(number: int, made: Event | None, taken_back: bool, current: int) -> dict[str, Any]:
    return {
        "version": number,
        "movement": made.movement if made else 0,
        "fitted_to": made.figures["movements"] if made else None,
        "error_before": made.figures["before"] if made else None,
        "error_after": made.figures["after"] if made else None,
        "taken_back": taken_back,
        "in_use": number == current,
    }


_HEADER = ("version", "after movement", "fitted to", "error before", "and after", "")


def _cells(row: dict[str, Any]) -> list[Any]:
    """Return a row for people; errors are geometric means over what is predicted."""

    def mean(values: list[float] | None) -> str:
        return f"{math.exp(sum(map(math.log, values)) / len(values)):.2f}" if values else ""

    state = "in use" if row["in_use"] else "rolled back" if row["taken_back"] else ""
    fitted = "" if row["fitted_to"] is None else row["fitted_to"]
    return [row["version"], row["movement"], fitted, mean(row["error_before"]), mean(row["error_after"]), state]
