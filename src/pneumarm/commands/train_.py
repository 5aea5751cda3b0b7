"""``pneumarm train``."""

from contextlib import nullcontext
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

from pneumarm.commands.common import AnyStore, Json, Settings
from pneumarm.commands.figures import reaching_table, settled_in, settling_told
from pneumarm.console import show, table
from pneumarm.errors import UnusableInput
from pneumarm.files import require_folder
from pneumarm.learning import LearnSettings, train
from pneumarm.learning.tensorboard import Scalars
from pneumarm.learning.training import Progress
from pneumarm.progress import progress
from pneumarm.simulation import Simulation
from pneumarm.task import begin_states
from pneumarm.transitions import Store


def train_(
    sim: Path,
    db: AnyStore,
    /,
    *,
    out: Path,
    seed: int = 0,
    agents: int | None = None,
    tensorboard: Path | None = None,
    settings: Annotated[LearnSettings, Settings] = LearnSettings(),
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
        File of the agent to write; it contains all that it needs.
    seed
        Random seed of initial weights, exploration and begin states.
    agents
        Agents trained at once, of which the best is kept; by default as many as the method's settings say.
    tensorboard
        Folder to write the curves into while it learns, for `tensorboard --logdir`.
    """
    require_folder(out)
    chosen = settings.chosen if agents is None else with_agents(settings.chosen, agents)
    simulation = Simulation.load(sim)
    with Store.open(db) as store:
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
    with progress("training") as report, nullcontext() if tensorboard is None else Scalars(tensorboard) as scalars:

        def tell(now: Progress) -> None:
            report(round(1000 * now.share), 1000)
            if scalars is not None:
                scalars.write(now)

        training = train(
            simulation,
            begin,
            chosen,
            seed,
            method=settings.found,
            progress=tell,
        )
        if scalars is not None:
            scalars.write(training)
    training.agent.save(out)
    settle = settled_in(simulation, training.agent, seed)
    result = training.results() | {"settle": settle}
    figures = [
        ("movements in simulation", f"{result['episodes']:,}"),
        ("steps", f"{result['steps']:,}"),
        ("time [s]", f"{training.seconds:.1f}"),
        ("steps a second", f"{result['steps_per_second']:,.0f}"),
        *([("met the criterion", f"{training.met.sum()} of {training.met.size}")] if training.met.size else []),
        ("kept", f"agent {training.best + 1}"),
    ]
    each = {f"agent {i + 1}, in simulation": one.results() for i, one in enumerate(training.validation)}
    moves = settling_told(settle) if settle else [reaching_table(each, trained_for=True)]
    show(result, json, lambda: [table(("trained", ""), figures), *moves])


def with_agents(settings: Any, agents: int) -> Any:
    """Return the ``settings`` of a method for so many ``agents``.

    Raises:
        UnusableInput: the method has no such setting.

    """
    if "agents" not in {one.name for one in fields(settings)}:
        raise UnusableInput("this method does not train several agents: leave --agents out")
    return replace(settings, agents=agents)
