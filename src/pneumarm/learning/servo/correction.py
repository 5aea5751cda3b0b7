"""What is added to a moving reference, learned from the errors made in following it: adaptive feed-forward.

The correction of a reference r is linear in what r does at that time,

    w(t) = c . phi(t),   phi = (1, r - m, r'),   c_i <- c_i + mu e phi_i / max over the last while of phi_i^2

with e = r - theta the error now and m the middle of the goals (least mean squares with a step for each feature;
B. Widrow and S. D. Stearns, Adaptive Signal Processing, 1985). Since w is a function of r it is known as far ahead as
r is: what the joint lags behind, falls short or goes beyond is put right in time, in amplitude and in phase, whether
it is friction, hysteresis or a bias of the simulation. For a constant r it is integral action.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel

Array = NDArray[np.float64]

FEATURES = 3
_SLOW = np.array([0.0, 1.0, 0.05])  # features below so many allowed errors, in a step, say nothing
_FORGOTTEN = 0.8  # share of the weights that is left after an error that teaches nothing
_STEP = 0.06  # mu: a third of a second to learn, and slower than the joint answers
_KEPT = 0.99  # of the largest square of a feature, from step to step


class CorrectionParameters(NamedTuple):
    """How corrections are learned. Made by :func:`correction_parameters`."""

    taught_by: float
    """Largest error that teaches [counts]."""
    least: Array
    """Smallest square of each feature that counts, shape (3,)."""
    step: float
    kept: float
    forgotten: float


def correction_parameters(taught_by: float) -> CorrectionParameters:
    """Return how corrections are learned from errors of at most ``taught_by`` [counts]."""
    return CorrectionParameters(taught_by, (taught_by * _SLOW) ** 2, _STEP, _KEPT, _FORGOTTEN)


@kernel
def learn_correction(parameters, weights, largest, error, features):  # type: ignore[no-untyped-def]
    """Learn ``weights`` from the ``error`` (joints,) and ``features`` of the same time; all else is (joints, 3)."""
    for j in range(error.shape[0]):
        for i in range(FEATURES):
            feature = features[j, i]
            largest[j, i] = max(parameters.kept * largest[j, i], feature * feature)
            if abs(error[j]) <= parameters.taught_by:
                weights[j, i] += parameters.step * error[j] * feature / max(largest[j, i], parameters.least[i])
            else:
                weights[j, i] = parameters.forgotten * weights[j, i]


@inner
def correction_of(parameters, weights, features, j):  # type: ignore[no-untyped-def]
    """Return the correction of joint ``j`` [counts] at a time with these ``features`` (joints, 3)."""
    total = 0.0
    for i in range(FEATURES):
        total += weights[j, i] * features[j, i]
    most = 2.0 * parameters.taught_by
    return min(max(total, -most), most)


@inner
def write_features(path, step, middle, features):  # type: ignore[no-untyped-def]
    """Set the ``features`` (joints, 3) at a ``step`` of a ``path`` (n, joints) that begins a step earlier."""
    for j in range(features.shape[0]):
        features[j, 0] = 1.0
        features[j, 1] = path[step + 1, j] - middle[j]
        features[j, 2] = (path[step + 2, j] - path[step, j]) / 2.0


@kernel
def _write_all_features(path, middle, features):  # type: ignore[no-untyped-def]
    for step in range(features.shape[0]):
        write_features(path, step, middle, features[step])


@kernel
def _correct(parameters, weights, features, corrections):  # type: ignore[no-untyped-def]
    for step in range(features.shape[0]):
        for j in range(features.shape[1]):
            corrections[step, j] = correction_of(parameters, weights, features[step], j)


class Correction:
    """Corrections of the references of ``joints``, none larger than twice the error ``taught_by`` [counts].

    Larger errors teach nothing: then the joint is on its way, and what keeps it is not what is learned here. What had
    been learned is then forgotten, because it may be what is wrong.
    """

    def __init__(self, joints: int, taught_by: float) -> None:
        self._weights = np.zeros((joints, FEATURES))
        self._largest = np.zeros((joints, FEATURES))
        self._parameters = correction_parameters(taught_by)

    def learn(self, error: Array, features: Array) -> None:
        """Learn from the ``error`` (joints,) [counts] and the ``features`` (joints, 3) of the same time."""
        learn_correction(self._parameters, self._weights, self._largest, error, features)

    def forget(self) -> None:
        """Forget what was learned."""
        self._weights[:] = 0.0

    def of(self, features: Array) -> Array:
        """Return the corrections (n, joints) [counts] at times with the ``features`` (n, joints, 3)."""
        corrections = np.empty(features.shape[:2])
        _correct(self._parameters, self._weights, features, corrections)
        return corrections


def features_of(path: Array, middle: Array) -> Array:
    """Return the features (n, joints, 3) of a reference with a ``path`` (n + 2, joints) from a step earlier."""
    features = np.empty((len(path) - 2, path.shape[1], FEATURES))
    _write_all_features(path, middle, features)
    return features
