"""The training in the simulation: what learning went like, and the spread of the agents (thesis section 4.3)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.report.style import (
    DARK,
    GREY,
    INK,
    LIGHT,
    MIDDLE,
    key,
    legend_below,
    nothing,
    panels,
    second_unit,
    styled,
    whole_ticks,
)

Array = NDArray[np.float64]


EPISODES, CRITERION, DEVIATION = "episodes", "criterion", "deviation"
LABELS = {
    DEVIATION: ("deviation [counts]", 1.0),
    "performance": ("performance p(k) [-]", 1.0),
    "epsilon": ("exploring share ε [-]", 1.0),
    "temperature": ("temperature T [-]", 1.0),
    "reward": ("reward an episode, exploring [-]", 1.0),
    "success": ("success, exploring [%]", 100.0),
}
"""Labels of curves by the name of their column, and what values are multiplied by; others are called as they are."""
_WORST = 100.0  # of rewards, below the best: the very first ones wander about


@styled
def training_curves(
    curves: Array, columns: Sequence[str], evaluated: NDArray[np.int64], chosen: int, spec: ArmSpec
) -> Figure:
    """Draw every column of training curves over the episodes; the chosen agent stands out.

    Args:
        curves: of each agent, shape (agents, rows, columns).
        columns: what they are, the first of them the episodes; a criterion is drawn into the performance.
        evaluated: how many rows each agent took before its training ended, shape (agents,).
        chosen: index of the chosen agent.
        spec: the arm, for units.

    """
    drawn = [name for name in columns[1:] if name != CRITERION]
    rows, agents = -(-len(drawn) // 2), len(evaluated)
    figure, axes = panels(rows, min(len(drawn), 2), 0.5 + 2.1 * rows, sharex=True)
    for place in axes.flat[len(drawn) :]:
        place.set_visible(False)
    of = {name: (place, curves[:, :, columns.index(name)]) for name, place in zip(drawn, axes.flat, strict=False)}
    for name, (place, values) in of.items():
        label, factor = LABELS.get(name, (f"{name} [-]", 1.0))
        place.set_ylabel(label)
        for agent in [*(a for a in range(agents) if a != chosen), *([chosen] if agents else [])]:
            upto = slice(int(evaluated[agent]))
            style = {"color": DARK, "lw": 1.8} if agent == chosen else {"color": GREY, "lw": 0.6, "alpha": 0.7}
            marker = "o" if upto.stop == 1 else None
            place.plot(curves[agent, upto, 0] / 1e3, factor * values[agent, upto], **style, marker=marker)
        if not evaluated.any():
            nothing(place, "no agent was trained")
    handles, words = [key(DARK, lw=1.8), key(GREY, lw=0.6)], ["chosen agent", f"the other {agents - 1}"]
    if evaluated.any() and {"performance", CRITERION} <= set(columns):
        best = curves[chosen, : int(evaluated[chosen])]
        of["performance"][0].plot(best[:, 0] / 1e3, best[:, columns.index(CRITERION)], color=MIDDLE, ls="--")
        handles.insert(1, key(MIDDLE, "--"))
        words.insert(1, "its criterion")
    if evaluated.any():
        if DEVIATION in of:
            second_unit(of[DEVIATION][0], "deviation [°]", 1 / spec.counts_per_degree)
        legend_below(figure, handles, words)
    _limit(of, evaluated)
    for place in axes[-1]:
        place.set_xlabel("episodes [thousands]")
    return figure


def _limit(of: Mapping[str, tuple[Any, Array]], evaluated: NDArray[np.int64]) -> None:
    """Let axes begin at 0, but for rewards."""
    for name, (place, values) in of.items():
        place.set_xlim(0)
        known = np.concatenate([values[agent, : int(rows)] for agent, rows in enumerate(evaluated)] or [np.zeros(0)])
        if name != "reward" and (known >= 0).all():
            place.set_ylim(0, 1.05 * float(known.max(initial=0.0)) * LABELS.get(name, ("", 1.0))[1] or None)
        elif name == "reward" and known.size:
            best = float(known.max())
            place.set_ylim(max(float(known.min()), best - _WORST), best + 5)


def training_curves_alt(curves: Array, columns: Sequence[str], evaluated: NDArray[np.int64], chosen: int) -> str:
    """Say in words what :func:`training_curves` shows."""
    if len(evaluated) == 0 or evaluated[chosen] == 0:
        return "No agent was trained."
    mine = curves[chosen, : int(evaluated[chosen])]
    told = [
        f"{name} from {a:.4g} to {b:.4g}" for name, a, b in zip(columns[1:], mine[0, 1:], mine[-1, 1:], strict=True)
    ]
    return (
        f"Learning of {len(evaluated)} agents. The chosen one made {mine[-1, 0]:,.0f} episodes; meanwhile "
        f"{'; '.join(told)}."
    )


@styled
def spread_of_agents(reward: Array, success: Array, chosen: int) -> Figure:
    """Draw the validation of all agents, ordered by reward.

    Args:
        reward: mean reward of each agent in the validation, shape (agents,).
        success: its success rate, shape (agents,).
        chosen: index of the chosen agent.

    """
    figure, axes = panels(1, 2, 2.6)
    order = np.argsort(-reward, kind="stable")
    rank = np.arange(1, len(order) + 1)
    picked = order == chosen
    for place, values, label in (
        (axes[0, 0], reward, "reward an episode [-]"),
        (axes[0, 1], 100 * success, "success [%]"),
    ):
        place.set_xlabel("agent, best reward first [-]")
        place.set_ylabel(label)
        whole_ticks(place)
        if len(order) == 0:
            nothing(place, "no agent was trained")
            continue
        place.plot(rank[~picked], values[order][~picked], "o", color=LIGHT, mec=INK, mew=0.6, ms=5, label="others")
        place.plot(rank[picked], values[order][picked], "D", color=DARK, mec=INK, mew=0.6, ms=7, label="chosen")
        place.set_xlim(0.4, len(order) + 0.6)
        place.margins(y=0.15)
        place.ticklabel_format(axis="y", useOffset=False)
    if len(order):
        axes[0, 0].legend(loc="lower left")
    if len(order):
        # There is nothing above 100 %, and marks at the ends are seen whole.
        lowest = 100 * float(success.min())
        axes[0, 1].set_ylim(lowest - 0.05 * max(100.5 - lowest, 1.0), 100.5)
    return figure


def spread_of_agents_alt(reward: Array, success: Array, chosen: int) -> str:
    """Say in words what :func:`spread_of_agents` shows."""
    if len(reward) == 0:
        return "No agent was trained."
    return (
        f"Validation of {len(reward)} agents from different initial weights: reward from {reward.min():.2f} to "
        f"{reward.max():.2f}, median {np.median(reward):.2f}; success from {success.min():.1%} to "
        f"{success.max():.1%}. "
        f"The chosen agent has reward {reward[chosen]:.2f} and success {success[chosen]:.1%}."
    )
