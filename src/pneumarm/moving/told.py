"""How a controller settles, in the four figures that every command and page shows, with what is normal."""

from collections.abc import Mapping
from typing import Any, NamedTuple


class Normal(NamedTuple):
    """What is normal: so many goals or more, the others or less."""

    settled: float
    seconds: float
    rest_error_deg: float
    overshoot_deg: float


ON_THE_ARM = Normal(0.9, 0.8, 0.3, 2.0)
"""After a default run. Of 300 virtual arms drawn wide nine in ten settle so often and so soon (docs/how-well.md,
"Arms drawn wide"). The errors are rounded up from ``pneumarm run`` on ``virtual``, ``virtual:seed=1001``, ``1002``,
``virtual:wide,seed=5000`` to ``5005``, of which one overshoots more."""
IN_SIMULATION = Normal(0.8, 0.8, 0.4, 2.0)
"""The same of ``pneumarm test`` with these nine simulations: what they do not know they add as noise."""


class ToldFigure(NamedTuple):
    """A figure for people."""

    name: str
    value: str
    normal: str = ""
    is_normal: bool = True


def told_figures(found: Mapping[str, Any], normal: Normal = ON_THE_ARM) -> list[ToldFigure]:
    """Return how many goals are settled at, how soon, how exactly and with which overshoot.

    Args:
        found: ``settle`` of :meth:`~.trial.MoveTrial.results`; older ones have no overshoot.
        normal: what is.

    """
    told = [
        ToldFigure(
            f"settled within {found['tolerance_deg']:g}°, of {found['movements']} goals",
            f"{100 * found['settled']:.4g} %",
            f"{100 * normal.settled:g} % or more",
            found["settled"] >= normal.settled,
        ),
        _at_most("time, half of the goals", found["median_seconds"], ".2f", " s", normal.seconds),
        _at_most("rest error, on average", found["rest_error_deg"], ".2f", "°", normal.rest_error_deg),
    ]
    if "overshoot_deg" in found:
        told.append(
            _at_most("overshoot, half of the goals", found["overshoot_deg"], ".1f", "°", normal.overshoot_deg)
        )
    return told


def _at_most(name: str, value: float | None, form: str, unit: str, most: float) -> ToldFigure:
    if value is None:
        return ToldFigure(name, "–", f"{most:g}{unit} or less", is_normal=False)
    return ToldFigure(name, f"{value:{form}}{unit}", f"{most:g}{unit} or less", value <= most)
