"""What the rows say of the drop on arrival, its causes, and what learning brings back."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Array, blocks, difference, mean, over_arms, text, values
from pneumarm.experiments.moving import SIMULATION
from pneumarm.experiments.pictures import Curve, courses, dots
from pneumarm.experiments.transfer.conditions import (
    ALL,
    AS_IT_IS,
    CONDITIONS,
    EXPLORING,
    FROM_ARM,
    IDEAL,
    NO_NOISE,
    PUNCTUAL,
    RATES,
    WARM,
    WITHOUT_NOISE,
    TransferToTheArm,
)
from pneumarm.experiments.verdict import Interval
from pneumarm.report.page import Picture

_ALL_THREE, _MODEL, _COLD = "noise, lateness and cold together", "error of the model", "cold arm"
_PROGRESS = 750  # movements until the thesis sees real progress, about an hour
_SIMULATIONS = (
    ("simulation", SIMULATION),
    ("simulation, from the arm's begin states", FROM_ARM),
    ("the same without noise", WITHOUT_NOISE),
)


def analysis(experiment: TransferToTheArm, rows: TrialRows) -> Analysis:
    """Return the courses beside the thesis', the causes, and what holds of section 5.5.1."""
    causes = causes_of_the_drop(rows)
    known = [name for name, one in causes.items() if one.samples and name != _ALL_THREE]
    largest = max(known, key=lambda name: causes[name].mean)
    words, found = filled_words(
        experiment,
        rows,
        **transfer_evidence(rows, _PROGRESS // experiment.sizes.block),
        model=causes[_MODEL],
        cold=causes[_COLD],
        largest=largest,
        taken=causes[largest],
        block=experiment.sizes.block,
    )
    without = [row.arm for row in rows.rows if row.trial in IDEAL and not row.figures]
    if without:
        conditions, arms = ", ".join(CONDITIONS[trial] for trial in IDEAL), ", ".join(sorted(set(without)))
        left_out = f"Only a virtual arm can be put into these conditions, {arms} was not: {conditions}."
        words = msgspec.structs.replace(words, summary=(*words.summary, left_out))
    last = {experiment.trials[t]: over_arms(blocks(rows, "reward", t)[:, :, -1]).figures() for t in RATES}
    on_arm, taken = words.sections
    drawn = {name: one for name, one in causes.items() if one.samples}
    lost = dots(list(drawn), {"lost reward [-]": list(drawn.values())}, taken.figure, zero=True)
    figures = {"drop": found["drop"].figures(), "causes": {name: one.figures() for name, one in causes.items()}}
    made = analysed(
        experiment,
        rows,
        words,
        found,
        figures={**figures, "last": last},
        pictures={0: [_courses(rows, experiment.sizes.block, on_arm.figure)], 1: [lost]},
    )
    (table,) = made.sections[1].tables
    simulated = [
        [name, *(text(rows, msgspec.structs.replace(c, figure=prefix + c.figure), AS_IT_IS) for c in taken.columns)]
        for name, prefix in _SIMULATIONS
    ]
    whole = replace(made.sections[1], tables=[replace(table, rows=[*simulated, *table.rows])])
    return replace(made, sections=[made.sections[0], whole])


def transfer_evidence(rows: TrialRows, progress: int) -> dict[str, Any]:
    """Return what else claims are judged by; ``progress`` is the block in which the thesis sees some."""
    frozen, slow = (blocks(rows, "reward", trial) for trial in (1, 2))
    return {
        "success": over_arms(np.mean([blocks(rows, "success_rate", t).mean(axis=-1) for t in RATES], axis=0)),
        "ended": over_arms(_last(slow) - values(rows, EXPLORING + "reward", 2)),
        "warmed": over_arms(_last(frozen) - frozen[:, :, 0]),
        **{
            f"better_{trial}": over_arms(_last(blocks(rows, "reward", trial)) - _last(frozen))
            for trial in RATES
            if RATES[trial]
        },
        "progress": over_arms(slow[:, :, progress] - slow[:, :, 0]) if progress < slow.shape[-1] else None,
    }


def _last(course: Array) -> Array:
    """Return the mean of the last quarter of courses (arms, runs, blocks)."""
    return np.asarray(course[:, :, -max(1, course.shape[-1] // 4) :].mean(axis=-1))


def causes_of_the_drop(rows: TrialRows) -> dict[str, Interval]:
    """Return what each cause takes from the reward of a greedy agent."""
    from_arm, quiet = (values(rows, prefix + "reward", AS_IT_IS) for prefix in (FROM_ARM, WITHOUT_NOISE))
    return {
        "begin states of movements on the arm": over_arms(values(rows, SIMULATION + "reward", AS_IT_IS) - from_arm),
        "noise of the sensors": difference(rows, "reward", NO_NOISE, AS_IT_IS),
        "control that is late": difference(rows, "reward", PUNCTUAL, AS_IT_IS),
        _COLD: difference(rows, "reward", WARM, AS_IT_IS),
        _ALL_THREE: difference(rows, "reward", ALL, AS_IT_IS),
        _MODEL: over_arms(quiet - values(rows, "reward", ALL)),
        "noise that the simulation adds (a gain)": over_arms(from_arm - quiet),
    }


def _courses(rows: TrialRows, block: int, caption: str) -> Picture:
    shown = {}
    for figure, label, factor in (
        ("reward", "reward [-]", 1.0),
        ("success_rate", "success [%]", 100.0),
        ("actions", "actions of\nsuccesses [-]", 1.0),
        ("switches", "switches of\nsuccesses [-]", 1.0),
    ):
        level = factor * mean(rows, EXPLORING + figure, 1).mean
        shown[label] = [
            Curve(f"learning rate {rate:.2f}", factor * blocks(rows, figure, trial), level)
            for trial, rate in RATES.items()
        ]
    return courses(shown, block, caption)
