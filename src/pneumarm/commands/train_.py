"""``pneumarm train``."""

from pathlib import Path
from typing import Annotated

from pneumarm.commands.common import Json, Settings
from pneumarm.console import progress, show, table
from pneumarm.files import require_folder
from pneumarm.learning import TrainSettings, begin_states, train
from pneumarm.simulation import Simulation
from pneumarm.transitions import Store


def train_(
    sim: Path,
    db: Path,
    /,
    *,
    out: Path,
    seed: int = 0,
    settings: Annotated[TrainSettings, Settings] = TrainSettings(),
    json: Json = False,
) -> None:
    """Train agents in a simulation and keep the best.

    Parameters
    ----------
    sim
        The simulation, from ``pneumarm fit``.
    db
        The store, which the begin states are drawn from.
    out
        File of the agent to write; it needs neither of the others then.
    seed
        Of the initial weights, the exploration and the begin states.
    json
        Print one JSON object on stdout and nothing else there.
    """
    require_folder(out)
    simulation = Simulation.load(sim)
    with Store.open(db) as store:
        begin = begin_states(store, simulation.window, simulation.scaling)
    with progress("training") as report:
        training = train(
            simulation, begin, settings, seed, progress=lambda now: report(round(1000 * now.share), 1000)
        )
    training.agent.save(out)
    result = training.results()
    show(result, json, lambda: [table(("trained", ""), list(result.items()))])
