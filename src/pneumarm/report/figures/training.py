"""The training in the simulation: what learning went like (thesis section 4.3)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import DARK, GREY, MIDDLE
from pneumarm.report.style import Described, key, legend_below, nothing, panels, styled

Array = NDArray[np.float64]


EPISODES, CRITERION, DEVIATION = "episodes", "criterion", "deviation"
PRICE = "price"
_LABELS = {
    DEVIATION: ("deviation [°]", 1.0),
    "performance": ("performance p(k) [-]", 1.0),
    "epsilon": ("exploring share ε [-]", 1.0),
    "temperature": ("temperature T [-]", 1.0),
    "reward": ("reward an episode, exploring [-]", 1.0),
    "success": ("success, exploring [%]", 100.0),
    PRICE: ("price of a control period [-]", 1.0),
    "settled": ("within tolerance at the end [%]", 100.0),
}
"""Labels of curves by the name of their column, and what values are multiplied by; others are called as they are."""
_WORST = 100.0  # of rewards, below the best: the very first ones wander about


@styled
def training_curves(
    curves: Array, columns: Sequence[str], evaluated: NDArray[np.int64], chosen: int, spec: ArmSpec
) -> Described:
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
        label, factor = _label(name, spec)
        place.set_ylabel(label)
        for agent in [*(a for a in range(agents) if a != chosen), *([chosen] if agents else [])]:
            upto = slice(int(evaluated[agent]))
            style = {"color": DARK, "lw": 1.8} if agent == chosen else {"color": GREY, "lw": 0.6, "alpha": 0.7}
            marker = "o" if upto.stop == 1 else None
            place.plot(curves[agent, upto, 0] / 1e3, factor * values[agent, upto], **style, marker=marker)
        if not evaluated.any():
            nothing(place, "no agent was trained")
    handles, words = (
        [key(DARK, lw=1.8), key(GREY, lw=0.6)],
        ["chosen agent", "the other" if agents == 2 else f"the other {agents - 1}"],
    )
    if evaluated.any() and {"performance", CRITERION} <= set(columns):
        best = curves[chosen, : int(evaluated[chosen])]
        of["performance"][0].plot(best[:, 0] / 1e3, best[:, columns.index(CRITERION)], color=MIDDLE, ls="--")
        handles.insert(1, key(MIDDLE, "--"))
        words.insert(1, "its criterion")
    if evaluated.any():
        legend_below(figure, handles, words)
    _limit(of, evaluated, spec)
    for place in axes[-1]:
        place.set_xlabel("episodes [thousands]")
    figure.alt = "No agent was trained."
    if evaluated.any():
        mine = curves[chosen, : int(evaluated[chosen])]
        changes = []
        for name, first, last in zip(columns[1:], mine[0, 1:], mine[-1, 1:], strict=True):
            label, factor = _label(name, spec)
            called, unit = label.removesuffix("]").split(" [")
            changes.append(f"{called} from {factor * first:.4g} to {factor * last:.4g} {unit}".removesuffix(" -"))
        figure.alt = (
            f"Learning of {agents} agents. The chosen one made {mine[-1, 0]:,.0f} episodes; meanwhile "
            f"{'; '.join(changes)}."
        )
    return figure


def _label(name: str, spec: ArmSpec) -> tuple[str, float]:
    """Return the label of a column's axis and what its values are multiplied by."""
    label, factor = _LABELS.get(name, (f"{name} [-]", 1.0))
    return label, factor / spec.counts_per_degree if name == DEVIATION else factor


def _limit(of: Mapping[str, tuple[Any, Array]], evaluated: NDArray[np.int64], spec: ArmSpec) -> None:
    """Let axes begin at 0, but for rewards."""
    for name, (place, values) in of.items():
        place.set_xlim(0)
        known = np.concatenate([values[agent, : int(rows)] for agent, rows in enumerate(evaluated)] or [np.zeros(0)])
        if name != "reward" and (known >= 0).all():
            place.set_ylim(0, 1.05 * float(known.max(initial=0.0)) * _label(name, spec)[1] or None)
        elif name == "reward" and known.size:
            best = float(known.max())
            place.set_ylim(max(float(known.min()), best - _WORST), best + 5)
