"""A store as a file that the viewer of Rerun opens: angles in degrees, pressures in bar, valves, further sensors.

Two timelines: ``time`` is the arm's clock, which may begin anew where an arm was opened again, and ``row`` counts on.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pneumarm.extras import extra
from pneumarm.files import written_whole
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.store import Store

_NEEDS = "a recording for Rerun"
_MUSCLES = ("muscle 1", "muscle 2")


def export_rerun(store: Store, path: Path) -> dict[str, int]:
    """Write the rows of ``store`` to ``path``, whole or not at all, in bounded memory; return what was written.

    Raises:
        UnusableInput: Rerun is not installed, or ``path`` cannot be written.

    """
    library = extra("rerun", "rerun", _NEEDS)
    views = extra("rerun.blueprint", "rerun", _NEEDS)
    counts, seen = {"rows": 0, "sequences": 0}, set[int]()
    with library.RecordingStream("pneumarm") as recording, written_whole(path) as temporary:
        # Its own writing to a file says nothing of a disk that is full.
        written = recording.binary_stream()
        recording.send_blueprint(_blueprint(views, store))
        for joint in range(1, store.joints + 1):
            for what in ("pressure", "valves"):
                lines = library.SeriesLines(names=[f"{one} {what}" for one in _MUSCLES])
                recording.log(f"joint_{joint}/{what}", lines, static=True)
            recording.log(f"joint_{joint}/angle", library.SeriesLines(names=["angle"]), static=True)
        with open(temporary, "wb") as file:
            for rows in store.blocks():
                _send(library, recording, rows, store, counts["rows"])
                counts["rows"] += len(rows)
                seen.update(np.unique(rows.sequence).tolist())
                file.write(written.read() or b"")
    return counts | {"sequences": len(seen)}


def _send(library: Any, recording: Any, rows: Rows, store: Store, first: int) -> None:
    """Send ``rows``, of which the ``first`` has this number."""
    times = [
        library.TimeColumn("time", duration=rows.time),
        library.TimeColumn("row", sequence=np.arange(first, first + len(rows))),
    ]
    angle, pressure = store.spec.degrees(rows.angle), store.spec.bar(rows.pressure)
    series = dict(rows.measured)
    for j in range(store.joints):
        here = f"joint_{j + 1}"
        series |= {f"{here}/angle": angle[:, j], f"{here}/pressure": pressure[:, j]}
        series[f"{here}/valves"] = rows.command[:, j]
    for name, values in series.items():
        recording.send_columns(name, times, library.Scalars.columns(scalars=values))


def _blueprint(views: Any, store: Store) -> Any:
    """Return what stands where on the screen: joint beside joint, and below what further sensors said."""
    words = {"angle": "angle [degrees]", "pressure": "pressure [bar]", "valves": "valves: in +1, out -1"}
    joints = []
    for joint in range(1, store.joints + 1):
        origins = {f"joint_{joint}/{what}": f"joint {joint}, {said}" for what, said in words.items()}
        joints.append(views.Vertical(*(views.TimeSeriesView(origin=at, name=said) for at, said in origins.items())))
    further = [views.TimeSeriesView(origin=name, name=name.replace("_", " ")) for name in store.further]
    if not further:
        return views.Blueprint(views.Horizontal(*joints))
    return views.Blueprint(views.Vertical(views.Horizontal(*joints), views.Horizontal(*further), row_shares=[3, 1]))
