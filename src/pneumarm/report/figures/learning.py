"""Learning in many simulated arms at once: reward and success over the episodes."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.report.style import DARK, GREY, key, legend_below, nothing, panels, styled

Array = NDArray[np.float64]


@styled
def learning_curves(episodes: Array, reward: Array, success: Array, chosen: int) -> Figure:
    """Draw what the agents reached while they learned; the chosen agent stands out.

    Args:
        episodes: episodes at each evaluation, shape (agents, evaluations).
        reward: mean reward of the episodes since the evaluation before, exploring, the same shape.
        success: their success rate, the same shape.
        chosen: index of the chosen agent.

    """
    figure, axes = panels(1, 2, 2.8)
    agents = len(episodes)
    order = [a for a in range(agents) if a != chosen] + ([chosen] if agents else [])
    for place, values, label in (
        (axes[0, 0], reward, "reward an episode, exploring [-]"),
        (axes[0, 1], 100 * success, "success, exploring [%]"),
    ):
        place.set_xlabel("episodes [thousands]")
        place.set_ylabel(label)
        for agent in order:
            style = {"color": DARK, "lw": 1.8} if agent == chosen else {"color": GREY, "lw": 0.9}
            marker = "o" if episodes.shape[1] == 1 else None
            place.plot(episodes[agent] / 1e3, values[agent], **style, marker=marker)
        if agents == 0 or episodes.shape[1] == 0:
            nothing(place, "no agent was trained")
        else:
            place.set_xlim(0)
    if agents and episodes.shape[1]:
        best = float(reward.max())
        axes[0, 0].set_ylim(max(float(reward.min()), best - 100), best + 5)  # the very first ones wander about
        legend_below(figure, [key(DARK, lw=1.8), key(GREY, lw=0.9)], ["chosen agent", f"the other {agents - 1}"])
    return figure


def learning_curves_alt(episodes: Array, reward: Array, success: Array, chosen: int) -> str:
    """Say in words what :func:`learning_curves` shows."""
    if episodes.size == 0:
        return "No agent was trained."
    return (
        f"Learning of {len(episodes)} agents. The chosen one made {episodes[chosen, -1]:,.0f} episodes; its reward "
        f"while exploring rose from {reward[chosen, 0]:.1f} to {reward[chosen, -1]:.1f} and its success from "
        f"{success[chosen, 0]:.1%} to {success[chosen, -1]:.1%}."
    )
