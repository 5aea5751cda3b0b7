"""``pneumarm import``."""

from dataclasses import asdict
from pathlib import Path

from pneumarm.commands.common import AnyStore, Json
from pneumarm.console import show, table
from pneumarm.transitions import Store, import_recording


def import_(recording: Path, db: AnyStore, /, *, mapping: Path | None = None, json: Json = False) -> None:
    """Import a recording made elsewhere; a mapping file says what its columns are.

    Parameters
    ----------
    recording
        The recording: CSV with a header line, .parquet, or the folder of a LeRobot dataset.
    db
        The store to add to, of the same arm; made where there is none.
    mapping
        TOML file with columns, units, sequences and sampling period; by default the one that ``pneumarm export`` left
        beside the recording.
    """
    imported = asdict(import_recording(recording, mapping, db))
    counts = {name: count for name, count in imported.items() if name not in ("skipped", "restarts") or count}
    skipped = counts.pop("skipped", {})
    rows = [(_WORDS.get(name, name), f"{count:,}") for name, count in counts.items()]
    rows += [(f"left out, {reason}", f"{count:,}") for reason, count in skipped.items()]
    with Store.open(db) as store:
        imported["marked"] = store.marked_rows()
    rows += [(f"rows marked: {reason}", f"{count:,}") for reason, count in imported["marked"].items()]
    show(imported, json, lambda: [table(("imported", ""), rows)])


_WORDS = {
    "rows": "rows of the recording",
    "single": "left out, alone in their sequence",
    "restarts": "sequences begun because the time went back",
}
