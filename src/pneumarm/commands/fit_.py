"""``pneumarm fit``."""

from pathlib import Path
from typing import Annotated

from pneumarm.commands.common import Json, Settings
from pneumarm.console import progress, show, table
from pneumarm.files import require_folder
from pneumarm.simulation import FitSettings, fit_store
from pneumarm.transitions import Store


def fit_(
    db: Path, /, *, out: Path, settings: Annotated[FitSettings, Settings] = FitSettings(), json: Json = False
) -> None:
    """Fit a simulation to a store and say how well it predicts sequences that it was not fitted to.

    Parameters
    ----------
    db
        The store.
    out
        File of the simulation to write.
    json
        Print one JSON object on stdout and nothing else there.
    """
    require_folder(out)
    with Store.open(db) as store, progress("fitting") as report:
        fitted = fit_store(store, settings, progress=report)
    fitted.simulation.save(out)
    result = fitted.results()
    header = ("one-step error on held-out sequences", *result["std"])
    rows = [("std [counts, counts/ms]", *result["std"].values()), ("relative", *result["relative_error"].values())]
    show(result, json, lambda: [table(header, rows)])
