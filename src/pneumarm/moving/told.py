"""How a controller settles, in the four figures that every command and page shows, with what is normal."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

ON_THE_ARM = "90 % or more", "0.8 s or less", "0.3° or less", "2° or less"
"""What is normal after a default run. Of 300 virtual arms drawn wide nine in ten settle so often and so soon
(docs/how-well.md, "Arms drawn wide"). The errors are rounded up from ``pneumarm run`` on ``virtual``,
``virtual:seed=1001``, ``1002`` and ``virtual:wide,seed=5000`` to ``5005``, of which one overshoots more."""
IN_SIMULATION = "80 % or more", "0.8 s or less", "0.4° or less", "2° or less"
"""The same of ``pneumarm test`` with these nine simulations: what they do not know they add as noise."""


class ToldFigure(NamedTuple):
    """A figure for people."""

    name: str
    value: str
    normal: str


def told_figures(found: Mapping[str, Any], normal: Sequence[str] = ON_THE_ARM) -> list[ToldFigure]:
    """Return how many goals are settled at, how soon, how exactly and with which overshoot.

    Args:
        found: ``settle`` of :meth:`~.trial.MoveTrial.results`; older ones have no overshoot.
        normal: of the four, in that order.

    """
    seconds, overshoot = found["median_seconds"], found.get("overshoot_deg")
    within = f"settled within {found['tolerance_deg']:g}°"
    return [
        ToldFigure(f"{within}, of {found['movements']} goals", f"{100 * found['settled']:.4g} %", normal[0]),
        ToldFigure("time, half of the goals", "–" if seconds is None else f"{seconds:.2f} s", normal[1]),
        ToldFigure("rest error, on average", f"{found['rest_error_deg']:.2f}°", normal[2]),
        *([] if overshoot is None else [ToldFigure("overshoot, half of the goals", f"{overshoot:.1f}°", normal[3])]),
    ]
