"""What happens on the arm, episode after episode (thesis section 5.5.1, figures 5.9 to 5.12)."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, INK, LIGHT, MIDDLE
from pneumarm.report.style import Described, legend_below, nothing, panels, styled
from pneumarm.statistics import Moving, moving_mean, moving_rate

Array = NDArray[Any]

WINDOW = 100
"""Episodes in a moving average."""
_POINTS = 400  # of a curve in one phase; more cannot be told apart in print


class Phase(NamedTuple):
    """The episodes of one phase on the arm, each shape (n,)."""

    name: str
    reward: Array
    success: NDArray[np.bool_]
    actions: Array
    switches: Array
    time_end: Array
    """[s] since the first episode on the arm began."""


class _Row(NamedTuple):
    name: str
    label: str
    moving: Callable[[Phase, int], Moving]
    scale: float = 1.0


_ROWS = (
    _Row("reward", "reward [-]", lambda p, w: moving_mean(p.reward, w)),
    _Row("success_rate", "success [%]", lambda p, w: moving_rate(p.success, w), 100.0),
    _Row("actions", "actions of\nsuccesses [-]", lambda p, w: moving_mean(p.actions, w, p.success)),
    _Row("switches", "switches of\nsuccesses [-]", lambda p, w: moving_mean(p.switches, w, p.success)),
)


@styled
def transfer_curves(phases: list[Phase], reference: Mapping[str, float], window: int = WINDOW) -> Described:
    """Draw moving averages with 95% bands over the episodes on the arm, phase after phase.

    Args:
        phases: what happened on the arm, in order.
        reference: the level in the simulation's test of reward, success_rate, actions and switches (the last two
            of successful episodes); what is missing is not drawn.
        window: episodes in a moving average; fewer at the ends of a phase, over which it does not reach.

    """
    figure, axes = panels(len(_ROWS), 1, 7.6, sharex=True)
    begins = np.cumsum([0, *(len(p.reward) for p in phases)])
    total = int(begins[-1])
    handles: list[object] = []
    words = [_in_words(phase) for phase in phases if len(phase.reward)]
    known = f" In the simulation's test the reward was {reference['reward']:.2f}." if "reward" in reference else ""
    for place, row in zip(axes[:, 0], _ROWS, strict=True):
        place.set_ylabel(row.label)
        if row.name in reference and np.isfinite(reference[row.name]):
            level = place.axhline(row.scale * reference[row.name], color=MIDDLE, ls="--", lw=1.2)
            handles = [level]
        for phase, begin in zip(phases, begins, strict=False):
            _curve(place, row.moving(phase, window), float(begin), row.scale)
        for edge in begins[1:-1]:
            place.axvline(edge, color=INK, lw=0.8, ls=":")
        if total == 0:
            nothing(place, "no episodes on the arm")
    axes[-1, 0].set_xlabel("episodes on the arm [-]")
    axes[-1, 0].set_xlim(0, max(total, 1))
    top = axes[0, 0]
    for phase, begin in zip(phases, begins, strict=False):
        if len(phase.reward):
            top.text(
                begin + len(phase.reward) / 2, 0.03, phase.name, transform=top.get_xaxis_transform(), ha="center",
                va="bottom", fontsize=8.5, fontweight="bold", color=INK,
                bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 1.5},
            )  # fmt: skip
    if total:
        _clock(top, np.concatenate([p.time_end for p in phases]))
    line = axes[0, 0].plot([], [], color=DARK)[0]
    band = axes[0, 0].fill_between([], [], [], color=LIGHT, alpha=0.55, lw=0)
    labels = [f"moving average of {window} episodes", "its 95% confidence band", "in the simulation's test"]
    legend_below(figure, [line, band, *handles], labels[: 2 + len(handles)])
    figure.align_ylabels(axes[:, 0])
    figure.alt = "No episodes were done on the arm."
    if words:
        figure.alt = f"Moving averages of {window} episodes on the arm. {'; '.join(words)}.{known}"
    return figure


def _in_words(phase: Phase) -> str:
    won = phase.success
    text = f"{phase.name}: {len(won):,} episodes, reward {phase.reward.mean():.2f}, success {won.mean():.1%}"
    if not won.any():
        return text
    return f"{text}, {phase.actions[won].mean():.1f} actions and {phase.switches[won].mean():.2f} switches a success"


def _curve(place: Axes, moving: Moving, begin: float, scale: float) -> None:
    if len(moving.mean) == 0:
        return
    thin = slice(None, None, -(-len(moving.mean) // _POINTS))
    x, mean, low, high = (values[thin] for values in moving)
    x = begin + x + 1
    place.fill_between(x, scale * low, scale * high, color=LIGHT, alpha=0.55, lw=0)
    place.plot(x, scale * mean, color=DARK, marker="o" if len(x) == 1 else None)


def _clock(place: Axes, time_end: Array) -> None:
    """Add the time on the arm above ``place``; ``time_end`` (n,) [s] of the episodes in order."""
    hours, most = (3600.0, "h") if time_end[-1] > 5400 else (60.0, "min")
    time = np.concatenate([[0.0], time_end]) / hours
    ticks = [t for t in MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(0, time[-1]) if 0 <= t <= time[-1]]
    above = place.twiny()
    above.set_xlim(place.get_xlim())
    above.set_xticks(np.interp(ticks, time, np.arange(len(time))), [f"{t:g}" for t in ticks])
    above.set_xlabel(f"time on the arm [{most}]")
    above.spines["top"].set_visible(True)
    above.grid(visible=False)
