"""``pneumarm analyse``."""

from pathlib import Path

from pneumarm.analysis import analyse
from pneumarm.commands.common import AnyStore, Json
from pneumarm.console import percent, say, show, table
from pneumarm.files import make_folder, require_output
from pneumarm.progress import progress
from pneumarm.report.run_report import write_analysis
from pneumarm.simulation import Simulation
from pneumarm.transitions import Store


def analyse_(db: AnyStore, sim: Path, /, *, out: Path, json: Json = False) -> None:
    """Draw how good a simulation is: coverage, residues, isoplots, error propagation (thesis section 3.3).

    Parameters
    ----------
    db
        The store.
    sim
        The simulation, from ``pneumarm fit``.
    out
        Folder for the page and its figures; created if it does not exist.
    """
    require_output(out)
    simulation = Simulation.load(sim)
    with Store.open(db) as store, progress("measuring errors"):
        analysis = analyse(store, simulation)
    make_folder(out)
    analysis.save(out)
    with progress("drawing"):
        page = write_analysis(out, simulation.spec, analysis.coverage, analysis.quality, analysis.figures)
    say(f"page: {page}")
    for line in analysis.figures.get("remarks", ()):
        say(line)
    errors = analysis.figures["held_out"]
    rows = [
        (_WORDS[name], *(map(percent, figures.values()) if name == _SHARE else figures.values()))
        for name, figures in errors.items()
    ]
    header = ("one-step error, held out", *(name.replace("_", " ") for name in errors["std"]))
    show(analysis.figures, json, lambda: [table(header, rows)])


_SHARE = "relative_error"
_WORDS = {
    "std": "standard deviation",
    _SHARE: "of the change",
    "mean": "mean",
    "slope": "slope, predicted",
    "calibration": "slope, observed",
}
"""What the statistics are called in the table."""
