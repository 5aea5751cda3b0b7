"""Where recurrence pays: networks that evolve seeing less and less, with and without a memory of their own.

python -m benchmarks evolution

An arm of the distribution is recorded and simulated; the method esp evolves networks that see all of the state, or
no history, no velocity, no pressures, each with recurrent units and without. The best then moves the arm itself,
learning nothing. Settings come from the environment:

PNEUMARM_EVOLUTION_ARMS         seeds of virtual arms, "1"; the held-out arms are 1001 to 1010
PNEUMARM_EVOLUTION_SEEDS        seeds of the evolution, "0,1,2"
PNEUMARM_EVOLUTION_GENERATIONS  generations of each, by default as many as the settings say
PNEUMARM_EVOLUTION_MOVEMENTS    movements on the arm for each network, 200
PNEUMARM_EVOLUTION_FOLDER       where collected stores are kept; a temporary folder by default
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks import _environment as environment
from benchmarks._trials import collected, fitted, greedy_movements
from pneumarm.learning import test, train
from pneumarm.learning.evolution import EvolutionSettings

TRANSITIONS = 100_000
SEEN = {
    "all": {"history": True},
    "no history": {"history": False},
    "nor velocity": {"history": False, "velocity": False},
    "nor pressures": {"history": False, "velocity": False, "pressures": False},
}
"""What networks see of the state."""


def measure() -> Iterator[str]:
    """Yield a line for each kind of network: mean, lowest and highest success and reward of the seeds."""
    arms = environment.seeds("PNEUMARM_EVOLUTION_ARMS", "1")
    seeds = environment.seeds("PNEUMARM_EVOLUTION_SEEDS", "0,1,2")
    usual = EvolutionSettings()
    generations = environment.whole("PNEUMARM_EVOLUTION_GENERATIONS", usual.generations)
    movements = environment.whole("PNEUMARM_EVOLUTION_MOVEMENTS", 200)
    with environment.kept_folder("PNEUMARM_EVOLUTION_FOLDER") as folder:
        known = {}
        for arm in arms:
            store = folder / f"arm-{arm}.db"
            if not store.exists():
                collected(store, arm, arm, TRANSITIONS)
            known[arm] = fitted(store, arm)
        yield f"{'sees':14}{'recurrent':>10}   success and reward in simulation; on the arm"
        for seen, options in SEEN.items():
            for recurrent in (True, False):
                settings = replace(usual, generations=generations, recurrent=recurrent, **options)
                found = []
                for arm, (made, begin) in known.items():
                    for seed in seeds:
                        agent = train(made.simulation, begin, settings, seed).agent
                        simulated = test(agent, made.simulation, begin, 2_000, 0)
                        numbers = range(movements)
                        moved = greedy_movements(agent, arm, made.simulation.goal_range, numbers, 0)
                        found.append(
                            (
                                simulated.success.mean(),
                                simulated.reward.mean(),
                                np.mean([one.success for one in moved]),
                                np.mean([one.reward for one in moved]),
                            )
                        )
                success, reward, there, earned = (spread(column) for column in np.array(found).T)
                yield f"{seen:14}{'yes' if recurrent else 'no':>10}   {success}, {reward}; {there}, {earned}"


def spread(values: NDArray[np.float64]) -> str:
    """Return mean and range of ``values`` (n,) in words."""
    return f"{values.mean():.2f} ({values.min():.2f} to {values.max():.2f})"
