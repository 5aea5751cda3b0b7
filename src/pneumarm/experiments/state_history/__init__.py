"""Which history must the state hold, and does the time between readings belong into it?

Factors: the number of observations in the state, 1 (the last one alone) to 4, with the actions between them; the
networks with and without the length of the step that is predicted. All are fitted to the same transitions and judged
on the same held-out sequences, so the states are nested. An agent cannot know how long a step will be, so agents are
trained and moved on the arm only without it.

    pneumarm experiment state-history --out laboratory

Answer here: three observations, as in the thesis: against one they take a fifth off the error of the angle and three
fifths off those of the pressures, and agents are better on the arm; no gain by a fourth is shown. The length of steps
takes some 6 % off the error of the angle, as section 3.3 says and appendix A does not.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.experiments.differences import Interval, above, all_hold, below, within
from pneumarm.experiments.evidence import Column, change, difference, numbers, signed, table, thesis
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Report, Rows, run_seed
from pneumarm.experiments.pictures import Axis, against
from pneumarm.experiments.preparation import STORE
from pneumarm.experiments.there_and_back import (
    AFTER_A_SECOND,
    TRAINING,
    Prepared,
    ThereAndBack,
    agent_columns,
    over_joints,
    prepared,
    trained_and_moved,
    usual,
)
from pneumarm.networks import LevenbergMarquardt, levenberg_marquardt, nguyen_widrow
from pneumarm.report.page import Picture, Section, Table
from pneumarm.simulation import FitSettings, fit
from pneumarm.simulation.quality import propagation
from pneumarm.simulation.simulation import Scaling
from pneumarm.task import BeginStates, begin_states
from pneumarm.transitions import KINDS, QUANTITIES, Store, Transitions, Window, filter_transitions
from pneumarm.transitions.choice import joined, share_held_out

_HISTORIES = (1, 2, 3, 4)
_FIT = FitSettings(epochs=30)
_RUNS = 500  # free runs that the error after a second is measured by
_MARGIN = 3.0  # percent of an error that do not matter
_ENOUGH_REWARD = 1.0


@dataclass(frozen=True)
class Material:
    """Transitions of an arm with the longest history, and what else a fit and an agent need."""

    base: Prepared
    kept: Transitions
    held_out: Transitions
    spec: ArmSpec
    longest: Window
    begin: Mapping[int, BeginStates]
    """By history."""


def shortened(whole: Transitions, longest: Window, history: int) -> Transitions:
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
        start = nguyen_widrow(x.shape[1], settings.hidden, 1, int(seed))
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
class StateHistory(ThereAndBack):
    """Fits and agents by history."""

    histories: tuple[int, ...] = _HISTORIES
    """Observations in the state, from 1, in ascending order; the thesis' 3 among them and one more."""
    fit: FitSettings = _FIT
    name: str = "state-history"
    title: str = "Which history the state needs"
    question: str = "How many observations must the state hold, and does the length of the step help to predict it?"
    source: str = "Thesis section 3.3, eq. 3.5; appendix A"

    @property
    def trials(self) -> Mapping[int, str]:
        """Histories, first without and then with the period."""
        words = [_called(history) for history in self.histories]
        return dict(enumerate([*words, *(f"{one}, and the step's length" for one in words)], 1))

    def settings(self) -> Any:
        """Return histories, fit and training."""
        fits = {"histories": list(self.histories), "fit": msgspec.to_builtins(self.fit)}
        return {**super().settings(), **fits}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Material:
        """Return the arm's filtered transitions."""
        base = prepared(arm, folder, usual(settings), settings, progress)
        longest = Window(base.simulation.spec.joints, max(self.histories))
        with Store.open(base.folder / STORE) as store:
            held_out = share_held_out([entry.number for entry in store.catalogue()], self.fit.held_out, settings.seed)
            filtered = filter_transitions(store, longest, seed=settings.seed, hold_out=held_out)
            kept, apart = filtered.transitions, joined(list(filtered.stream("held-out")))
            begin = {}
            for history in self.histories:
                window = Window(longest.joints, history)
                scaling = Scaling.of(shortened(kept, longest, history), window, valves=True)
                begin[history] = begin_states(store.blocks(kinds=KINDS), window, scaling)
            return Material(base, kept, apart, store.spec, longest, begin)

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Fit the networks of ``trial``; without the period also train an agent and move the arm with it."""
        with_period = trial > len(self.histories)
        history = self.histories[(trial - 1) % len(self.histories)]
        seed = run_seed(settings, run)
        window = Window(material.longest.joints, history)
        kept, held_out = (shortened(w, material.longest, history) for w in (material.kept, material.held_out))
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
            **trained_and_moved(mine, TRAINING, run, settings),
        }

    def analyse(self, rows: Rows) -> Analysis:
        """Return errors and agents by history."""
        said = thesis(__name__)
        three = 1 + self.histories.index(said["history"])
        beside = "beside it table 5.2, the thesis' arm at 30 Hz"
        step = [
            Column(f"std {name}", f"error of {words}", digits, thesis={three: said["step"][name]})
            for name, words, digits in (
                ("angle", "the angle [counts]", 3),
                ("velocity", "the velocity [counts/ms]", 4),
                ("pressure_1", "pressure 1 [counts]", 3),
                ("pressure_2", "pressure 2 [counts]", 3),
            )
        ]
        agent = [
            Column(f"angle{AFTER_A_SECOND}", "error of the angle after a second [counts]"),
            *agent_columns("switches"),
        ]
        trials, count = self.trials, len(self.histories)
        without = {trial: words for trial, words in trials.items() if trial <= count}
        with_period = {trial: words for trial, words in trials.items() if trial > count}
        axis = Axis("observations in the state [-]", self.histories)

        def shown(which: Mapping[int, str], columns: list[Column], caption: str) -> Picture:
            columns = [replace(column, thesis=None) for column in columns]  # another arm, out of scale
            return against(rows, which, axis, columns, caption)

        nested = [
            [
                f"{words} against {without[trial - 1]}",
                *(signed(change(rows, column.figure, trial, trial - 1)) for column in step),
            ]
            for trial, words in without.items()
            if trial > 1
        ]
        nested += [
            [f"{words} against without", *(signed(change(rows, c.figure, trial, trial - count)) for c in step)]
            for trial, words in with_period.items()
        ]
        return Analysis(
            summary=[
                self.question,
                self._answer(rows),
                "All states are fitted to the same transitions and judged on the same sequences, which were not "
                "fitted. Values are means over arms with 95 % intervals. Residues and isoplots of one simulation "
                "(figures 3.1 to 3.5) are made by pneumarm analyse.",
            ],
            figures=numbers(rows, trials, step) | {"agents": numbers(rows, without, agent)["ours"]},
            sections=[
                Section(
                    "Error of a step",
                    tables=[
                        table(rows, trials, step, f"Standard deviation of the error of a step (eq. 3.6); {beside}."),
                        _nested(nested, step),
                    ],
                    figures=[
                        shown(without, step, "Error of a step by history, the length of the step unknown."),
                        shown(
                            with_period,
                            step,
                            "Error of a step by history, the length of the step known.",
                        ),
                    ],
                ),
                Section(
                    "After a second, and on the arm",
                    tables=[table(rows, without, agent, "Error after a second, and what agents make of the state.")],
                    figures=[shown(without, agent, "Error after a second, and agents on the arm, by history.")],
                ),
            ],
            claims=self.claims(rows),
        )

    def _answer(self, rows: Rows) -> str:
        three, one = 1 + self.histories.index(thesis(__name__)["history"]), 1 + self.histories.index(1)

        def error(trial: int, reference: int) -> str:
            return f"{signed(change(rows, 'std angle', trial, reference), 1)} %"

        def reward(trial: int, reference: int) -> str:
            return f"what agents earn on the arm by {signed(difference(rows, 'reward', trial, reference), 1)}"

        return (
            f"Three observations instead of one change the error of the angle by {error(three, one)} and "
            f"{reward(three, one)}. A fourth changes the error by {error(three + 1, three)} and "
            f"{reward(three + 1, three)}. To know the length of the step changes the error by "
            f"{error(three + len(self.histories), three)}."
        )

    def claims(self, rows: Rows) -> list[Claim]:
        """Return what the thesis says, and what the rows say to it."""
        theirs: int = thesis(__name__)["history"]
        one, three = 1 + self.histories.index(1), 1 + self.histories.index(theirs)
        four, period = three + 1, three + len(self.histories)
        names = ("angle", "pressure_1", "pressure_2")

        def changes(trial: int, reference: int) -> dict[str, Interval]:
            return {name: change(rows, f"std {name}", trial, reference) for name in names}

        def words(found: Mapping[str, Interval]) -> str:
            return ", ".join(f"{name.replace('_', ' ')} {signed(value)} %" for name, value in found.items())

        history, more, known = changes(three, one), changes(four, three), changes(period, three)
        verdicts = [within(found, _MARGIN) for found in more.values()]
        reward, further = difference(rows, "reward", three, one), difference(rows, "reward", four, three)
        return [
            Claim(
                "History is necessary: three observations predict all quantities better than one",
                "a great deal (appendix A); no number",
                words(history),
                all_hold([below(found) for found in history.values()]),
                "history",
            ),
            Claim(
                f"One observation more than three changes no error significantly, that is by over {_MARGIN:g} %",
                "not significantly (appendix A); no number",
                words(more),
                all_hold(verdicts),
                "history",
            ),
            Claim(
                "The length of the step improves the prediction of the angle",
                "improves the isoplots (section 3.3); no number",
                words(known),
                below(known["angle"]),
                "period",
            ),
            Claim(
                f"The length of the step has no significant influence, that is none over {_MARGIN:g} %",
                "no significant influence (appendix A, against section 3.3); no number",
                words(known),
                all_hold([within(found, _MARGIN) for found in known.values()]),
                "period",
            ),
            Claim(
                "An agent with three observations is better on the arm than with one",
                "not tried",
                f"reward: {signed(reward)}",
                above(reward),
                "history",
            ),
            Claim(
                f"An agent gains nothing by a fourth, that is no more than {_ENOUGH_REWARD:g}",
                "not tried",
                f"reward: {signed(further)}",
                below(further, _ENOUGH_REWARD),
                "history",
            ),
        ]


def _called(history: int) -> str:
    return "the last observation alone" if history == 1 else f"{history} observations"


def _nested(lines: list[list[str]], columns: list[Column]) -> Table:
    header = ["states compared", *(column.words.split(" [")[0] for column in columns)]
    return Table(header, lines, "Change of the error by what is added to the state [%].")


EXPERIMENT = StateHistory()
"""``pneumarm experiment``."""
