"""Analysis of variance of trials and runs: how much of the variation each column explains, and its significance.

In an orthogonal array the sums of squares of the columns add up. With y_tr the result of trial t in run r,

    S_column = sum over levels of N_level (mean at the level - mean)^2,    levels - 1 degrees of freedom
    S_run    = sum over runs of N_run (mean of the run - mean)^2,          runs - 1 degrees of freedom
    S_error  = what is left of sum (y_tr - mean)^2

Runs are blocks here: all trials of a run begin with the same weights (section 5.3), so what the weights do to all of
them alike is taken out of the error. Effects smaller than the error can be pooled into it; that is what Taguchi does
(G. Taguchi, System of Experimental Design, 1987), and the only way to an error where there is one run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.arrays import OrthogonalArray
from pneumarm.experiments.design.distributions import f_tail


@dataclass(frozen=True)
class Source:
    """A line of the table."""

    name: str
    squares: float
    """Sum of squares, in the unit of the results squared."""
    freedom: int
    """Degrees of freedom."""
    ratio: float = float("nan")
    """F: mean square over that of the error; NaN for the error and the total."""
    p: float = float("nan")
    """Probability of such an F by chance."""
    share: float = float("nan")
    """Share of the total sum of squares, without what the error alone would contribute; not below 0."""

    @property
    def mean_square(self) -> float:
        """Sum of squares by degree of freedom."""
        return self.squares / self.freedom if self.freedom else float("nan")


def anova(
    array: OrthogonalArray, results: ArrayLike, names: Sequence[str], pooled: Sequence[int] = (), blocks: bool = True
) -> tuple[Source, ...]:
    """Return the sources of variance: columns, runs, error, total.

    Args:
        array: the design's array.
        results: shape (trials, runs).
        names: of the columns, shape (columns,).
        pooled: columns, from 1, that count as error.
        blocks: whether the runs are blocks; if not, what they differ by is error.

    Raises:
        UnusableInput: shapes do not fit, or nothing is left to tell the error from.

    """
    y = np.asarray(results, np.float64)
    if y.ndim != 2 or y.shape[0] != array.trials or len(names) != array.columns:
        raise UnusableInput(f"expected {array.trials} trials and {array.columns} names, got {y.shape}, {len(names)}")
    mean, total = y.mean(), float(((y - y.mean()) ** 2).sum())
    columns = []
    for c, name in enumerate(names):
        averages = [(array.levels[:, c] == level) for level in range(array.counts[c])]
        squares = sum(at.sum() * y.shape[1] * (y[at].mean() - mean) ** 2 for at in averages)
        columns.append(Source(name, float(squares), len(averages) - 1))
    sources = [source for c, source in enumerate(columns, 1) if c not in pooled]
    if blocks and y.shape[1] > 1:
        runs = float(((y.mean(axis=0) - mean) ** 2).sum() * y.shape[0])
        sources.append(Source("runs", runs, y.shape[1] - 1))
    freedom = y.size - 1 - sum(source.freedom for source in sources)
    if freedom < 1:
        raise UnusableInput("nothing is left to tell the error from: repeat the runs, or pool small effects")
    error = Source("error", max(0.0, total - sum(source.squares for source in sources)), freedom)
    return (*(_judged(source, error, total) for source in sources), error, Source("total", total, y.size - 1))


def _judged(source: Source, error: Source, total: float) -> Source:
    noise = error.mean_square
    if noise <= 0:  # nothing varies besides what is explained, as with a training that always ends at its limit
        return source
    ratio = source.mean_square / noise
    share = max(0.0, source.squares - source.freedom * noise) / total if total > 0 else 0.0
    return Source(
        source.name, source.squares, source.freedom, ratio, f_tail(ratio, source.freedom, error.freedom), share
    )


def smallest(sizes: ArrayLike, count: int) -> tuple[int, ...]:
    """Return the ``count`` columns, from 1, with the smallest effects (columns,): candidates for pooling."""
    return tuple(sorted(int(c) + 1 for c in np.argsort(np.asarray(sizes), kind="stable")[:count]))
