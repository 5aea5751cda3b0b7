"""The thesis' numbers next to ours."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.trainings import EXPLORING
from pneumarm.report.page import Section, Table

Array = NDArray[np.float64]
Results = Mapping[str, Sequence[Any] | Array]
"""Results by criterion: (trials, runs), or an array of runs for each trial."""


def side_by_side(
    trials: Mapping[int, str], ours: Results, thesis: Results, words: Mapping[str, str], labels: str = ""
) -> Section:
    """Return means and standard deviations over the runs of every trial, ours and the thesis', a table a criterion.

    Args:
        trials: in words, by number.
        ours: greedy and, where the test was also made so, exploring.
        thesis: the same, for the criteria that the thesis has.
        words: criteria in words.
        labels: what the trials' words mean, where they are abbreviated.

    """
    tables = []
    for name, greedy in ours.items():
        if name.startswith(EXPLORING):
            continue
        columns = {"here": greedy}
        if EXPLORING + name in ours:
            columns = {"here, greedy": greedy, "here, exploring": ours[EXPLORING + name]}
        if name in thesis:
            columns["thesis"] = thesis[name]
        rows = [
            [f"{trial}: {text}", *(mean_and_spread(results[place]) for results in columns.values())]
            for place, (trial, text) in enumerate(trials.items())
        ]
        named = words.get(name, name)
        tables.append(Table(["trial", *columns], rows, f"{named[0].upper()}{named[1:]}."))
    title = "The thesis beside ours" if thesis else "Trials by criterion"
    return Section(title, [f"Mean ± standard deviation over all runs. {labels}".strip()], tables=tables)


def mean_and_spread(values: Array) -> str:
    """Return the mean of ``values`` (runs,) and their standard deviation where there are two."""
    digits = 0 if np.abs(values).max() >= 1000 else 2
    spread = f" ± {values.std(ddof=1):,.{digits}f}" if len(values) > 1 else ""
    return f"{values.mean():,.{digits}f}{spread}".replace("-", "−")
