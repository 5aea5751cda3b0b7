"""What an experiment leaves: its page and its results as JSON, from the rows and what was recorded of its arms."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pneumarm.console import jsonable
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Analysis, Claim, Experiment, TrialRows
from pneumarm.experiments.preparation import SETTINGS, STORE
from pneumarm.experiments.sweep import arm_folder
from pneumarm.experiments.verdict import counted
from pneumarm.files import read_json, write_json, write_text
from pneumarm.report.page import Section, Table, render
from pneumarm.report.playing import playing
from pneumarm.report.shown import read_shown

_HYPHEN = re.compile(r"(?<!\w)-(?=\d)")
"""Hyphen in the place of a minus."""
PAGE = "page.html"
RESULTS = "results.json"
RULES = (
    "A claim holds where the whole 95 % interval lies between the bounds that were stated, and is refuted where all "
    "of it lies outside: two one-sided tests at 2.5 % each. A direction is also refuted where the size that matters "
    "is ruled out. Arms are the sample; means and medians of the runs on each arm must agree, or it holds in part."
)
_SHOWN = 12.0
"""Seconds of an arm's recording that the page plays."""


class Results(NamedTuple):
    """What the rows of an experiment say of the thesis."""

    experiment: str
    arms: tuple[str, ...]
    runs: int
    """On each arm."""
    claims: tuple[Claim, ...]

    @property
    def sample(self) -> str:
        """Arms and runs in words."""
        return f"{_many(len(self.arms), 'arm')}, {_many(len(self.arms) * self.runs, 'run')}"


def claim_row(claim: Claim) -> list[str]:
    """Return a ``claim`` as a line of a table: itself, stated beforehand, thesis, ours, by the medians, verdict."""
    cells = claim.text, claim.criterion.stated(), claim.thesis, claim.ours, claim.medians, claim.explained
    return [_HYPHEN.sub("−", cell) for cell in cells]


def claim_figures(claim: Claim) -> dict[str, Any]:
    """Return a ``claim`` for programs."""
    names = ("claim", "stated", "thesis", "ours", "medians")
    return {**dict(zip(names, claim_row(claim), strict=False)), "about": claim.about, **claim.judgement._asdict()}


def write_page(experiment: Experiment, folder: Path, analysis: Analysis, rows: TrialRows) -> Path:
    """Write ``page.html`` and ``results.json`` to ``folder``, one of a laboratory; return the path of the page."""
    arms, runs = rows.arms, rows.runs
    of = {"experiment": experiment.name, "arms": list(arms), "runs": runs}
    claims = [claim_figures(claim) for claim in analysis.claims]
    write_json(folder / RESULTS, jsonable({**analysis.figures, **of, "claims": claims}))
    of_trials = f"{_many(runs, 'run')} of {_many(len(experiment.trials), 'trial')}"
    where = f"{experiment.words.source}. {of_trials} on {_listed(arms)}."
    sections = [*analysis.sections]
    summary = [*analysis.summary, where]
    if analysis.claims:
        summary.insert(0, f"{counted([c.verdict for c in analysis.claims], 'claim').capitalize()}.")
        lines = [claim_row(claim) for claim in analysis.claims]
        header = ["claim", "stated beforehand", "thesis", "here", "by the medians", "verdict"]
        table = Table(header, lines, "What the thesis found, and what holds here.", words=True)
        sections.insert(0, Section("Claims", [RULES], tables=[table]))
    if len(arms) == 1:
        summary.insert(0, f"All of it is true of {arms[0]} alone, and of this recording of it: no verdict is firmer.")
    page = folder / PAGE
    opening = [seen for arm in arms[:1] if (seen := _recorded(folder.parent, arm)) is not None]
    write_text(page, render(experiment.words.title, summary, [*opening, *sections]))
    return page


def _recorded(laboratory: Path, arm: str) -> Section | None:
    """Return ``arm`` moving as it was recorded for experiments; None where no recording is left.

    Recordings of arms that were made from it, such as one of its joints alone, lie beside its own.
    """
    for store in sorted(arm_folder(laboratory, arm).rglob(STORE)):
        if _arm_of(store) != arm:
            continue
        try:
            shown = read_shown(store, seconds=_SHOWN)
        except UnusableInput:
            continue
        caption = f"{arm}, as it was recorded to learn its simulation from."
        return Section("How the arm moved", (), [playing(shown, caption)], opens=True)
    return None


def _arm_of(store: Path) -> str | None:
    """Return the name of the arm that ``store`` was recorded on; None where the settings beside it do not say."""
    try:
        return str(read_json(store.with_name(SETTINGS), "settings")["arm"])
    except (UnusableInput, KeyError):
        return None


def _listed(arms: Sequence[str]) -> str:
    return ("; " if any("," in arm for arm in arms) else ", ").join(arms)


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"
