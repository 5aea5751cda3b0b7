"""``pneumarm test``."""

from pathlib import Path

from pneumarm.commands.common import AnyStore, Json, OwnMethod
from pneumarm.commands.figures import reaching_table, settled_in, settling_told
from pneumarm.console import show
from pneumarm.control import open_agent
from pneumarm.learning import LOOKING_AHEAD, results_with_lookahead, test_ahead
from pneumarm.learning import test as test_agent
from pneumarm.progress import progress
from pneumarm.simulation import Simulation
from pneumarm.task import begin_states
from pneumarm.transitions import Store


def test_(
    agent: Path,
    sim: Path,
    db: AnyStore,
    /,
    *,
    episodes: int = 10_000,
    seed: int = 0,
    method: OwnMethod = None,
    json: Json = False,
) -> None:
    """Test an agent in a simulation: greedy, not learning, from all begin states to all goals.

    An agent that settles at goals and holds them is first tested at that ("settle"), at 40 goals. All agents reach
    goals, the thesis' task. A goal counts as reached, a success, at a reading after at least one action where every
    joint is within 25 counts of it and not faster than 1 count/ms, unless it was trained with other tolerances.

    An agent that looks ahead on an arm is tested without lookahead, and then with it on the first 500 movements
    ("lookahead"). The latter is what would move the arm, but it takes a hundred times as long.

    Parameters
    ----------
    agent
        The agent, from ``pneumarm train``.
    sim
        The simulation, from ``pneumarm fit``.
    db
        The store, which the begin states are drawn from.
    episodes
        How many movements (thesis section 5.2: 10,000).
    seed
        Random seed of begin states, goals and noise.
    method
        The method that trained it, MODULE:NAME, if that is one of your own that is not installed.
    """
    trained, simulation = open_agent(agent, method), Simulation.load(sim)
    with Store.open(db) as store:
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
    with progress("testing"):
        tested = test_agent(trained, simulation, begin, episodes, seed)
        ahead = test_ahead(trained, simulation, begin, min(episodes, LOOKING_AHEAD), seed)
        settle = settled_in(simulation, trained, seed)
    result = results_with_lookahead(tested, ahead) | {"settle": settle}
    made = {"in the simulation": result} | ({"looking ahead": result["lookahead"]} if ahead else {})
    settling = settling_told(settle) if settle else []
    show(result, json, lambda: [*settling, reaching_table(made, trained_for=settle is None)])
