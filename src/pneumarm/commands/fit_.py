"""``pneumarm fit``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pneumarm.arm.seam import unit_of
from pneumarm.commands.common import AnyStore, Json, Settings
from pneumarm.console import percent, say, show, table
from pneumarm.files import require_folder
from pneumarm.progress import progress
from pneumarm.simulation import FitSettings, fit_store
from pneumarm.transitions import Store


def fit_(
    db: AnyStore, /, *, out: Path, settings: Annotated[FitSettings, Settings] = FitSettings(), json: Json = False
) -> None:
    """Fit a simulation to a store and say how well it predicts sequences that it was not fitted to.

    Parameters
    ----------
    db
        The store.
    out
        File of the simulation to write.
    """
    require_folder(out)
    with Store.open(db) as store, progress("fitting") as report:
        fitted = fit_store(store, settings, progress=report)
    fitted.simulation.save(out)
    result = fitted.results()
    for line in fitted.result.remarks:
        say(line)
    further, relative = fitted.simulation.window.further, result["relative_error"]
    header = ("one-step error on held-out sequences", "std", "in", "of its change")
    rows = [(name, std, _unit(name, further), percent(relative[name])) for name, std in result["std"].items()]
    show(result, json, lambda: [table(header, rows)])


def _unit(name: str, further: Sequence[str]) -> str:
    """Return the unit of a quantity, or of what the further sensor called ``name`` says."""
    if name in further:
        return unit_of(name)
    return "counts/ms" if name == "velocity" else "counts"
