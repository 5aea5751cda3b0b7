"""All methods side by side on arms of the distribution: collect, fit, train, then move on the arm, learning nothing.

All baselines get the same begin states and goals. Settings come from the environment:

PNEUMARM_AGENTS_ARMS       seeds of virtual arms, "1,2,3" by default; the held-out arms are 1001 to 1010
PNEUMARM_AGENTS_SEEDS      seeds of the training, "1,2"
PNEUMARM_AGENTS_METHODS    "policy,batched,sarsa"; "policy-greedy" is the policy without lookahead
PNEUMARM_AGENTS_MOVEMENTS  greedy movements on the arm for each agent, 500
PNEUMARM_AGENTS_FOLDER     where collected stores and simulations are kept; a temporary folder by default

Seconds of training are wall time with validation; decision times are processor time at the 99th percentile.
"""

import re
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import _environment as environment
from pneumarm.arm import ControlCycle, Reading, guarded, open_arm
from pneumarm.control import AgentController, drawn, make_movements
from pneumarm.experiments import there_and_back
from pneumarm.experiments.there_and_back import Recipe
from pneumarm.learning import AnyAgent, LearnSettings, PolicySettings, Training, test, train
from pneumarm.simulation import SINGLE_STEPS, FitSettings, Simulation, fit_store
from pneumarm.task import BeginStates, Movement, begin_states
from pneumarm.task.movements import of_rows
from pneumarm.transitions import KINDS, CollectSettings, Store

TRANSITIONS = 200_000
SEED_OF_MOVEMENTS = 0
STILL, NEAR = 0.2, 4.0
"""Degrees within which an arm stands still, and within which it is near its goal."""
KINDS_OF_FAILURE = tuple(
    f"{how} {where} the goal" for how in ("stands still", "moves about") for where in ("near", "far from")
)
HEADER = (
    f"{'arm':6}{'seed':>5} {'method':14}{'train':>7}{'in simulation':>15}{'on the arm':>17}{'success':>22}"
    f"{'actions':>9}{'switches':>9}{'p99':>9}"
)


def measure() -> Iterator[str]:
    arms = environment.seeds("PNEUMARM_AGENTS_ARMS", "1,2,3")
    seeds = environment.seeds("PNEUMARM_AGENTS_SEEDS", "1,2")
    methods = environment.words("PNEUMARM_AGENTS_METHODS", "policy,batched,sarsa")
    movements = environment.whole("PNEUMARM_AGENTS_MOVEMENTS", 500)
    found: dict[str, list[tuple[dict[str, Any], Training[Any]]]] = {method: [] for method in methods}
    failures: dict[str, Counter[str]] = {method: Counter() for method in methods}
    yield HEADER
    with environment.kept_folder("PNEUMARM_AGENTS_FOLDER") as folder:
        for arm in arms:
            simulation, begin = prepared(folder, f"virtual:seed={arm}")
            degrees = simulation.spec.degrees
            for seed in seeds:
                for method in methods:
                    trained = train_by(method, simulation, begin, seed)
                    simulated = test(trained.agent, simulation, begin).reward.mean()
                    made, p99 = greedy_movements(trained.agent, arm, movements)
                    figures = of_rows(one.row() for one in made).results()
                    found[method].append((figures, trained))
                    failures[method].update(
                        kind(degrees(one.recorded.angle), degrees(one.goal)) for one in made if not one.success
                    )
                    yield row(arm, seed, method, trained, simulated, figures, p99)
    for method, each in found.items():
        yield total(method, each, failures[method])


def prepared(
    folder: Path, arm: str, minutes: float = 0.0, settings: FitSettings = SINGLE_STEPS, recording: int = 0
) -> tuple[Simulation, BeginStates]:
    """Return the simulation of an arm and its begin states; collect and fit where that is not done yet.

    It is recorded for so many ``minutes`` of its time, or for :data:`TRANSITIONS`, and fitted by ``settings``; a
    ``folder`` has fits of one kind, and one ``recording`` of an arm.
    """
    db, seed = store_of(folder, arm), seed_of(arm) + recording
    file = db.with_suffix(".sim")
    if not file.exists():
        recipe = Recipe(0 if minutes else TRANSITIONS, minutes, collect=CollectSettings(pulses=0.0))
        there_and_back.collect_until(db, arm, seed, recipe)
        with Store.open(db) as store:
            fit_store(store, replace(settings, seed=seed)).simulation.save(file)
    simulation = Simulation.load(file)
    with Store.open(db) as store:
        return simulation, begin_states(
            store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec
        )


def store_of(folder: Path, arm: str) -> Path:
    """Return where what was recorded on ``arm`` is kept."""
    return folder / f"{re.sub(r'[^0-9A-Za-z.]+', '-', arm)}.db"


def seed_of(arm: str) -> int:
    """Return the seed that the arm's name holds, and 0 where it holds none."""
    found = re.search(r"\bseed=(\d+)", arm)
    return int(found[1]) if found else 0


def train_by(method: str, simulation: Simulation, begin: BeginStates, seed: int) -> Training[Any]:
    if method == "policy-greedy":
        return train(simulation, begin, PolicySettings(lookahead=0), seed)
    return train(simulation, begin, LearnSettings(method=method).chosen, seed)


class Timed(AgentController):
    """A controller that notes the processor time of its decisions."""

    def __init__(self, agent: AnyAgent) -> None:
        super().__init__(agent)
        self.seconds: list[float] = []

    def act(self, reading: Reading) -> NDArray[np.int8]:
        began = time.thread_time()
        valves = super().act(reading)
        self.seconds.append(time.thread_time() - began)
        return valves


def greedy_movements(agent: AnyAgent, arm: int, movements: int) -> tuple[list[Movement], float]:
    """Return movements on a virtual arm, and the processor time of a decision at the 99th percentile [ms]."""
    controller = Timed(agent)
    controller.reset(agent.goal_range.mean(axis=1))
    with open_arm(f"virtual:seed={arm}", 1000 + arm) as opened:
        cycle = ControlCycle(guarded(opened))
        controller.act(cycle.arm.read())  # compiles
        draws = drawn(agent.goal_range, SEED_OF_MOVEMENTS, range(movements))
        made = list(make_movements(cycle, controller, agent.settings, draws, velocity=agent.window.velocity))
    return made, 1e3 * float(np.quantile(controller.seconds[1:], 0.99))


def kind(angle: NDArray[np.float64], goal: NDArray[np.float64]) -> str:
    """Return how a movement failed, by its last twenty angles (n, joints) and its goal (joints,), both in degrees."""
    last = angle[-20:]
    how = "stands still" if np.ptp(last, axis=0).max() <= STILL else "moves about"
    return f"{how} {'near' if np.abs(last[-1] - goal).max() <= NEAR else 'far from'} the goal"


def row(
    arm: int, seed: int, method: str, trained: Training[Any], simulated: float, figures: dict[str, Any], p99: float
) -> str:
    low, high = figures["intervals"]["reward"]
    worst, best = figures["intervals"]["success_rate"]
    reward = f"{figures['reward']:.2f} ± {(high - low) / 2:.2f}"
    success = f"{figures['success_rate']:.4f} ({worst:.3f}..{best:.3f})"
    return (
        f"{arm:<6}{seed:>5} {method:14}{trained.seconds:5.1f} s{simulated:15.2f}{reward:>17}{success:>22}"
        f"{figures['actions']:9.2f}{figures['switches']:9.2f}{p99:6.2f} ms"
    )


def total(method: str, each: list[tuple[dict[str, Any], Training[Any]]], failures: Counter[str]) -> str:
    rewards = np.array([figures["reward"] for figures, _ in each])
    rates = [figures["success_rate"] for figures, _ in each]
    seconds = [trained.seconds for _, trained in each]
    kinds = ", ".join(f"{count} {name}" for name, count in failures.most_common()) or "none"
    return (
        f"{method}: reward {rewards.mean():.2f} (of an agent {rewards.min():.2f} to {rewards.max():.2f}), success "
        f"{np.mean(rates):.5f} (lowest {min(rates):.4f}), training {np.mean(seconds):.1f} s; failures: {kinds}"
    )
