"""What lets air into muscles of strangers and out: three laws of flow, a tank that sags, leaks, a hose.

Pressures are absolute here [bar], and air is counted as pressure times volume [bar l]. A muscle of volume V has

    dp/dt = n (flow - p dV/dt) / V,

n the exponent of a change of state between isothermal (1) and adiabatic (1.4); E. Richer and Y. Hurmuzlu, 2000.
What flows through a valve that is open is one of

- nozzle: the flow through a nozzle of A. J. C. Barre de Saint-Venant and L. Wantzel (1839), choked below 0.528.
- capillary: laminar flow through a long thin tube, by the difference of squares (Hagen and Poiseuille; compressible).
- lag: by the difference, as of a first-order lag whose time constant grows while filling and while emptying, each
  differently; G. A. Medrano-Cerda, C. J. Bowler and D. G. Caldwell, 1995.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOZZLE, CAPILLARY, LAG = range(3)
KINDS = "nozzle", "capillary", "lag"
ATMOSPHERE = 1.013  # bar


class Air(NamedTuple):
    """Valves, hoses, leaks and supply of an arm, as they enter the compiled loop."""

    kind: int
    full: float
    """Pressure of the supply at rest [bar]."""
    recovery: float
    """Time constant in which its regulator fills the tank again [s]."""
    tank: float
    """Volume behind the regulator [l]."""
    exponent: float
    slower: Array
    """By how much the time constants of a lag grow until full, and until empty, shape (2,)."""
    conductance: Array
    """Of inlets and outlets, shape (joints, 2, 2); in l/s by bar of what the law of flow says."""
    leak: Array
    """By bar gauge, shape (joints, 2) [l/s]."""
    hose: Array
    """Conductance between line and muscle, shape (joints, 2) [l/s]; 0 where the valve is at the muscle."""
    line: Array
    """Volume of the line between valve and hose, where the pressure is measured, shape (joints, 2) [l]."""
