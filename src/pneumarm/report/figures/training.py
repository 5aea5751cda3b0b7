"""The training in the simulation: shaping over the episodes, and the spread of the agents (thesis section 4.3)."""

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


@styled
def shaping_curves(
    episodes: Array,
    deviation: Array,
    criterion: Array,
    performance: Array,
    epsilon: Array,
    temperature: Array,
    evaluations: NDArray[np.int64],
    chosen: int,
    spec: ArmSpec,
) -> Figure:
    """Draw the shaping of every agent over its episodes; the chosen agent stands out.

    Args:
        episodes: episodes at each evaluation, shape (evaluations,).
        deviation: largest distance of a begin state from the goal, shape (agents, evaluations) [counts].
        criterion: share of successes asked for, the same shape.
        performance: p(k) of eq. 4.14, the same shape.
        epsilon: share of exploring actions, the same shape.
        temperature: of the Boltzmann exploration, the same shape.
        evaluations: how many of the evaluations each agent took before its training ended, shape (agents,).
        chosen: index of the chosen agent.
        spec: the arm, for units.

    """
    figure, axes = panels(2, 2, 4.6, sharex=True)
    curves = (
        (axes[0, 0], deviation, "deviation [counts]"),
        (axes[0, 1], performance, "performance p(k) [-]"),
        (axes[1, 0], epsilon, "exploring share ε [-]"),
        (axes[1, 1], temperature, "temperature T [-]"),
    )
    agents = len(evaluations)
    order = [a for a in range(agents) if a != chosen] + ([chosen] if agents else [])
    for place, curve, label in curves:
        place.set_ylabel(label)
        for agent in order:
            upto = slice(int(evaluations[agent]))
            best = agent == chosen
            style = {"color": DARK, "lw": 1.8} if best else {"color": GREY, "lw": 0.6, "alpha": 0.7}
            place.plot(episodes[upto] / 1e3, curve[agent, upto], **style, marker="o" if upto.stop == 1 else None)
        if agents == 0:
            nothing(place, "no agent was trained")
    if agents:
        upto = slice(int(evaluations[chosen]))
        axes[0, 1].plot(episodes[upto] / 1e3, criterion[chosen, upto], color=MIDDLE, ls="--")
        second_unit(axes[0, 0], "deviation [°]", 1 / spec.counts_per_degree)
        handles = [key(DARK, lw=1.8), key(MIDDLE, "--"), key(GREY, lw=0.6)]
        legend_below(figure, handles, ["chosen agent", "its criterion", f"the other {agents - 1}"])
    for place in axes[-1]:
        place.set_xlabel("episodes [thousands]")
        place.set_xlim(0)
    for place in axes.flat:
        place.set_ylim(0)
    return figure


def shaping_curves_alt(
    episodes: Array, deviation: Array, performance: Array, evaluations: NDArray[np.int64], chosen: int, spec: ArmSpec
) -> str:
    """Say in words what :func:`shaping_curves` shows."""
    if len(evaluations) == 0 or evaluations[chosen] == 0:
        return "No agent was trained."
    last = int(evaluations[chosen]) - 1
    ends = np.array([episodes[max(int(e) - 1, 0)] for e in evaluations])
    return (
        f"Shaping of {len(evaluations)} agents. The chosen one trained for {episodes[last]:,.0f} "
        "episodes; its deviation "
        f"grew from {deviation[chosen, 0]:.0f} to {deviation[chosen, last]:.0f} counts "
        f"({deviation[chosen, last] / spec.counts_per_degree:.0f}°) and its performance ended at "
        f"{performance[chosen, last]:.3f}. All agents ended after {ends.min():,.0f} to {ends.max():,.0f} episodes."
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
    if len(order):
        axes[0, 0].legend(loc="lower left")
    if len(order):
        axes[0, 1].set_ylim(top=100.5)  # there is nothing above 100 %, and a mark at it is seen whole
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
