"""What is added to a moving reference, learned from the errors made in following it: adaptive feed-forward.

The correction of a reference r is linear in what r does at that time,

    w(t) = c . phi(t),   phi = (1, r - m, r'),   c_i <- c_i + mu e phi_i / max over the last while of phi_i^2

with e = r - theta the error now and m the middle of the goals (least mean squares with a step for each feature;
B. Widrow and S. D. Stearns, Adaptive Signal Processing, 1985). Since w is a function of r it is known as far ahead as
r is: what the joint lags behind, falls short or goes beyond is put right in time, in amplitude and in phase, whether
it is friction, hysteresis or a bias of the simulation. For a constant r it is integral action.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEATURES = 3
_SLOW = np.array([0.0, 1.0, 0.05])  # features below so many allowed errors, in a step, say nothing
_FORGOTTEN = 0.8  # share of the weights that is left after an error that teaches nothing
_STEP = 0.06  # mu: a third of a second to learn, and slower than the joint answers
_KEPT = 0.99  # of the largest square of a feature, from step to step


class Correction:
    """Corrections of the references of ``joints``, none larger than twice the error ``taught_by`` [counts].

    Larger errors teach nothing: then the joint is on its way, and what keeps it is not what is learned here. What had
    been learned is then forgotten, because it may be what is wrong.
    """

    def __init__(self, joints: int, taught_by: float) -> None:
        self._weights = np.zeros((joints, FEATURES))
        self._taught_by = taught_by
        self._least = (taught_by * _SLOW) ** 2
        self._largest = np.zeros((joints, FEATURES))

    def learn(self, error: Array, features: Array) -> None:
        """Learn from the ``error`` (joints,) [counts] and the ``features`` (joints, 3) of the same time."""
        self._largest = np.maximum(_KEPT * self._largest, features**2)
        taught = np.abs(error) <= self._taught_by
        change = _STEP * error[:, None] * features / np.maximum(self._largest, self._least)
        self._weights = np.where(taught[:, None], self._weights + change, _FORGOTTEN * self._weights)

    def forget(self) -> None:
        """Forget what was learned."""
        self._weights[:] = 0.0

    def of(self, features: Array) -> Array:
        """Return the corrections (n, joints) [counts] at times with the ``features`` (n, joints, 3)."""
        return np.clip((self._weights * features).sum(axis=-1), -2 * self._taught_by, 2 * self._taught_by)


def features_of(path: Array, middle: Array) -> Array:
    """Return the features (n, joints, 3) of a reference with a ``path`` (n + 2, joints) from a step earlier."""
    slope = (path[2:] - path[:-2]) / 2
    return np.stack([np.ones_like(slope), path[1:-1] - middle, slope], axis=-1)
