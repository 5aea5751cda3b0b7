"""The thesis' numbers next to ours."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pneumarm.report.page import Section, Table

Array = NDArray[np.float64]


def side_by_side(
    trials: Mapping[int, str], ours: Mapping[str, Array], thesis: Mapping[str, Array], words: Mapping[str, str]
) -> Section:
    """Return means and standard deviations over the runs of every trial, ours and the thesis'.

    Args:
        trials: in words, by number.
        ours: results (trials, runs) by criterion.
        thesis: the same, for the criteria that the thesis has.
        words: criteria in words.

    """
    header, cells = ["trial", "settings"], [[str(trial), text] for trial, text in trials.items()]
    for name, results in ours.items():
        header += [name, *([f"{name}, thesis"] if name in thesis else [])]
        for row, values in zip(cells, results, strict=True):
            row.append(mean_and_spread(values))
        if name in thesis:
            for row, values in zip(cells, thesis[name], strict=True):
                row.append(mean_and_spread(values))
    explained = "; ".join(f"{name}: {words.get(name, name)}" for name in ours)
    text = [f"Mean ± standard deviation over the runs. {explained[0].upper()}{explained[1:]}."]
    return Section("The thesis beside ours", text, tables=[Table(header, cells, "All trials.")])


def mean_and_spread(values: Array) -> str:
    """Return the mean of ``values`` (runs,) and their standard deviation where there are two."""
    digits = 0 if np.abs(values).max() >= 1000 else 2
    spread = f" ± {values.std(ddof=1):.{digits}f}" if len(values) > 1 else ""
    return f"{values.mean():.{digits}f}{spread}"
