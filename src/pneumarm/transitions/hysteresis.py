"""Hysteresis of a joint as stop operators: where it is now within the band that it drags along.

A stop operator of radius r follows the angle like a spring behind a slider:

    s_k = min(max(s_{k-1} + theta_k - theta_{k-1}, -r), r)

Friction in the weave of a muscle, and in a joint, is a force that depends on s rather than on the angle or its speed:
near rest a joint is stiff, and after a way of r it slides. A sum of such forces of several radii is the Maxwell-slip
model, with which the hysteresis of pneumatic muscles is usually described (T. Vo-Minh, T. Tjahjowidodo, H. Ramon,
H. Van Brussel, IEEE/ASME Transactions on Mechatronics 16(1), 2011; as operators: A. Visintin, Differential Models of
Hysteresis, 1994). A window of a tenth of a second holds nothing of it, since a joint that hardly moves has come to
where it is seconds ago.
"""

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel

RADII = (1.0, 5.0)
"""Radii [degrees] by default (docs/decisions/simulation.md)."""


@kernel
def _follow(angle, first, radii, stops):  # type: ignore[no-untyped-def]
    """Set ``stops`` (n, joints, radii), ``first`` (n,) being where the run of joined rows began."""
    for k in range(angle.shape[0]):
        for joint in range(angle.shape[1]):
            for i in range(radii.shape[0]):
                if first[k] == k:
                    stops[k, joint, i] = 0.0
                else:
                    followed = stops[k - 1, joint, i] + angle[k, joint] - angle[k - 1, joint]
                    stops[k, joint, i] = min(max(followed, -radii[i]), radii[i])


def stops_of(angle: NDArray[np.float64], first: NDArray[np.int64], radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the stop operators are at each of the angles (n, joints), shape (n, joints times radii) [counts].

    ``first`` (n,) tells in which row the run of joined rows began; there all are 0.
    """
    stops = np.zeros((*angle.shape, len(radii)))
    _follow(np.ascontiguousarray(angle), first, radii, stops)
    return stops.reshape(len(angle), -1)
