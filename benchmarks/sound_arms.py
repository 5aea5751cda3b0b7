"""Whether sound arms of any kind are refused while collecting, and whether the faults of such arms are found.

Arms are drawn wide (``virtual:wide,seed=N``). Each is collected from without a fault: it is *refused* if collecting
gives up, and every marked row is a mistake. Then faults happen to them as in ``python -m benchmarks faults``, while
they are watched without a simulation; beside them the same faults of as many arms of ``virtual:seed=N``. What was
measured is kept, so an interrupted benchmark goes on. Settings come from the environment:

PNEUMARM_SOUND_ARMS          seeds of the wide arms, 6000-6019 by default; 5000-5299 are held out
PNEUMARM_SOUND_STANDARD      seeds of the others, 1-20
PNEUMARM_SOUND_TRANSITIONS   transitions collected on each wide arm, 6000
PNEUMARM_SOUND_CASES         cases of each fault on each kind of arm, 20; 0 for none
PNEUMARM_SOUND_FOLDER        where rows are kept; a temporary folder by default
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import Rows
from benchmarks.faults import KINDS, LATER, Kind, judged, play
from pneumarm.arm import open_arm
from pneumarm.arm.virtual import draw_parameters, draw_wide
from pneumarm.control import Monitor
from pneumarm.errors import ArmFailure
from pneumarm.statistics import wilson
from pneumarm.transitions import Store, collect

_DRAWS = {"wide": draw_wide, "standard": draw_parameters}
_WITHOUT_A_SIMULATION = [kind for kind in KINDS if kind.within <= 2.0]


def measure() -> Iterator[str]:
    wide = environment.seeds("PNEUMARM_SOUND_ARMS", "6000-6019")
    standard = environment.seeds("PNEUMARM_SOUND_STANDARD", "1-20")
    transitions = environment.whole("PNEUMARM_SOUND_TRANSITIONS", 6000)
    cases = environment.whole("PNEUMARM_SOUND_CASES", 20, least=0)
    with environment.kept_folder("PNEUMARM_SOUND_FOLDER") as folder:
        kept = Rows(folder / "collected.jsonl", "arm", "transitions")
        collected = [kept.get(arm, transitions) or kept.add(collect_soundly(arm, transitions)) for arm in wide]
        yield from collecting_lines(collected)
        faults = Rows(folder / "faults.jsonl", "draw", "kind", "arm", "case")
        if cases:
            yield f"{'fault':27}{'arms':>10}{'found':>9}{'in 10 s':>20}{'named':>7}{'median [s]':>12}"
        for kind in _WITHOUT_A_SIMULATION if cases else ():
            for draw, arms in (("wide", wide), ("standard", standard)):
                found = [
                    faults.get(draw, kind.name, arms[case % len(arms)], case)
                    or faults.add(case_of(draw, kind, arms[case % len(arms)], case))
                    for case in range(cases)
                ]
                yield fault_line(kind.name, draw, found)


def collect_soundly(arm: int, transitions: int) -> dict[str, object]:
    """Return what became of collecting on a wide arm without a fault."""
    opened = open_arm(f"virtual:wide,seed={arm}", arm)
    watch = Monitor(opened.spec)
    with tempfile.TemporaryDirectory() as place, Store.for_arm(Path(place) / "db", opened.spec) as store:
        refused = ""
        try:
            collect(opened, store, transitions, arm, watch=watch)
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
    yield f"collecting on {len(rows)} sound wide arms: {len(refused)} refused, {marked} of {total:,} rows marked"
    for row in rows:
        if row["refused"] or row["findings"]:
            yield f"  arm {row['arm']}: {row['refused'] or 'not refused'}; {row['findings']}"


def case_of(draw: str, kind: Kind, arm: int, case: int) -> dict[str, object]:
    """Return what a monitor without a simulation made of a fault."""
    result = judged(play(kind, arm, case, draw=_DRAWS[draw]), None)
    return {
        "draw": draw,
        "kind": kind.name,
        "arm": arm,
        "case": case,
        "found": bool(result.kinds),
        "named": bool(set(result.kinds) & set(kind.found_as)),
        "seconds": result.since_contradiction if np.isfinite(result.since_contradiction) else None,
        "early": result.early,
    }


def fault_line(kind: str, draw: str, rows: list[dict[str, object]]) -> str:
    """Return a line of the table of faults."""
    seconds = np.array([np.inf if row["seconds"] is None else float(str(row["seconds"])) for row in rows])
    soon = int((seconds <= LATER).sum())
    low, high = wilson(soon, len(rows))
    found, named = (sum(bool(row[name]) for row in rows) for name in ("found", "named"))
    share = f"{soon / len(rows):.0%} ({low:.0%}-{high:.0%})"
    return f"{kind:27}{draw:>10}{f'{found}/{len(rows)}':>9}{share:>20}{named:>7}{np.median(seconds):>12.2f}"
