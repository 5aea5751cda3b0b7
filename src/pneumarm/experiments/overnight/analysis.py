"""What the rows say of the drop after a night, and of what brings the reward back."""

import numpy as np

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Array, blocks, over_arms
from pneumarm.experiments.overnight.days import DAYS, FROZEN, LEARNING, NO_NIGHT, Overnight
from pneumarm.experiments.pictures import Curve, courses
from pneumarm.experiments.verdict import Interval
from pneumarm.report.page import Table

_SPAN = 3  # blocks before the night, and at the end, that are the level of a day
_LABELS = {"reward": "reward [-]", "actions": "actions of\nsuccesses [-]", "switches": "switches of\nsuccesses [-]"}


def analysis(experiment: Overnight, rows: TrialRows) -> Analysis:
    """Return the drop after the night and what brings the reward back."""
    sizes = experiment.sizes
    rewards = {trial: blocks(rows, "reward", trial) for trial in DAYS}
    place = sizes.first // sizes.block
    drops = {trial: over_arms(_drop(reward, place)) for trial, reward in rewards.items()}
    gains = {trial: over_arms(_gain(reward, place)) for trial, reward in rewards.items()}
    lost = over_arms((rewards[NO_NIGHT] - rewards[LEARNING])[:, :, place])
    adapted = over_arms(_gain(rewards[LEARNING], place) - _gain(rewards[NO_NIGHT], place))
    words, found = filled_words(
        experiment,
        rows,
        lost=lost,
        adapted=adapted,
        drop=drops[FROZEN],
        warmed=gains[FROZEN],
        answer=answer(lost, drops[FROZEN]),
        span=_SPAN * sizes.block,
        block=sizes.block,
    )
    header = ["trial", "drop to the second day", "gained on the second day"]
    lines = [[days.words, f"{drops[t]:.2f}", f"{gains[t]:.2f}"] for t, days in DAYS.items()]
    shown = {
        label: [Curve(days.words, blocks(rows, figure, trial)) for trial, days in DAYS.items()]
        for figure, label in _LABELS.items()
    }
    (two_days,) = words.sections
    picture = courses(shown, sizes.block, two_days.figure, {float(sizes.first): f"{sizes.hours:g} h of rest"})
    return analysed(
        experiment,
        rows,
        words,
        found,
        figures={
            "drop": {DAYS[t].words: one.figures() for t, one in drops.items()},
            "gain": {DAYS[t].words: one.figures() for t, one in gains.items()},
            "lost": lost.figures(),
            "adapted": adapted.figures(),
        },
        pictures={0: [picture]},
        tables={0: [Table(header, lines, two_days.table)]},
    )


def answer(lost: Interval, frozen: Interval) -> str:
    """Return in words for whom the night significantly costs reward."""
    agents = {"an agent that learns": lost, "one that never learns": frozen}
    costs = [words for words, found in agents.items() if found.low > 0]
    if costs:
        return f"The night costs {' and '.join(costs)} reward."
    return "No drop is shown, so what would restore the reward cannot be seen."


def _gain(course: Array, place: int) -> Array:
    """Return what is gained from the first block of the second day to its end, shape (arms, runs)."""
    span = min(_SPAN, course.shape[-1] - place)
    return np.asarray(course[:, :, -span:].mean(axis=-1) - course[:, :, place])


def _drop(course: Array, place: int) -> Array:
    """Return the level of the first day less the first block of the second, shape (arms, runs)."""
    return np.asarray(course[:, :, place - min(_SPAN, place) : place].mean(axis=-1) - course[:, :, place])
