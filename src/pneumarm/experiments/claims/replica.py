"""How close our agents come to the thesis' tables, how close the tables let anybody come, and which test is theirs.

The thesis tests with a learning rate of 0 and does not say whether exploring ends too. Which of both it did is chosen
by the level of the odd trials alone, reward and success; no effect is looked at, and the even trials show whether
the choice is right there too. Claims on trainings are judged by the test that was chosen.

A rank correlation with a table is bounded by how well the table agrees with itself. Its runs differ by their weights
alone, so Cronbach's alpha of them is the reliability of its means, and no replica is expected to correlate with them
by more than the root of both reliabilities, its own being that of its arms (C. Spearman, Am. J. Psychol. 15, 1904).
"""

import math
from collections.abc import Mapping
from itertools import product

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.experiment import TrialRows
from pneumarm.experiments.factorial import Factorial, rank_correlation
from pneumarm.experiments.means import over_arms
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.trainings import EXPLORING
from pneumarm.report.page import Section, Table

Rows = Mapping[str, TrialRows]
"""Rows by the name of their experiment."""
WANTED, NEAR, NEARLY_ALL = 0.7, 5.0, 0.97
"""Rank correlation, distance of the means and success that a replica was to reach."""
_GOAL = 51.0  # reward of a goal in place of an action that reaches none
TESTS = {"": "greedy", EXPLORING: "exploring"}


def alpha(table: NDArray[np.float64]) -> float:
    """Return Cronbach's alpha of the means of ``table`` (trials, runs) over its runs; 0 where runs do not agree."""
    runs, total = table.shape[1], table.sum(axis=1).var(ddof=1)
    if runs < 2 or total == 0:
        return 0.0
    return max(0.0, float(runs / (runs - 1) * (1 - table.var(axis=0, ddof=1).sum() / total)))


def by_test(rows: TrialRows, test: str) -> TrialRows:
    """Return ``rows`` with the figures of one test alone, under the names of the greedy one."""
    if EXPLORING + "reward" not in rows.figures:
        return rows
    made = []
    for row in rows.rows:
        figures = {name: x for name, x in row.figures.items() if not name.startswith(EXPLORING)}
        figures |= {name.removeprefix(test): x for name, x in row.figures.items() if test and name.startswith(test)}
        made.append(msgspec.structs.replace(row, figures=figures))
    return TrialRows(tuple(made))


def compared(rows: Rows) -> dict[str, Factorial]:
    """Return the experiments with rewards of the thesis to compare with, whose agents were tested in both ways."""
    made = {name: experiment(name) for name, found in rows.items() if EXPLORING + "reward" in found.figures}
    return {name: one for name, one in made.items() if isinstance(one, Factorial) and "reward" in one.thesis}


def chosen_test(rows: Rows) -> str:
    """Return the prefix of the test whose level is nearer to the thesis' in the odd trials."""

    def distance(test: str) -> float:
        found = 0.0
        for name, made in compared(rows).items():
            odd = list(made.trials)[::2]
            reward, reached = (rows[name].table(test + figure, odd).mean() for figure in ("reward", "success_rate"))
            found += abs(reward - made.thesis["reward"][::2].mean()) + _GOAL * abs(1 - reached)
        return float(found)

    return min(TESTS, key=distance)


def replica(rows: Rows) -> Section | None:
    """Return the section on the replica; None where no rows have both tests."""
    lines = [_line(made, rows[name], test) for (name, made), test in product(compared(rows).items(), TESTS)]
    if not lines:
        return None
    header = ["experiment", "test", "odd trials (thesis)", "even trials (thesis)", "success", "switches (thesis)"]
    header += ["rank correlation", "most, by the table", "most, by these rows too"]
    text = [
        "The thesis does not say whether its agents explore while they are tested. By the level of the odd trials, "
        f"reward and success, its test is the {TESTS[chosen_test(rows)]} one; claims on trainings are judged by it.",
        f"Wanted: a rank correlation of the trials' rewards of {WANTED:g}, a mean within {NEAR:g} and a success of "
        f"{NEARLY_ALL:.0%}. How high a correlation can be expected follows from how well the table's runs, and our "
        "arms, agree on the order of the trials (Cronbach's alpha): where the most is below what was wanted, no "
        "replica is expected to reach it, however true. Intervals are over arms; the thesis had one.",
    ]
    return Section("The replica beside the thesis' tables", text, tables=[Table(header, lines, "Rewards by trial.")])


def _line(made: Factorial, rows: TrialRows, test: str) -> list[str]:
    trials, theirs = list(made.trials), made.thesis
    table = theirs["reward"]
    by_arm = np.stack([rows.table(test + "reward", trials, arm).mean(axis=1) for arm in rows.arms], axis=1)
    halves = [
        f"{over_arms(rows.pooled(test + 'reward', trials[first::2])):.1f} ({table[first::2].mean():.1f})"
        for first in (0, 1)
    ]
    most = (math.sqrt(alpha(table)), math.sqrt(alpha(table) * alpha(by_arm)))
    cells = [
        made.name,
        TESTS[test],
        *halves,
        f"{over_arms(rows.pooled(test + 'success_rate', trials)):.1%}",
        f"{over_arms(rows.pooled(test + 'switches', trials)):.2f} ({theirs['switches'].mean():.2f})",
        f"{rank_correlation(by_arm.mean(axis=1), table.mean(axis=1)):.2f}",
        *(f"{one:.2f}" for one in most),
    ]
    return [cells[0], *(cell.replace("-", "−") for cell in cells[1:])]
