"""The distribution of the test's episodes: reward, actions, switches (thesis section 5.2)."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.report.colours import DARK, INK, LIGHT
from pneumarm.report.style import nothing, panels, styled, whole_ticks

Array = NDArray[Any]


@styled
def distributions(reward: Array, actions: Array, switches: Array, success: NDArray[np.bool_]) -> Figure:
    """Draw how reward, actions and switches of the episodes are distributed, successes and failures apart.

    Args:
        reward: reward of each episode, shape (n,).
        actions: its number of actions, shape (n,).
        switches: its number of switches, shape (n,).
        success: whether it reached its goal, shape (n,).

    """
    figure, axes = panels(1, 3, 2.6)
    for place, values, label in zip(
        axes[0], (reward, actions, switches), ("reward [-]", "actions [-]", "switches [-]"), strict=True
    ):
        place.set_xlabel(label)
        place.set_ylabel("episodes [%]")
        whole_ticks(place)
        if len(values) == 0:
            nothing(place, "no episodes")
            continue
        # The central 99.5% are drawn, so that a few failures with very low rewards do not squeeze the rest.
        low, high = np.percentile(values, (0.5, 100) if values is reward else (0, 99.5))
        width = max(1, round((high - low) / 40))
        edges = np.arange(np.floor(low) - 0.5, np.ceil(high) + 0.5 + width, width)
        seen = np.clip(values, edges[0], edges[-1])
        share = np.full(len(values), 100 / len(values))
        place.hist(
            [seen[success], seen[~success]], edges, weights=[share[success], share[~success]], stacked=True,
            color=[DARK, LIGHT], label=["success", "failure"],
        )  # fmt: skip
        middle = float(np.median(values))
        place.axvline(middle, color=INK, ls="--", lw=1)
        place.set_title(f"median {middle:g}".replace("-", "−"))
    if len(reward):
        axes[0, 1].legend(loc="upper right")
    return figure


def distributions_alt(reward: Array, actions: Array, switches: Array, success: NDArray[np.bool_]) -> str:
    """Say in words what :func:`distributions` shows."""
    if len(reward) == 0:
        return "No episodes were recorded."

    def middle(values: Array) -> str:
        low, median, high = np.percentile(values, (5, 50, 95))
        return f"median {median:.4g}, 90% within {low:.4g} to {high:.4g}"

    return (
        f"Histograms of {len(reward):,} episodes, {np.mean(success):.2%} of them successful. Reward: "
        f"{middle(reward)}. "
        f"Actions: {middle(actions)}. Switches: {middle(switches)}."
    )
