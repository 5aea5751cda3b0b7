"""``pneumarm taguchi analyse``."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.table import Table

from pneumarm.commands.common import Json
from pneumarm.console import say, show, table
from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.analysis import Goal, TableAnalysis, analyse_table
from pneumarm.experiments.design.assignment import load_design, thesis_design, unnamed
from pneumarm.experiments.design.table import read_table
from pneumarm.files import make_folder, write_text


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

    Without a design the effects of the columns of L16 are shown, and no best settings: nobody said what was on them.

    Parameters
    ----------
    results
        Comma-separated values with the header trial,run 1,...,run n.
    goal
        Which results are good: larger or smaller ones.
    design
        TOML file of the design: array, factors, interactions (docs/how-to/experiments.md has one). In JSON L16 has
        by default factors a to e on the columns 1, 2, 4, 11 and 12 (thesis table 5.3).
    columns
        How the headings of the columns to use begin; by default those that begin with run, or all.
    confirmation
        A table with one row: runs made with the derived settings, compared with what the effects predict. It needs a
        design.
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
    shown = analysis if design else analyse_table(replace(chosen, factors=()), read.results, goal)
    figures = analysis.figures()
    said = []
    if confirmation is not None:
        if design is None and not json:
            raise UnusableInput(f"{confirmation}: without --design there are no best settings to confirm; give it")
        observed = read_table(confirmation, columns).results
        if len(observed) != 1:
            raise UnusableInput(f"{confirmation}: expected one row, the runs of one trial, got {len(observed)}")
        compared = analysis.confirm(observed[0])
        figures["confirmation"] = vars(compared)
        said.append(
            f"Confirmation: the effects predict {compared.low:.4g} to {compared.high:.4g}, "
            f"{compared.observed:.4g} was found: {'confirmed' if compared.confirmed else 'not confirmed'}"
        )
    if out is not None:
        _write(shown, out, quantity, results)
    show(figures, json, lambda: [*_tables(shown), *said])


def _write(analysis: TableAnalysis, out: Path, quantity: str, results: Path) -> None:
    from pneumarm.experiments.design.table_sections import table_sections
    from pneumarm.report.page import render

    make_folder(out)
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
    effects = table(header, rows, title="Columns by effect")
    if not analysis.design.factors:
        return [effects, "A design, --design FILE, says what is on the columns; then there are best settings, too."]
    best = analysis.best
    settings = ", ".join(f"{analysis.design.factor(label).name} {level}" for label, level in best.settings.items())
    which = f"trial {best.trial}" if best.trial else "none of the trials: confirm them"
    return [effects, f"Best settings by rank: {settings} ({which})"]
