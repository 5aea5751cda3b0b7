"""The section on what was wrong: findings of the monitor, marked rows, what the guard did, and the link."""

from collections.abc import Mapping, Sequence
from typing import Any

from pneumarm.arm.counts import Counts
from pneumarm.arm.seam import ArmSpec
from pneumarm.control.condition import COLLECTING, LINK, WAYS, rows_marked
from pneumarm.report.data import MarkedData
from pneumarm.report.figures.marked import marked_rows
from pneumarm.report.ledger import MISSING
from pneumarm.report.page import Picture, Section, Table

HEALTH = "What was found wrong"
_PHASES = {COLLECTING: COLLECTING, "before": "on arrival", "learning": "while learning", "after": "after adaptation"}
_STAGES = {"collect": COLLECTING, "transfer": "moving"}


def tells_of_health(results: Mapping[str, Any]) -> bool:
    """Return whether ``results`` say whether something was wrong."""
    return any("findings" in results.get(stage, {}) for stage in _STAGES)


def health(results: Mapping[str, Any], marked: MarkedData | None, spec: ArmSpec) -> Section:
    """Return what was found wrong, and what was done about it; one sentence where that is nothing.

    Args:
        results: contents of ``results.json``; those of older versions have less to tell.
        marked: which of the stored rows are marked.
        spec: the arm.

    """
    counts = _counts(results)
    found = findings(results)
    tables = [table for table in (_found_table(found), _counts_table(counts), _link_table(counts)) if table]
    spoiled = marked is not None and len(marked.spans) > 0
    text = [
        "The monitor found "
        + (f"{len(found)} thing{'s' if len(found) > 1 else ''} wrong with the arm" if found else "nothing wrong")
        + (", and no row is marked" if marked is not None and not spoiled else "")
        + f"; {_guard(counts)}."
    ]
    if found:
        text.append(
            "A finding tells since when something was wrong, as far as the readings show it, when that was noticed, "
            "and until when it lasted, on the arm's clock. Rows read while a valve, a sensor or the supply was "
            "broken are marked: they are kept, and nothing is learned from them. A leak or a change of the arm is "
            "reported and not marked, because what such an arm does is what there is to learn."
        )
    return Section(HEALTH, text, [_picture(marked, spec)] if marked and spoiled else [], tables)


def _counts(results: Mapping[str, Any]) -> dict[str, Counts]:
    saved = {phase: counts for stage in _STAGES for phase, counts in results.get(stage, {}).get("counts", {}).items()}
    return {phase: Counts.of(counts) for phase, counts in saved.items()}


def findings(results: Mapping[str, Any]) -> list[Sequence[str]]:
    """Return what was found wrong, where, while what, since and until when, and the rows marked."""
    return [
        row
        for stage, doing in _STAGES.items()
        for one in results.get(stage, {}).get("findings", [])
        for row in [_finding(one, doing, results[stage].get("marked", {}))]
    ]


def _finding(one: Mapping[str, Any] | str, doing: str, marked: Mapping[str, int]) -> list[str]:
    if isinstance(one, str):  # of an older version
        return [one, MISSING, doing, MISSING, MISSING, MISSING, MISSING]
    places = (f"{name} {one[name]}" for name in ("joint", "muscle") if one[name] is not None)
    name = str(one["kind"]).replace("-", " ")
    confidence = f" ({one['confidence']:.0%} sure)" if isinstance(one.get("confidence"), float) else ""
    return [
        f"{name}: {one['detail']}{confidence}",
        ", ".join(places) or "the whole arm",
        doing,
        _seconds(one["since"]),
        _seconds(one["noticed"]),
        "lasts" if one["until"] is None else _seconds(one["until"]),
        f"{rows_marked(one, marked):,}",
    ]


def _seconds(time: float) -> str:
    return f"{time:,.1f} s"


def _found_table(found: Sequence[Sequence[str]]) -> Table | None:
    header = ("what", "where", "while", "since", "noticed", "until", "rows marked")
    return Table(header, found, "What the monitor found.", words=True) if found else None


def _guard(counts: Mapping[str, Counts]) -> str:
    """Return what the guard did and what was late, in a clause; on healthy arms it only limits the pressure."""
    if not counts:
        return "what the guard did was not recorded"
    total = sum(counts.values(), Counts())
    replaced, limits = total.interventions.replaced, total.interventions.limited
    guard = [f"{replaced:,} decisions had to be replaced" if replaced else "no decision had to be replaced"]
    if limits:
        guard.append(f"{limits:,} valves were kept closed at limits of angle or time")
    missed = total.missed_deadlines
    guard.append(f"{missed:,} control periods began late" if missed else "no control period began late")
    return ", ".join(guard)


def _counts_table(counts: Mapping[str, Counts]) -> Table | None:
    """Return what was counted where it was anything, a column a phase."""
    rows = [
        (words, [getattr(phase.interventions, name) for phase in counts.values()]) for name, words in WAYS.items()
    ]
    rows.append(("control periods that began late", [phase.missed_deadlines for phase in counts.values()]))
    return _table(
        counts,
        rows,
        "What the guard did and which deadlines were missed. It keeps inlets closed at the highest pressure on any "
        "healthy arm; anything else deserves a look.",
    )


def _link_table(counts: Mapping[str, Counts]) -> Table | None:
    names = list(dict.fromkeys(name for phase in counts.values() for name in phase.link))
    rows = [(LINK.get(name, name), [phase.link.get(name, 0) for phase in counts.values()]) for name in names]
    return _table(counts, rows, "What happened on the link to the arm.")


def _table(counts: Mapping[str, Counts], rows: Sequence[tuple[str, list[int]]], caption: str) -> Table | None:
    kept = [(words, *(f"{number:,}" for number in numbers)) for words, numbers in rows if any(numbers)]
    return Table(("", *(_PHASES.get(phase, phase) for phase in counts)), kept, caption) if kept else None


def _picture(marked: MarkedData, spec: ArmSpec) -> Picture:
    numbers = (marked.spans, marked.reason, marked.reasons)
    return Picture(
        marked_rows(*numbers, marked.ends.tolist(), [_STAGES.get(s, s) for s in marked.stages], spec.period),
        "Stored rows that are marked, by what was found, over the time that was recorded; the ways to begin states "
        "are not recorded (no figure in the thesis).",
    )
