"""How a controller settles, in the four figures that every command and page shows, with what is normal."""

from collections.abc import Mapping
from typing import Any, NamedTuple

SETTLED, SECONDS, REST_ERROR, OVERSHOOT = "90 % or more", "0.8 s or less", "0.3° or less", "2° or less"
"""What is normal after a default run. Of 300 virtual arms drawn wide nine in ten settle so often and so soon
(docs/how-well.md, "Arms drawn wide"); the errors are rounded up from ``pneumarm run`` on six of these arms."""


class ToldFigure(NamedTuple):
    """A figure for people."""

    name: str
    value: str
    normal: str


def told_figures(found: Mapping[str, Any]) -> list[ToldFigure]:
    """Return how many goals are settled at, how soon, how exactly and with which overshoot.

    Args:
        found: ``settle`` of :meth:`~.trial.MoveTrial.results`; older ones have no overshoot.

    """
    seconds, overshoot = found["median_seconds"], found.get("overshoot_deg")
    within = f"settled within {found['tolerance_deg']:g}°"
    return [
        ToldFigure(f"{within}, of {found['movements']} goals", f"{100 * found['settled']:.4g} %", SETTLED),
        ToldFigure("time, half of the goals", "–" if seconds is None else f"{seconds:.2f} s", SECONDS),
        ToldFigure("rest error, on average", f"{found['rest_error_deg']:.2f}°", REST_ERROR),
        *([] if overshoot is None else [ToldFigure("overshoot, half of the goals", f"{overshoot:.1f}°", OVERSHOOT)]),
    ]
