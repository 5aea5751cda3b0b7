"""Baselines side by side: what each is paid against how long it was trained."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, GREY, INK, LIGHT, MIDDLE
from pneumarm.report.style import Described, key, legend_below, nothing, panels, styled
from pneumarm.statistics import Estimate

Array = NDArray[np.float64]

_INKS = (DARK, MIDDLE, LIGHT, GREY)
_MARKERS = "oDsv^PX*"
_LINES = ("--", ":", "-.")
_AIR = 2.0
"""Workspace above and below the rewards that are shown [reward]."""
_MOST_BELOW = 45.0
"""Rewards farther below the best are cut off: how bad a bad one is matters less than how the good ones differ."""


class Baseline(NamedTuple):
    """What came of a method on some arms, agent by agent."""

    name: str
    seconds: Array
    """Processor time of each agent's training, shape (agents,) [s]."""
    reward: Array
    """Mean reward of each, shape (agents,)."""
    mean: Estimate
    """Over all movements of all agents."""


@styled
def baselines(trained: Sequence[Baseline], untrained: Mapping[str, Estimate]) -> Described:
    """Draw reward against the processor time of training.

    Args:
        trained: each a marker with an interval among the smaller ones of its agents.
        untrained: what needs no training, such as the bound: each a line across.

    """
    figure, axes = panels(1, 1, 4.2)
    place = axes[0, 0]
    place.set_xlabel("processor time of a training [s]")
    place.set_ylabel("reward a movement on arrival on the arm [-]")
    if not trained and not untrained:
        nothing(place, "no baseline was measured")
        figure.alt = "Reward against training time. No baseline was measured."
        return figure
    handles, labels, words = [], [], []
    for number, (name, level) in enumerate(untrained.items()):
        ink, line = (INK, MIDDLE, GREY)[number % 3], _LINES[number % 3]
        place.axhline(level.mean, color=ink, ls=line, lw=1.2)
        handles.append(key(ink, line, lw=1.2))
        labels.append(f"{name} {level.mean:.1f}")
        words.append(f"{name}: {level.mean:.2f} without training")
    for number, baseline in enumerate(trained):
        ink, marker = _INKS[number % len(_INKS)], _MARKERS[number % len(_MARKERS)]
        _marked(place, baseline, ink, marker)
        handles.append(key(ink, "", marker=marker, ms=7, mec=INK, mew=0.6))
        labels.append(f"{baseline.name} {baseline.mean.mean:.1f}")
        words.append(
            f"{baseline.name}: {baseline.mean.mean:.2f} after {baseline.seconds.mean():.1f} s of training, its "
            f"{len(baseline.seconds)} agents {baseline.reward.min():.2f} to {baseline.reward.max():.2f}"
        )
    place.set_xscale("log")
    if trained:
        seconds = np.concatenate([baseline.seconds for baseline in trained])
        low, high = 0.6 * seconds.min(), 1.6 * seconds.max()
        ticks = [t for t in np.outer(10.0 ** np.arange(-3, 7), (1, 2, 5)).ravel() if low <= t <= high]
        place.set_xticks(ticks, [f"{t:g}" for t in ticks])
        place.set_xticks([], minor=True)
        place.set_xlim(low, high)
    paid = [level.mean for level in untrained.values()]
    paid += [value for baseline in trained for value in _paid(baseline)]
    worst = max(paid) - _MOST_BELOW
    if trained:  # the best method is shown as a whole
        worst = min(worst, *_paid(max(trained, key=lambda baseline: baseline.mean.mean)))
    place.set_ylim(max(min(paid), worst) - _AIR, max(paid) + _AIR)
    legend_below(figure, handles, labels)
    figure.alt = f"Reward against training time. {'; '.join(words)}."
    return figure


def _paid(baseline: Baseline) -> list[float]:
    return [value for value in (*baseline.reward.tolist(), baseline.mean.low) if np.isfinite(value)]


def _marked(place: Axes, baseline: Baseline, ink: str, marker: str) -> None:
    place.plot(baseline.seconds, baseline.reward, marker, color=ink, ms=3.5, alpha=0.55, mew=0)
    centre = float(np.exp(np.log(baseline.seconds).mean()))
    place.errorbar(
        centre, baseline.mean.mean,
        yerr=[[baseline.mean.mean - baseline.mean.low], [baseline.mean.high - baseline.mean.mean]]
        if np.isfinite(baseline.mean.low) else None,
        fmt=marker, color=ink, ecolor=INK, elinewidth=1.0, capsize=3, ms=8, mec=INK, mew=0.6, zorder=3,
    )  # fmt: skip
