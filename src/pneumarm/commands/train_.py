"""``pneumarm train``."""

from contextlib import nullcontext
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.table import Table

from pneumarm.arm import ArmSpec
from pneumarm.commands.common import COLUMNS, HEADINGS, AnyStore, Json, Settings
from pneumarm.console import show, table
from pneumarm.errors import UnusableInput
from pneumarm.files import require_folder
from pneumarm.learning import LearnSettings, train
from pneumarm.learning.tensorboard import Scalars
from pneumarm.learning.training import Progress, Training
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
        Of the initial weights, the exploration and the begin states.
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
    result = training.results()
    figures = [
        ("movements in simulation", f"{result['episodes']:,}"),
        ("steps", f"{result['steps']:,}"),
        ("time [s]", f"{training.seconds:.1f}"),
        ("steps a second", f"{result['steps_per_second']:,.0f}"),
        *([("met the criterion", f"{training.met.sum()} of {training.met.size}")] if training.met.size else []),
        ("kept", f"agent {training.best + 1}"),
    ]
    show(result, json, lambda: [table(("trained", ""), figures), _validated(training, simulation.spec)])


def _validated(training: Training[Any], spec: ArmSpec) -> Table:
    """Return how the agents move; of those that settle, how well they do, because what they learn from is a price."""
    if training.agent.settles:
        rows = [
            (
                i + 1,
                made.n,
                f"{made.success.mean():.1%}",
                f"{np.abs(made.goal - made.angle_end).mean() / spec.counts_per_degree:.2f}",
            )
            for i, made in enumerate(training.validation)
        ]
        return table(("agent, in simulation", "movements", "settled", "mean error at the end [deg]"), rows)
    each = [one.results() for one in training.validation]
    rows = [(i + 1, *(one[column] for column in COLUMNS)) for i, one in enumerate(each)]
    return table(("agent, in simulation", *HEADINGS), rows)


def with_agents(settings: Any, agents: int) -> Any:
    """Return the ``settings`` of a method for so many ``agents``.

    Raises:
        UnusableInput: the method has no such setting.

    """
    if "agents" not in {one.name for one in fields(settings)}:
        raise UnusableInput("this method does not train several agents: leave --agents out")
    return replace(settings, agents=agents)
