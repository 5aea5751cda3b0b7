"""``pneumarm taguchi analyse``."""

from pathlib import Path
from typing import Any

from rich.table import Table

from pneumarm.commands.common import Json
from pneumarm.console import say, show, table
from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.analysis import Goal, TableAnalysis, analyse_table
from pneumarm.experiments.design.assignment import load_design, thesis_design, unnamed
from pneumarm.experiments.design.table import read_table
from pneumarm.files import require_folder, write_text


def analyse_(
    results: Path,
    /,
    *,
    goal: Goal = "larger",
    design: Path | None = None,
    columns: str | None = None,
    confirmation: Path | None = None,
    quantity: str = "result",
    out: Path | None = None,
    json: Json = False,
) -> None:
    """Analyse a table of trials and runs by the design of its experiment.

    Parameters
    ----------
    results
        Comma-separated values with the header trial,run 1,...,run n.
    goal
        Which results are good: larger or smaller ones.
    design
        TOML file of the design: array, factors, interactions; by default L16 with factors a to e on
        the columns 1, 2, 4, 11 and 12 (thesis table 5.3).
    columns
        How the headings of the columns to use begin; by default those that begin with run, or all.
    confirmation
        A table with one row: runs made with the derived settings, compared with what the effects predict.
    quantity
        What the results are, for the pictures.
    out
        Folder for page.html; created if it does not exist.
    """
    read = read_table(results, columns)
    chosen = load_design(design) if design else unnamed(thesis_design())
    if len(read.results) != chosen.array.trials:
        raise UnusableInput(
            f"{results}: {chosen.array.name} needs {chosen.array.trials} trials, got {len(read.results)}; give the "
            "design of the experiment with --design"
        )
    analysis = analyse_table(chosen, read.results, goal)
    figures = analysis.figures()
    if confirmation is not None:
        observed = read_table(confirmation, columns).results
        if len(observed) != 1:
            raise UnusableInput(f"{confirmation}: expected one row, the runs of one trial, got {len(observed)}")
        figures["confirmation"] = vars(analysis.confirm(observed[0]))
    if out is not None:
        _write(analysis, out, quantity, results)
    show(figures, json, lambda: _tables(analysis))


def _write(analysis: TableAnalysis, out: Path, quantity: str, results: Path) -> None:
    from pneumarm.experiments.design.table_sections import table_sections
    from pneumarm.report.page import render

    require_folder(out)
    out.mkdir(exist_ok=True)
    summary = [f"{results.name}: {len(analysis.results)} trials of {analysis.results.shape[1]} runs."]
    write_text(out / "page.html", render("Analysis of an experiment", summary, table_sections(analysis, quantity)))
    say(f"page: {out / 'page.html'}")


def _tables(analysis: TableAnalysis) -> list[Table | str]:
    names = [name for name in ("mean", "std") if name in analysis.effects]
    rows = []
    for rank in range(analysis.design.array.columns):
        row: list[Any] = [rank + 1]
        for name in names:
            column = analysis.effects[name].ranking[rank]
            size = float(analysis.effects[name].sizes[column - 1])
            row += [analysis.names[column - 1], size]
        rows.append(row)
    header = ("rank", *(part for name in names for part in (name, "effect")))
    best = analysis.best
    settings = ", ".join(f"{analysis.design.factor(label).name} {level}" for label, level in best.settings.items())
    which = f"trial {best.trial}" if best.trial else "none of the trials: confirm them"
    return [table(header, rows, title="Columns by effect"), f"Best settings by rank: {settings} ({which})"]
