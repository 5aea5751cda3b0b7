"""``pneumarm coverage``."""

from pneumarm.commands.common import AnyStore, Json
from pneumarm.console import say, show, table
from pneumarm.progress import progress
from pneumarm.simulation.enough import TOO_LITTLE, enough_data
from pneumarm.transitions import Store, Window, new_cells
from pneumarm.transitions.filtering import NEW_CELLS


def coverage_(db: AnyStore, /, *, json: Json = False) -> None:
    """Say how much of the state space a store covers, and whether more would make a simulation of it better.

    Two simulations are fitted, to the first half and to all of it, and compared on sequences that neither knows.

    Parameters
    ----------
    db
        The store.
    """
    with Store.open(db) as store, progress("comparing simulations of a half and of all"):
        used, marked = store.drawn(), store.marked_rows()
        for line in (*used.used, *(f"{count:,} rows marked: {reason}" for reason, count in marked.items())):
            say(line)
        found, judged = new_cells(used, Window(store.joints)), enough_data(used)
    result = {
        **found.whole.summary(),
        "new_cells": found.count,
        "new_share": found.share,
        "gain": None if judged is None else judged.gain,
        "enough": judged is not None and judged.enough,
        "verdict": TOO_LITTLE if judged is None else judged.verdict,
        **({"remarks": used.used} if used.used else {}),
        **({"marked": marked} if marked else {}),
    }
    whole = found.whole
    rows = [
        ("transitions", f"{whole.seen:,}"),
        ("kept by the filter", f"{whole.kept:,}"),
        ("cells of the state space seen", f"{whole.occupied:,} of {whole.cells:,}"),
        ("full cells", f"{whole.full:,}"),
        ("new in the second half", f"{found.count:,} cells, {found.share:.0%} of those seen"),
        ("chance that the next one is new", f"{whole.unseen:.0%}"),
    ]
    verdict = str(result["verdict"])
    why = [NEW_CELLS] if result["enough"] else []
    show(result, json, lambda: [verdict[0].upper() + verdict[1:], table(("", ""), rows), *why])
