"""Whether sound arms of any kind are refused while collecting.

Each arm is collected from without a fault: it is *refused* if collecting gives up, and every marked row is a mistake.
The faults of wide arms: ``PNEUMARM_FAULTS_DRAW=wide python -m benchmarks faults``. What was measured is kept, so an
interrupted benchmark goes on. Settings come from the environment:

PNEUMARM_SOUND_ARMS          names of arms divided by blanks, or seeds of wide arms, 6000-6019 by default; 5000-5299
                             are held out
PNEUMARM_SOUND_TRANSITIONS   transitions collected on each, 6000
PNEUMARM_SOUND_FOLDER        where rows are kept; a temporary folder by default
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks import _environment as environment
from benchmarks._trials import Rows, names_of
from benchmarks.agents import seed_of
from pneumarm.arm import open_arm
from pneumarm.control import Monitor
from pneumarm.errors import ArmFailure
from pneumarm.transitions import Store, collect


def measure() -> Iterator[str]:
    arms = names_of(environment.text("PNEUMARM_SOUND_ARMS", "6000-6019"), "virtual:wide,seed=")
    transitions = environment.whole("PNEUMARM_SOUND_TRANSITIONS", 6000)
    with environment.kept_folder("PNEUMARM_SOUND_FOLDER") as folder:
        kept = Rows(folder / "collected.jsonl", "arm", "transitions")
        yield from collecting_lines(
            [kept.get(arm, transitions) or kept.add(collect_soundly(arm, transitions)) for arm in arms]
        )


def collect_soundly(arm: str, transitions: int) -> dict[str, object]:
    """Return what became of collecting on an arm without a fault."""
    seed = seed_of(arm)
    opened = open_arm(arm, seed)
    watch = Monitor(opened.spec)
    with tempfile.TemporaryDirectory() as place, Store.for_arm(Path(place) / "db", opened.spec) as store:
        refused = ""
        try:
            collect(opened, store, transitions, seed, watch=watch)
        except ArmFailure as error:
            refused = str(error)
        marked = sum(store.marked_rows(1).values())
    found = [str(one) for one in watch.findings]
    return {"arm": arm, "transitions": transitions, "refused": refused, "marked": marked, "findings": found}


def collecting_lines(rows: list[dict[str, object]]) -> Iterator[str]:
    """Yield what collecting on sound arms came to."""
    total = sum(int(str(row["transitions"])) for row in rows)
    marked = sum(int(str(row["marked"])) for row in rows)
    refused = [row for row in rows if row["refused"]]
    yield f"collecting on {len(rows)} sound arms: {len(refused)} refused, {marked} of {total:,} rows marked"
    for row in rows:
        if row["refused"] or row["findings"]:
            yield f"  {row['arm']}: {row['refused'] or 'not refused'}; {row['findings']}"
