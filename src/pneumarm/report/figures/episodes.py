"""The distribution of the test's episodes: reward, actions, switches (thesis section 5.2)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, INK, LIGHT
from pneumarm.report.style import Described, nothing, panels, styled, whole_ticks

Array = NDArray[Any]


@styled
def distributions(reward: Array, actions: Array, switches: Array, success: NDArray[np.bool_]) -> Described:
    """Draw how reward, actions and switches of the episodes are distributed, successes and failures apart.

    Args:
        reward: reward of each episode, shape (n,).
        actions: its number of actions, shape (n,).
        switches: its number of switches, shape (n,).
        success: whether it reached its goal, shape (n,).

    """
    figure, axes = panels(1, 3, 2.6)
    words = (
        [f"Histograms of {len(reward):,} episodes, {np.mean(success):.2%} of them successful."] if len(reward) else []
    )
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
        fewest, middle, most = np.percentile(values, (5, 50, 95))
        name = label.removesuffix(" [-]").capitalize()
        words.append(f"{name}: median {middle:.4g}, 90% within {fewest:.4g} to {most:.4g}.")
        place.axvline(middle, color=INK, ls="--", lw=1)
        place.set_title(f"median {middle:g}".replace("-", "−"))
    if len(reward):
        axes[0, 1].legend(loc="upper right")
    figure.alt = " ".join(words) or "No episodes were recorded."
    return figure
