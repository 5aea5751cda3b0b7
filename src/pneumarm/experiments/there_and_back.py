"""Collect, fit, train and move the arm, with what an experiment varies on the way.

Collecting and fitting belong to an arm (:func:`prepared`), training and moving to a row (:func:`train_and_move`).
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ControlCycle, guarded, open_arm
from pneumarm.control import AgentController, drawn, make_movements
from pneumarm.control.agent import warm_up
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.preparation import PROCEDURES, SIMULATION, STORE, as_ever, claim
from pneumarm.files import read_json, write_json
from pneumarm.learning import Acts, Method, TrainSettings, test, train
from pneumarm.progress import Report
from pneumarm.simulation import SINGLE_STEPS, FitSettings, Simulation, StoreFit, fit_store
from pneumarm.simulation.quality import propagation
from pneumarm.task import BeginStates, Movement, begin_states
from pneumarm.task.movements import of_rows
from pneumarm.transitions import (
    FEWEST_TRANSITIONS,
    KINDS,
    QUANTITIES,
    WHOLE_PERIODS,
    CollectSettings,
    Store,
    collect,
)
from pneumarm.transitions.choice import join_transitions
from pneumarm.transitions.goals import Goals

TRANSITIONS = 40_000
"""Transitions of a simulation, at most as many as the laboratory's: 22 minutes on the arm."""
MOVEMENTS = 200
"""Movements on the arm that a row is judged by, at most as many as test episodes."""
BEFORE = "in simulation: "
"""Prefix of the figures of the test in the simulation; those on the arm have none."""
AFTER_A_SECOND = " after a second"
TRAINING = TrainSettings(agents=4, validation_episodes=500)
"""The training of a row: the thesis', of four agents, of which the best in the simulation is taken.

The first weights decide most (section 5.4.2): with a single agent a row the intervals would be twice as wide.
"""
DECISIVE = {
    "transitions": TRANSITIONS,
    "collect": msgspec.to_builtins(WHOLE_PERIODS),
    "movements": MOVEMENTS,
    "training": msgspec.to_builtins(TRAINING),
}
"""What the rows of such experiments rest on, as JSON."""
_FIGURES = "figures.json"
_SAME = 1e-9


def open_arm_at(arm: str, seed: int, frequency: float | None = None) -> Arm:
    """Return the arm called ``arm``, controlled at ``frequency`` [Hz] where one is given.

    Raises:
        UnusableInput: no arm has this name, or its latency is no shorter than the period.

    """
    found = open_arm(arm, seed)
    if frequency is not None:
        try:
            found.spec = replace(found.spec, period=1 / frequency)
        except UnusableInput:
            found.close()
            raise
    return found


@dataclass(frozen=True)
class Recipe:
    """How the transitions of a simulation are collected and how it is fitted to them."""

    transitions: int = FEWEST_TRANSITIONS
    """Fewest transitions."""
    minutes: float = 0.0
    """Shortest time of collecting, on the arm's clock [min]."""
    frequency: float | None = None
    """Control frequency [Hz]; None for the arm's own."""
    close_while_computing: bool = False
    """Whether the valves are closed between reading and acting."""
    collect: CollectSettings = WHOLE_PERIODS
    """How, the thesis' way by default; what :func:`prepared` makes is collected as the laboratory says."""
    fit: FitSettings = SINGLE_STEPS


def usual_recipe(settings: LaboratorySettings, **varied: Any) -> Recipe:
    """Return the recipe of most experiments, with what is ``varied``."""
    return Recipe(min(TRANSITIONS, settings.transitions), **varied)


def collect_until(
    path: Path, arm: str, seed: int, recipe: Recipe, progress: Report = lambda done, total: None
) -> tuple[int, float]:
    """Collect into the store ``path`` until there are so many transitions and so many minutes have passed.

    Whole sequences are stored, so there may be one more than needed. Returns the transitions and the minutes on the
    arm's clock, those between its sequences included.
    """
    collecting = replace(recipe.collect, close_while_computing=recipe.close_while_computing)
    with open_arm_at(arm, seed, recipe.frequency) as there, Store.for_arm(path, there.spec) as store:
        first = max(recipe.transitions, FEWEST_TRANSITIONS)
        done = collect(there, store, first, seed, settings=collecting, progress=progress)
        while done.seconds < 60 * recipe.minutes:
            progress(done.seconds, 60 * recipe.minutes)
            done = collect(there, store, done.transitions + 1, seed, settings=collecting)
    return done.transitions, done.seconds / 60


def fitted(path: Path, settings: FitSettings) -> tuple[StoreFit, BeginStates]:
    """Return the simulation fitted to the store ``path``, and its begin states."""
    with Store.open(path) as store:
        made = fit_store(store, settings)
        window, scaling = made.simulation.window, made.simulation.scaling
        return made, begin_states(store.blocks(kinds=KINDS), window, scaling, store.spec)


@dataclass(frozen=True)
class Prepared:
    """A simulation of an arm, and what making it gave."""

    arm: str
    recipe: Recipe
    folder: Path
    """Where the store and the simulation lie on the machine that made them."""
    simulation: Simulation
    begin: BeginStates
    figures: Figures
    """Figures of collecting and fitting."""


def prepared(arm: str, folder: Path, recipe: Recipe, settings: LaboratorySettings, progress: Report) -> Prepared:
    """Return what ``recipe`` makes of ``arm``, making it where the arm's ``folder`` does not hold it; resumable.

    Raises:
        UnusableInput: no arm has this name.

    """
    with open_arm_at(arm, settings.seed) as found:
        if recipe.frequency is not None and abs(found.spec.period * recipe.frequency - 1) < _SAME:
            recipe = replace(recipe, frequency=None)  # so that it is shared with experiments that leave it alone
    recipe = replace(recipe, collect=PROCEDURES[settings.collecting])
    fit = replace(recipe.fit, seed=settings.seed)
    folder = trial_folder(folder, {"arm": arm, "seed": settings.seed, "recipe": asdict(recipe)})
    if not (folder / _FIGURES).exists():
        transitions, minutes = collect_until(folder / STORE, arm, settings.seed, recipe, progress)
        with Store.open(folder / STORE) as store:
            made = fit_store(store, fit)
            figures = {"transitions": float(transitions), "minutes": minutes, **quality(made)}
        made.simulation.save(folder / SIMULATION)
        write_json(folder / _FIGURES, figures)
    simulation = Simulation.load(folder / SIMULATION)
    with Store.open(folder / STORE) as store:
        begin = begin_states(store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec)
    figures = read_json(folder / _FIGURES, "figures of a recording")
    return Prepared(arm, recipe, folder, simulation, begin, figures)


def trial_folder(folder: Path, wanted: object) -> Path:
    """Return the folder below an arm's ``folder`` of what ``wanted`` (JSON) makes, whichever experiment asks."""
    told = json.dumps(as_ever(json.loads(json.dumps(wanted))), sort_keys=True)
    digest = hashlib.sha256(told.encode()).hexdigest()[:12]
    claim(folder / digest, wanted)
    return folder / digest


def quality(made: StoreFit) -> dict[str, float]:
    """Return how good a simulation is on held-out sequences, and how its filter was filled.

    ``std`` is the error of one step (thesis eq. 3.6), ``expected ... after a second`` what eq. 3.7 makes of it,
    ``measured ... after a second`` the error of running freely for a second. Several joints enter by the root of
    their mean square.
    """
    simulation, held_out = made.simulation, made.result.held_out
    steps = round(1 / simulation.spec.period)
    spread = propagation(simulation, join_transitions(list(made.filtered.stream("held-out"))), steps)
    coverage = made.filtered.coverage
    figures = {
        "rows": float(made.result.rows),
        "occupied": float(coverage.occupied),
        "unseen": coverage.unseen,
    }
    for name, values in (
        ("std", held_out.std),
        ("relative", held_out.relative),
        ("change", held_out.change_std),
        ("expected{}", spread.expected[-1]),
        ("measured{}", spread.measured[-1]),
    ):
        for quantity, value in over_joints(values).items():
            after = AFTER_A_SECOND if name.endswith("{}") else ""
            figures[f"{name.removesuffix('{}')} {quantity}{after}"] = value
    return figures


def over_joints(values: NDArray[np.float64]) -> dict[str, float]:
    """Return the root mean square over joints of ``values`` (4 joints,) by quantity."""
    rms = np.sqrt((values.reshape(-1, len(QUANTITIES)) ** 2).mean(axis=0))
    return {name: float(value) for name, value in zip(QUANTITIES, rms, strict=True)}


def train_and_move(
    material: Prepared,
    train_settings: Any,
    run: int,
    settings: LaboratorySettings,
    goals: Goals | NDArray[np.float64] | None = None,
    method: Method | None = None,
) -> Figures:
    """Train agents, test the best in its simulation, and move the arm with it; nothing is learned on the arm.

    All rows of a run begin with the same weights and make the same movements on the arm: their begin states and goals
    depend on the run and their number alone.

    Args:
        material: the simulation that it is trained in; the arm is controlled as its transitions were collected.
        train_settings: of the agents, those of any method.
        run: that weights and movements are those of.
        settings: of the laboratory.
        goals: those on the arm, or their range, shape (joints, 2) [counts]; the simulation's by default.
        method: that the settings are of, where it is not a built-in one.

    """
    seed, recipe = run_seed(settings, run), material.recipe
    chosen = train_settings
    if settings.max_episodes and isinstance(chosen, TrainSettings):
        chosen = replace(chosen, max_episodes=settings.max_episodes)
    training = train(material.simulation, material.begin, chosen, seed, method=method, threads=1)
    agent = training.agent
    simulated = test(agent, material.simulation, material.begin, settings.test_episodes, 0)
    wanted = material.simulation.goals if goals is None else goals
    numbers = range(min(MOVEMENTS, settings.test_episodes))
    warm_up(agent)
    with open_arm_at(material.arm, seed % 2**31, recipe.frequency) as arm:
        closes = recipe.close_while_computing
        rows = greedy_movements(agent, arm, wanted, numbers, seed, close_while_computing=closes)
    made = of_rows((one.row() for one in rows), material.simulation.spec.joints)
    return {
        BEFORE + "reward": float(simulated.reward.mean()),
        BEFORE + "success_rate": float(simulated.success.mean()),
        **made.means(),
        "seconds": float((made.time_end - made.time_start).mean()),
        "episodes": float(training.episodes.mean()),
        **({"met": float(training.met.mean())} if training.met.size else {}),
    }


def greedy_movements(
    agent: Acts,
    arm: Arm,
    goals: Goals | NDArray[np.float64],
    numbers: Iterable[int],
    seed: int,
    controller: AgentController | None = None,
    *,
    close_while_computing: bool = False,
) -> list[Movement]:
    """Return greedy movements of ``agent``, which learns nothing, on ``arm``.

    Args:
        agent: what moves it.
        arm: any.
        goals: to reach, or their range, shape (joints, 2) [counts].
        numbers: of the movements; with ``seed`` they decide begin state and goal, whoever moves.
        seed: of the movements.
        controller: what acts in the agent's place.
        close_while_computing: close the valves between reading and acting.

    """
    cycle = ControlCycle(guarded(arm), close_while_computing)
    draws, velocity = drawn(goals, seed, numbers), agent.window.velocity
    return list(make_movements(cycle, controller or AgentController(agent), agent.settings, draws, velocity=velocity))
