"""What an experiment leaves: its page and its results as JSON, drawn from the rows alone."""

import re
from collections.abc import Sequence
from pathlib import Path

from pneumarm.console import jsonable
from pneumarm.experiments.experiment import Analysis, Claim, Experiment
from pneumarm.files import write_json, write_text
from pneumarm.report.page import Section, Table, render

_HYPHEN = re.compile(r"(?<!\w)-(?=\d)")
"""In the place of a minus."""
PAGE = "page.html"
RESULTS = "results.json"


def write_page(experiment: Experiment, folder: Path, analysis: Analysis, runs: int, arms: tuple[str, ...]) -> Path:
    """Write ``page.html`` and ``results.json`` to ``folder`` and return the path of the page."""
    claims = [
        {"claim": c.text, "thesis": c.thesis, "ours": c.ours, "verdict": c.verdict, "about": c.about}
        for c in analysis.claims
    ]
    of = {"experiment": experiment.name, "arms": list(arms), "runs": runs}
    write_json(folder / RESULTS, jsonable({**analysis.figures, **of, "claims": claims}))
    of_trials = f"{_many(runs, 'run')} of {_many(len(experiment.trials), 'trial')}"
    where = f"{experiment.words.source}. {of_trials} on {_listed(arms)}."
    sections = [*analysis.sections]
    summary = [*analysis.summary, where]
    if analysis.claims:
        summary.insert(0, _count(analysis.claims))
        rows = [[_HYPHEN.sub("−", cell) for cell in (c.text, c.thesis, c.ours, c.verdict)] for c in analysis.claims]
        table = Table(
            ["claim", "thesis", "here", "verdict"], rows, "What the thesis found, and what holds here.", words=True
        )
        sections.insert(0, Section("Claims", tables=[table]))
    page = folder / PAGE
    write_text(page, render(experiment.words.title, summary, sections))
    return page


def _listed(arms: Sequence[str]) -> str:
    return ("; " if any("," in arm for arm in arms) else ", ").join(arms)


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _count(claims: Sequence[Claim]) -> str:
    """Say in words how many claims hold."""
    holding, refuted, left = (
        sum(claim.verdict == verdict for claim in claims) for verdict in ("holds", "does not hold", "open")
    )
    said = (
        f"{holding} of {len(claims)} claims of the thesis hold here, {refuted} {'does' if refuted == 1 else 'do'} not"
    )
    return said + (f", and {left} {'is' if left == 1 else 'are'} open: 95 % intervals allow both." if left else ".")
