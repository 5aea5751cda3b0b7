"""Whether an arm teaches more by sequences that are chosen for what they would teach than by random ones.

python -m benchmarks chosen

Of twelve random sequences that one is carried out about whose steps three quickly fitted simulations disagree most,
from where the arm stands. Sequences are chosen from all kinds, or from those of the kind that was drawn, so that the
mixture stays. All collect for as long on the arm's clock, and simulations and agents for reaching are made of nothing
else, by the defaults. The movements are the same for all agents of an arm. Settings come from the environment:

PNEUMARM_CHOSEN_ARMS       seeds of virtual arms; the ten held-out arms by default
PNEUMARM_CHOSEN_SEEDS      of collecting, fitting and training, "0,1,2,3,4"
PNEUMARM_CHOSEN_MINUTES    "2,3"
PNEUMARM_CHOSEN_WAYS       of coming by sequences, "random,chosen,chosen of a kind"; random is always among them
PNEUMARM_CHOSEN_MOVEMENTS  of each agent, 200
PNEUMARM_CHOSEN_FOLDER     where rows are kept, runs/chosen; a call with the same folder goes on where another ended

Intervals are Student's, over the pairs of arm and seed, of the difference to random sequences.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import _environment as environment
from benchmarks._trials import HELD_OUT, Rows
from benchmarks.minutes import differences, half_width, learned_from
from pneumarm.arm import guarded, open_arm
from pneumarm.arm.seam import Reading
from pneumarm.arm.valves import Command
from pneumarm.simulation import FitSettings, Simulation, fit
from pneumarm.simulation.quality import advanced
from pneumarm.transitions import FEWEST_TRANSITIONS, CollectSettings, Store, collect
from pneumarm.transitions.collect import random_actions
from pneumarm.transitions.fill_times import find_fill_times
from pneumarm.transitions.players import Trajectory
from pneumarm.transitions.rows import join_rows
from pneumarm.transitions.window import Window, transitions

RANDOM, CHOSEN, OF_A_KIND = WAYS = ("random", "chosen", "chosen of a kind")
CANDIDATES, SIMULATIONS = 12, 3
GROWN = 1.3
"""Simulations are fitted again once the record is so many times as long."""
FIRST = 400
"""Transitions before which sequences are random."""
HISTORY = 3
QUICK = FitSettings(history=HISTORY, epochs=6, ahead=0.0, spread=False)
_MINUTES_OF_GOALS = 5.0
"""Goals lie within the angles that are recorded in so many minutes."""
HEADER = f"{'minutes':>8} {'sequences':18}{'transitions':>12}{'angle':>7}{'in simulation':>15}{'on the arm':>12}"
HEADER += f"{'lowest':>8}{'difference':>17}{'success':>10}"


class Chooser:
    """A controller to collect with: its sequences are those that teach most, as far as simulations can tell."""

    def __init__(self, store: Store, settings: CollectSettings, seed: int, *, of_a_kind: bool) -> None:
        """Choose by what is recorded in ``store``, among sequences that ``settings`` may give."""
        self._store, self._settings, self._seed, self._of_a_kind = store, settings, seed, of_a_kind
        self._simulations: list[Simulation] = []
        self._known = 0
        self._candidates: list[NDArray[np.float64]] = []
        self._chosen: Trajectory | None = None

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Draw sequences to choose from; the goal is of no concern."""
        recorded = self._store.transitions
        if recorded >= FIRST and recorded >= GROWN * self._known:
            self._simulations = quickly_fitted(self._store)
            self._known = recorded
        random = np.random.default_rng([self._seed, recorded])
        wanted, self._candidates = None, []
        while len(self._candidates) < CANDIDATES:
            kind, actions = random_actions(self._store.spec, self._settings, random)
            wanted = wanted or kind
            if kind == wanted or not self._of_a_kind:
                self._candidates.append(np.asarray(actions.commands, np.float64))
        self._chosen = None

    def act(self, reading: Reading) -> Command:
        """Return the next command (joints, 2) of the sequence that is chosen when the arm is first read."""
        if self._chosen is None:
            best = 0
            if self._simulations:
                best = int(np.argmax(disagreement(self._simulations, np.array(self._candidates), reading)))
            self._chosen = Trajectory(self._candidates[best])
        return self._chosen.act(reading)


def quickly_fitted(store: Store) -> list[Simulation]:
    """Return simulations that are fitted to all of ``store``, from different weights."""
    window = Window.of(store.spec, HISTORY)
    known = transitions(join_rows(store.blocks()), window)
    return [
        fit(
            known, known, spec=store.spec, goal_range=store.percentiles(), valves=store.valves, settings=settings
        ).simulation
        for settings in (replace(QUICK, seed=seed) for seed in range(SIMULATIONS))
    ]


def disagreement(
    simulations: list[Simulation], sequences: NDArray[np.float64], reading: Reading
) -> NDArray[np.float64]:
    """Return how much simulations disagree on average about a step of each of ``sequences``, shape (n,).

    Sequences (n, steps, joints, 2) begin at rest at ``reading`` and go on with the mean of what is predicted.
    Differences count in errors of one step.
    """
    window, errors = simulations[0].window, simulations[0].errors
    n, steps = sequences.shape[:2]
    commands = sequences.reshape(n, steps, -1)
    now = np.concatenate([reading.angle[:, None], np.zeros_like(reading.angle)[:, None], reading.pressure], axis=1)
    past = window.history * window.observation_size
    inputs = np.zeros((n, window.input_size))
    inputs[:, :past] = np.tile(now.ravel(), window.history)
    inputs[:, window.state_size :] = commands[:, 0]
    found = np.zeros(n)
    for step in range(steps):
        predicted = np.array([one.predict(inputs) for one in simulations])
        found += (predicted.std(axis=0) / errors).mean(axis=1)
        inputs = advanced(inputs, predicted.mean(axis=0), commands[:, min(step + 1, steps - 1)], window)
    return found / steps


def measure() -> Iterator[str]:
    folder = environment.folder("PNEUMARM_CHOSEN_FOLDER", "runs/chosen")
    arms = environment.seeds("PNEUMARM_CHOSEN_ARMS", HELD_OUT)
    seeds = environment.seeds("PNEUMARM_CHOSEN_SEEDS", "0,1,2,3,4")
    minutes = environment.numbers("PNEUMARM_CHOSEN_MINUTES", "2,3")
    ways = dict.fromkeys((RANDOM, *environment.several("PNEUMARM_CHOSEN_WAYS", WAYS)))
    movements = environment.whole("PNEUMARM_CHOSEN_MOVEMENTS", 200)
    rows = Rows(folder / "rows.jsonl", "arm", "seed", "minutes", "movements", "way")
    found: dict[tuple[float, str], list[dict[str, Any]]] = {(one, way): [] for one in minutes for way in ways}
    for arm in arms:
        for seed in seeds:
            for one, way in found:
                row = rows.get(arm, seed, one, movements, way)
                if row is None:
                    row = rows.add(trial(arm, seed, one, movements, way))
                    yield f"arm {arm}, seed {seed}, {one:g} minutes, {way}: {row['reward']:.2f}"
                found[one, way].append(row)
    yield HEADER
    for (one, way), each in found.items():
        yield line(one, way, each, found[one, RANDOM])


def trial(arm: int, seed: int, minutes: float, movements: int, way: str) -> dict[str, Any]:
    """Return what an agent reaches that was made from so many minutes of sequences of this ``way``."""
    with tempfile.TemporaryDirectory() as place:
        span, db = Path(place) / "goals.db", Path(place) / "chosen.db"
        collected(span, arm, 0, _MINUTES_OF_GOALS, RANDOM)
        with Store.open(span) as store:
            goals = store.percentiles()
        transitions = collected(db, arm, seed, minutes, way)
        made = learned_from(db, arm, seed, movements, goals)
    return {"minutes": minutes, "way": way, "transitions": transitions, **made}


def collected(path: Path, arm: int, seed: int, minutes: float, way: str) -> int:
    """Collect into the store ``path`` for so many minutes on the arm's clock; return the transitions."""
    with open_arm(f"virtual:seed={arm}", seed) as there, Store.for_arm(path, there.spec) as store:
        settings = CollectSettings(pulses=0.0).for_arm(find_fill_times(guarded(there)))
        chooser = Chooser(store, settings, seed, of_a_kind=way == OF_A_KIND) if way in (CHOSEN, OF_A_KIND) else None
        done = collect(there, store, FEWEST_TRANSITIONS, seed, settings=settings, controller=chooser)
        while done.seconds < 60 * minutes:
            done = collect(there, store, done.transitions + 1, seed, settings=settings, controller=chooser)
    return done.transitions


def line(minutes: float, way: str, each: list[dict[str, Any]], random: list[dict[str, Any]]) -> str:
    """Return the figures of one way of coming by sequences, beside those of random ones."""

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in each]))

    difference, success = "", mean("successes") / mean("movements")
    angle = float(np.mean([row["std"]["angle"] for row in each]))
    if each is not random:
        difference = f"{np.mean(differences(each, random)):+.2f} ± {half_width(differences(each, random)):.2f}"
    return (
        f"{minutes:8g} {way:18}{mean('transitions'):12,.0f}{angle:7.2f}{mean('simulated'):15.2f}"
        f"{mean('reward'):12.2f}{min(row['reward'] for row in each):8.2f}{difference:>17}{success:10.4f}"
    )
