"""``pneumarm analyse``."""

from pathlib import Path

from pneumarm.analysis import analyse
from pneumarm.commands.common import Json
from pneumarm.console import progress, say, show, table
from pneumarm.simulation import Simulation
from pneumarm.transitions import Store


def analyse_(db: Path, sim: Path, /, *, out: Path, json: Json = False) -> None:
    """Draw how good a simulation is: coverage, residues, isoplots, error propagation (thesis section 3.3).

    Example: ``pneumarm analyse arm.db arm.sim --out quality``

    Parameters
    ----------
    db
        The store.
    sim
        The simulation, from ``pneumarm fit``.
    out
        Folder for the page and its figures; made where there is none.
    json
        Print one JSON object on stdout and nothing else there.
    """
