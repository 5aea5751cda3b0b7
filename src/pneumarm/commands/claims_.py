"""``pneumarm claims``."""

from pathlib import Path

from pneumarm.commands.common import Json
from pneumarm.console import say, show, table
from pneumarm.experiments.claims import figures, judge, read_results, sections, summary
from pneumarm.files import write_text
from pneumarm.report.page import render

PAGE = "claims.html"


def claims_(*, out: Path = Path("laboratory"), json: Json = False) -> None:
    """Write the page of the thesis' conclusions and what holds here, from the experiments of a laboratory.

    Nothing is run; experiments without results are listed with the command that makes them.

    Parameters
    ----------
    out
        Folder of the laboratory, as of ``pneumarm experiment``; the page is claims.html in it.
    json
        Print one JSON object on stdout and nothing else there.
    """
    judged = judge(read_results(out))
    page = out / PAGE
    write_text(page, render("The thesis' claims", summary(judged), sections(judged, out)))
    rows = [(each.conclusion.says, each.conclusion.section, each.verdict) for each in judged]
    shown = table(("conclusion of the thesis", "section", "verdict"), rows)
    show({**figures(judged), "page": str(page)}, json, lambda: [shown, *summary(judged)])
    say(f"page: {page}")
