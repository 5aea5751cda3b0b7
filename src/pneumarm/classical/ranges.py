"""Between which values gains are searched, and where the search begins: at the defaults of the gains."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.classical.cascade import CascadeGains, ScheduledGains
from pneumarm.classical.following import CommonGains
from pneumarm.classical.pulse_width import PulseWidthGains
from pneumarm.classical.sliding import SlidingGains


@dataclass(frozen=True)
class Range:
    """The gains that are searched: each from 0 to 1 between its least and its greatest, in equal ratios."""

    default: CommonGains
    limits: dict[str, tuple[float, float]]

    @property
    def begin(self) -> NDArray[np.float64]:
        """Where the defaults lie, shape (n,)."""
        return np.array(
            [math.log(getattr(self.default, name) / a) / math.log(b / a) for name, (a, b) in self.limits.items()]
        )

    def gains(self, gains: CommonGains, point: NDArray[np.float64]) -> CommonGains:
        """Return ``gains`` with those that are searched as they are at ``point`` (n,)."""
        found: dict[str, Any] = {
            name: a * (b / a) ** float(x) for (name, (a, b)), x in zip(self.limits.items(), point, strict=True)
        }
        return replace(gains, **found)


_COMMON = {
    "move_time": (0.1, 0.8),
    "move_speed": (50.0, 1000.0),
    "smoothing": (0.002, 0.1),
    "rest": (0.05, 0.8),
    "lead": (0.005, 0.2),
    "total": (0.4, 1.8),
    "trust": (0.03, 1.0),
    "integral": (0.3, 20.0),
    "memory": (0.05, 1.2),
}
_CASCADE = {
    **_COMMON,
    "proportional": (0.05, 3.0),
    "derivative": (0.002, 0.3),
    "velocity": (0.005, 0.3),
    "acceleration": (0.0003, 0.03),
    "pressure_gain": (0.2, 4.0),
    "dead_band": (0.002, 0.08),
}
RANGES = {
    "pid": Range(CascadeGains(), _CASCADE),
    "scheduled": Range(
        ScheduledGains(),
        {
            **_CASCADE,
            "proportional_outside": (0.2, 5.0),
            "velocity_outside": (0.2, 5.0),
            "derivative_outside": (0.2, 5.0),
            "total_outside": (0.5, 1.6),
        },
    ),
    "pwm": Range(
        PulseWidthGains(),
        {
            **_COMMON,
            "proportional": (0.005, 1.0),
            "derivative": (0.0005, 0.06),
            "velocity": (0.001, 0.1),
            "balance": (0.005, 1.0),
            "stiffening": (0.3, 20.0),
        },
    ),
    "sliding": Range(
        SlidingGains(),
        {
            **_COMMON,
            "slope": (3.0, 100.0),
            "balance": (0.1, 3.0),
            "layer": (0.1, 5.0),
            "stiffening": (0.3, 60.0),
            "switching": (0.01, 3.0),
        },
    ),
}
"""By kind."""
