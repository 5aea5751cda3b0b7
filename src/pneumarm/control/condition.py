"""What a monitor found, and what was counted, for the results of a command and for people."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from pneumarm.arm.counts import Counts
from pneumarm.control.monitor import Finding, Monitor
from pneumarm.transitions import CollectResult

WAYS = {
    "pressure": "inlets kept closed, the muscle read over its limit",
    "inflation": "inlets kept closed, they had been open for too long",
    "angle": "valves kept closed, they push out of the limits of the angle",
    "nonsense": "decisions replaced that were no valves",
    "raised": "decisions replaced because the controller raised an error",
    "late": "decisions replaced because they came late or not at all",
    "vented": "... of all decisions replaced: by venting, not by holding",
}
"""What the guard counts, in plain words."""
LINK = {
    "requests": "requests answered",
    "retries": "requests sent again",
    "silences": "requests without an answer for a control period or longer",
    "foreign": "late or doubled replies, dropped",
    "corrupt": "damaged frames, dropped",
    "losses": "times the line was lost and taken up again",
}
"""What a link counts, in plain words."""
COLLECTING = "collecting"
"""The phase in which transitions are collected."""


@dataclass(frozen=True)
class Condition:
    """What was wrong while an arm moved."""

    findings: tuple[Finding, ...] = ()
    """What the monitor found wrong with the arm."""
    marked: Mapping[str, int] = field(default_factory=dict)
    """How many stored rows are marked, so that nothing is learned from them, by reason."""
    counts: Mapping[str, Counts] = field(default_factory=dict)
    """What guard, control cycle and link counted, by phase."""

    def results(self) -> dict[str, Any]:
        """Return it as in ``results.json``."""
        return {
            "findings": findings_as_dicts(self.findings),
            "marked": dict(self.marked),
            "counts": {phase: counts.as_dict() for phase, counts in self.counts.items()},
        }


def findings_as_dicts(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return findings as plain values, with what each says in one line as ``text``."""
    return [{**asdict(one), "text": str(one)} for one in findings]


def collected_results(collected: CollectResult, watch: Monitor) -> dict[str, Any]:
    """Return what was collected as in ``results.json``, with what ``watch`` found wrong meanwhile."""
    found = Condition(tuple(watch.findings), collected.marked, {COLLECTING: collected.counts})
    return {**asdict(collected), **found.results()}


def complaints(results: Mapping[str, Any], doing: str) -> list[str]:
    """Return the lines in which a command tells what was wrong while it was ``doing`` something to an arm.

    ``results`` are those of :meth:`Condition.results`. What the guard does on any healthy arm, keeping inlets closed
    at the highest pressure, is not told.
    """
    marked = results.get("marked", {})
    findings = (one for one in results.get("findings", []) if isinstance(one, Mapping))  # text in older results
    lines = [f"found while {doing}: {one['text']}{_rows(one, marked)}" for one in findings]
    total = sum((Counts.of(counts) for counts in results.get("counts", {}).values()), Counts())
    if total.interventions.replaced or total.interventions.limited:
        lines.append(f"guard while {doing}: {total.interventions}")
    if total.missed_deadlines:
        lines.append(f"late while {doing}: {total.missed_deadlines:,} control periods")
    if total.link.get("silences"):
        lines.append(f"late board while {doing}: {total.link['silences']:,} {LINK['silences']}")
    if total.link.get("losses"):
        lines.append(f"line lost while {doing}: {total.link['losses']:,} times, and taken up again")
    return lines


def rows_marked(finding: Mapping[str, Any], marked: Mapping[str, int]) -> int:
    """Return how many of the ``marked`` rows a ``finding`` of the results accounts for."""
    known = {name: finding[name] for name in Finding.__dataclass_fields__ if name in finding}
    return marked.get(str(replace(Finding(**known), until=None)), 0)


def _rows(finding: Mapping[str, Any], marked: Mapping[str, int]) -> str:
    rows = rows_marked(finding, marked)
    return f"; {rows:,} rows are marked and nothing is learned from them" if rows else ""
