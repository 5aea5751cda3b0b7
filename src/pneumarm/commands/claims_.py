"""``pneumarm claims``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from pneumarm.commands.common import Json
from pneumarm.console import say, show
from pneumarm.experiments.claims import (
    HEADER,
    Judged,
    as_markdown,
    claims_figures,
    evidence,
    judge,
    read_all_results,
    sections,
    summary,
)
from pneumarm.files import write_text
from pneumarm.report.page import render

PAGE = "claims.html"


def claims_(
    *, out: Path = Path("laboratory"), markdown: Annotated[bool, Parameter(negative="")] = False, json: Json = False
) -> None:
    """Show what the thesis claims beside what was found here, and write a page of it.

    Everything is taken from the experiments of a laboratory; nothing is run. Experiments without results are listed
    with the command that makes them.

    Parameters
    ----------
    out
        Folder of the laboratory, as of ``pneumarm experiment``; the page is claims.html in it.
    markdown
        Print the table as Markdown, for a note or a paper.
    """
    judged = judge(read_all_results(out))
    page = out / PAGE
    write_text(page, render("The thesis' claims", summary(judged), sections(judged, out)))
    if markdown and not json:
        print(as_markdown(judged))
    else:
        show({**claims_figures(judged), "page": str(page)}, json, lambda: [*_tables(judged), *summary(judged)])
    say(f"page: {page}")


def _tables(judged: list[Judged]) -> list[Table | str]:
    """Return a table a conclusion, its verdict in the title; those that were not tested in one line each."""
    shown: list[Table | str] = []
    for each in judged:
        title = f"{each.conclusion.section}: {each.conclusion.says} {each.verdict.upper()}"
        if not each.claims:
            shown.append(title)
            continue
        built = Table(*HEADER, title=title, title_justify="left", title_style="bold", expand=True)
        for line in evidence(each):
            built.add_row(*line)
        shown.append(built)
    return shown
