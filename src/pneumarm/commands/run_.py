"""``pneumarm run``."""

from pathlib import Path
from typing import Annotated

from pneumarm.commands.common import COLUMNS, Json, Settings
from pneumarm.commands.versions_ import say_history
from pneumarm.console import progress, say, show, table
from pneumarm.control.condition import complaints
from pneumarm.run import Run, RunSettings


def run_(
    *,
    out: Path = Path("pneumarm-run"),
    settings: Annotated[RunSettings, Settings] = RunSettings(),
    json: Json = False,
) -> None:
    """Do the whole job: collect, fit, train, test, transfer, report.

    A second call with the same folder goes on where the first was interrupted.

    Parameters
    ----------
    out
        Folder of the run; created if it does not exist.
    """
    results = Run(out, settings, progress).do()
    phases = {
        "in the simulation": results["test"],
        "on arrival": results["transfer"]["before"],
        "after adaptation": results["transfer"]["after"],
    }
    rows = [(name, *[figures[column] for column in COLUMNS]) for name, figures in phases.items()]
    show(results, json, lambda: [table(("", *COLUMNS), rows, title="Ledger")])
    say_history(out)
    for stage, doing in (("collect", "collecting"), ("transfer", "moving")):
        for line in complaints(results[stage], doing):
            say(line)
    seconds = sum(results["wall_seconds"].values())
    say(f"report: {out / 'report.html'}; {seconds:.0f} s, at most {results['peak_memory_mb']:.0f} MB of memory")
