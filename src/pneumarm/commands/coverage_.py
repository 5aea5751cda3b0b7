"""``pneumarm coverage``."""

from pathlib import Path

from pneumarm.commands.common import Json
from pneumarm.console import show, table
from pneumarm.transitions import Store, Window, enough_data


def coverage_(db: Path, /, *, json: Json = False) -> None:
    """Say how much of the state space a store covers, and whether its second half still found anything new.

    Parameters
    ----------
    db
        The store.
    """
    with Store.open(db) as store:
        found = enough_data(store, Window(store.joints))
    result = {
        **found.whole.summary(),
        "new_cells": found.new_cells,
        "new_share": found.share,
        "enough": found.enough,
        "verdict": found.verdict,
    }
    show(result, json, lambda: [table(("coverage", ""), list(result.items()))])
