"""``pneumarm versions``."""

from pathlib import Path
from typing import Any

from pneumarm.commands.common import Json
from pneumarm.console import say, show, table
from pneumarm.control import put_back, read_history
from pneumarm.control.versions import ADAPTED, kept_versions
from pneumarm.learning import Event


def versions_(folder: Path, /, *, to: int | None = None, json: Json = False) -> None:
    """List the versions of an agent that adapted on an arm, and put one back.

    Parameters
    ----------
    folder
        The folder of a transfer or a run.
    to
        Number of the version to put back: adapted.safetensors becomes that one. The others are kept.
    json
        Print one JSON object on stdout and nothing else there.
    """
    history = read_history(folder) if to is None else put_back(folder, to)
    made = {event.version: event for event in history.events if event.what == "accepted"}
    taken = {event.figures["taken_back"] for event in history.events if event.what == "rolled back"}
    rows = [_row(number, made.get(number), number in taken, history.version) for number in kept_versions(folder)]
    if to is not None:
        say(f"{folder / ADAPTED} is version {to} now")
    for sentence in history.sentences:
        say(sentence)
    show(
        {"version": history.version, "versions": rows},
        json,
        lambda: [table(tuple(rows[0]), [_cells(r) for r in rows])],
    )


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


def _cells(row: dict[str, Any]) -> list[Any]:
    def cell(value: Any) -> Any:
        if isinstance(value, list):
            return " ".join(f"{x:.2f}" for x in value)
        if isinstance(value, bool):
            return "yes" if value else ""
        return "" if value is None else value

    return [cell(value) for value in row.values()]
