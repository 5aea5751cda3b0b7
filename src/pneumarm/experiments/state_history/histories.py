"""Histories of the state, and networks that know the length of the step."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.experiments.experiment import Axis, Experiment, Figures, LaboratorySettings, run_seed
from pneumarm.experiments.preparation import STORE
from pneumarm.experiments.there_and_back import (
    AFTER_A_SECOND,
    DECISIVE,
    TRAINING,
    Prepared,
    over_joints,
    prepared,
    train_and_move,
    usual_recipe,
)
from pneumarm.experiments.words import words_of
from pneumarm.networks import LevenbergMarquardt, levenberg_marquardt, nguyen_widrow
from pneumarm.progress import Report
from pneumarm.simulation import SINGLE_STEPS, FitSettings, fit
from pneumarm.simulation.fit import HIDDEN
from pneumarm.simulation.quality import propagation
from pneumarm.simulation.simulation import Scaling
from pneumarm.task import BeginStates, begin_states
from pneumarm.transitions import KINDS, QUANTITIES, Store, Transitions, Window, filter_transitions
from pneumarm.transitions.choice import join_transitions, share_held_out

_HISTORIES = (1, 2, 3, 4)
_FIT = replace(SINGLE_STEPS, epochs=30)
_RUNS = 500  # free runs that the error after a second is measured by


@dataclass(frozen=True)
class HistoryMaterial:
    """Transitions of an arm with the longest history, and what else a fit and an agent need."""

    base: Prepared
    kept: Transitions
    held_out: Transitions
    spec: ArmSpec
    longest: Window
    begin: Mapping[int, BeginStates]
    """Begin states by history."""


def with_history(whole: Transitions, longest: Window, history: int) -> Transitions:
    """Return transitions with windows of ``history`` observations, cut out of those with ``longest`` windows."""
    size, past = longest.observation_size, longest.history * longest.observation_size
    commands = (history - 1) * longest.command_size
    chosen = [*range(history * size), *range(past, past + commands), *range(longest.state_size, longest.input_size)]
    return whole._replace(inputs=np.ascontiguousarray(whole.inputs[:, chosen]))


def errors_with_period(
    kept: Transitions,
    held_out: Transitions,
    window: Window,
    settings: FitSettings,
    limits: NDArray[np.float64],
    nominal: float | None = None,
) -> dict[str, float]:
    """Return the standard deviation of the error of a step by quantity, networks knowing how long the step is.

    The fit is that of :func:`pneumarm.simulation.fit`, from first weights drawn alike; the velocity is derived from
    the predicted angle and the length of the step.

    Args:
        kept: transitions to fit.
        held_out: transitions to judge by.
        window: of both.
        settings: of the fit.
        limits: lowest and highest value of each place in a prediction, shape (2, 4 joints), as of a simulation.
        nominal: length that all steps are taken to have [s], which then is no input; by default each step's own is.

    """
    scaling = Scaling.of(kept, window, valves=True)
    middle, spread = float(kept.interval.mean()), 2 * float(kept.interval.std()) or 1.0

    def inputs(these: Transitions) -> NDArray[np.float32]:
        x = scaling.inputs(these.inputs, window)
        if nominal is None:
            x = np.column_stack([x, (these.interval - middle) / spread])
        return x.astype(np.float32)

    places = np.arange(window.observation_size)
    places = places[places % len(QUANTITIES) != QUANTITIES.index("velocity")]
    change_of = kept.target[:, places].astype(np.float64) - kept.observation[:, places]
    scale = change_of.std(axis=0)
    solver = LevenbergMarquardt(epochs=settings.epochs, tolerance=settings.tolerance, decay=settings.decay)
    seeds = np.random.SeedSequence(settings.seed).generate_state(len(places))
    x, apart = inputs(kept), inputs(held_out)
    error = np.empty(held_out.target.shape)
    for column, (one, seed) in enumerate(zip(places, seeds, strict=True)):
        start = nguyen_widrow(x.shape[1], settings.hidden or HIDDEN, 1, int(seed))
        network = levenberg_marquardt(x, change_of[:, [column]] / scale[column], start, solver).network
        told = held_out.observation[:, one] + scale[column] * network(apart)[:, 0]
        error[:, one] = np.clip(told, *limits[:, one]) - held_out.target[:, one]
    angle = np.arange(0, window.observation_size, len(QUANTITIES))
    velocity = angle + QUANTITIES.index("velocity")
    moved = error[:, angle] + held_out.target[:, angle] - held_out.observation[:, angle]
    seconds = held_out.interval.astype(np.float64)[:, None] if nominal is None else nominal
    error[:, velocity] = moved / (1e3 * seconds) - held_out.target[:, velocity]
    return over_joints(error.std(axis=0))


@dataclass(frozen=True)
class StateHistory(Experiment):
    """Fits and agents by history."""

    histories: tuple[int, ...] = _HISTORIES
    """Observations in the state, from 1, in ascending order; the thesis' 3 among them and one more."""
    fit: FitSettings = _FIT
    name = "state-history"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """Histories, first without and then with the period."""
        words = [_called(history) for history in self.histories]
        return dict(enumerate([*words, *(f"{one}, and the step's length" for one in words)], 1))

    @property
    def axis(self) -> Axis:
        """The histories."""
        return Axis("observations in the state [-]", self.histories)

    def settings(self) -> Any:
        """Return histories, fit and training."""
        fits = {"histories": list(self.histories), "fit": msgspec.to_builtins(self.fit)}
        return {**DECISIVE, **fits}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> HistoryMaterial:
        """Return the arm's filtered transitions."""
        base = prepared(arm, folder, usual_recipe(settings), settings, progress)
        longest = Window(base.simulation.spec.joints, max(self.histories))
        with Store.open(base.folder / STORE) as store:
            held_out = share_held_out([entry.number for entry in store.catalogue()], self.fit.held_out, settings.seed)
            filtered = filter_transitions(store, longest, seed=settings.seed, hold_out=held_out)
            kept, apart = filtered.transitions, join_transitions(list(filtered.stream("held-out")))
            begin = {}
            for history in self.histories:
                window = Window(longest.joints, history)
                scaling = Scaling.of(with_history(kept, longest, history), window, valves=True)
                begin[history] = begin_states(store.blocks(kinds=KINDS), window, scaling, store.spec)
            return HistoryMaterial(base, kept, apart, store.spec, longest, begin)

    def measure(self, material: HistoryMaterial, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Fit the networks of ``trial``; without the period also train an agent and move the arm with it."""
        with_period = trial > len(self.histories)
        history = self.histories[(trial - 1) % len(self.histories)]
        seed = run_seed(settings, run)
        window = Window(material.longest.joints, history)
        kept, held_out = (with_history(w, material.longest, history) for w in (material.kept, material.held_out))
        chosen = replace(self.fit, history=history, seed=seed)
        if with_period:
            found = errors_with_period(kept, held_out, window, chosen, material.base.simulation.limits)
            return {f"std {name}": value for name, value in found.items()}
        base = material.base
        made = fit(kept, held_out, spec=material.spec, goal_range=base.simulation.goal_range, settings=chosen)
        steps = round(1 / material.spec.period)
        ahead = propagation(made.simulation, held_out, steps, runs=_RUNS)
        mine = replace(base, simulation=made.simulation, begin=material.begin[history])
        return {
            **{f"std {name}": value for name, value in over_joints(made.held_out.std).items()},
            **{f"{name}{AFTER_A_SECOND}": value for name, value in over_joints(ahead.measured[-1]).items()},
            **train_and_move(mine, TRAINING, run, settings),
        }


def _called(history: int) -> str:
    return "the last observation alone" if history == 1 else f"{history} observations"
