"""``pneumarm view``."""

from pathlib import Path

from pneumarm.address import Address, ServerAddress
from pneumarm.commands.common import AnyStore, Json
from pneumarm.console import show, table
from pneumarm.progress import progress
from pneumarm.report.shown import read_shown
from pneumarm.report.viewing import check_view, write_view


def view_(
    file: AnyStore,
    /,
    *,
    out: Path | None = None,
    sequence: int | None = None,
    begin: float = 0.0,
    seconds: float = 20.0,
    json: Json = False,
) -> None:
    """Make a picture, or one that plays, of how an arm moved.

    Parameters
    ----------
    file
        A store, such as --record of ``pneumarm move`` and ``track`` makes; the folder of a run; or one of its
        records (moving.safetensors, demonstration-00.safetensors).
    out
        What to write: .gif and .mp4 play, .svg plays in a browser, .png shows all at once. By default a GIF with the
        file's name, in this folder.
    sequence
        Which sequence of a store, from 1; by default the last ones, as far as they follow on each other.
    begin
        Time from which on to show it [s].
    seconds
        For how long.
    """
    target = out if out is not None else Path(f"{_stem(file)}.gif")
    check_view(target)
    shown = read_shown(file, sequence, begin, seconds)
    with progress("drawing"):
        write_view(shown, target)
    lasting = float(shown.time[-1])
    result = {"file": str(target), "seconds": lasting, "joints": shown.spec.joints}
    show(result, json, lambda: [table(("file", "shows [s]"), [(str(target), lasting)])])


def _stem(file: Address) -> str:
    return file.database if isinstance(file, ServerAddress) else file.resolve().stem
