"""``pneumarm coverage``."""

from pneumarm.commands.common import AnyStore, Json
from pneumarm.console import show, table
from pneumarm.progress import progress
from pneumarm.simulation.enough import TOO_LITTLE, enough_data
from pneumarm.transitions import Store, Window, new_cells


def coverage_(db: AnyStore, /, *, json: Json = False) -> None:
    """Say how much of the state space a store covers, and whether more would make a simulation of it better.

    Two simulations are fitted, to the first half and to all of it, and compared on sequences that neither knows.

    Parameters
    ----------
    db
        The store.
    """
    with Store.open(db) as store, progress("comparing simulations of a half and of all"):
        found, judged = new_cells(store, Window(store.joints)), enough_data(store)
    result = {
        **found.whole.summary(),
        "new_cells": found.count,
        "new_share": found.share,
        "gain": None if judged is None else judged.gain,
        "enough": judged is not None and judged.enough,
        "verdict": TOO_LITTLE if judged is None else judged.verdict,
    }
    show(result, json, lambda: [table(("coverage", ""), list(result.items()))])
