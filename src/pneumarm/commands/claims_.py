"""``pneumarm claims``."""

from pathlib import Path

from rich.table import Table

from pneumarm.commands.common import Json
from pneumarm.console import say, show
from pneumarm.experiments.claims import HEADER, Judged, claims_figures, evidence, summary
from pneumarm.experiments.claims.page import PAGE, ROWS, TITLE, judged_rows, publish, sections
from pneumarm.experiments.claims.running import Size, Sizes, publish_rows, rows_by_kind, run
from pneumarm.files import write_text
from pneumarm.progress import progress
from pneumarm.report.page import render

HTML = "claims.html"


def claims_(
    *,
    out: Path = Path("laboratory"),
    size: Size | None = None,
    published: Path | None = None,
    workers: int | None = None,
    dask: str | None = None,
    json: Json = False,
) -> None:
    """Show what the thesis claims beside what was found here, and write a page of it.

    Everything is taken from the rows of a laboratory; experiments without rows are named. With --size all are
    run first, on arms like the thesis', far from it, and of other physics; a second call goes on from there.

    Parameters
    ----------
    out
        Folder of the laboratory, as of ``pneumarm experiment``; the page is claims.html in it.
    size
        Run all experiments: pilot on five arms of each kind, full on as many as the pilot says that it takes.
    published
        Folder for claims.md, its pictures, and in claims/rows the rows of complete arms, which it is made of.
    workers
        Rows computed at once; by default as many as there are cores.
    dask
        Address of the scheduler of a dask cluster, such as tcp://127.0.0.1:8786, to compute there.
    """
    if size is not None:
        run(Sizes(size, workers=workers, dask=dask), out, (published or out) / ROWS, progress, say)
    if published is not None:
        publish_rows(out, published / ROWS)
        others = publish(published)
        say(f"page: {published / PAGE}")
        if others:
            say(f"believe.toml: the rows say otherwise of {', '.join(sorted(set(others)))}; write these anew")
    judged, kinds = judged_rows(rows_by_kind(out))
    page = out / HTML
    write_text(page, render(TITLE, summary(judged), sections(judged, kinds)))
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
