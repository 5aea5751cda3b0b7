"""When an arm has settled at its goal, told by readings that scatter.

An arm has *settled* from the moment on from which all of its joints stay within the tolerance until the end of the
hold, for a dwell time at least: one that happens to pass its goal at the end has not. Where readings hardly scatter,
each of them says whether its joint is there. Where they scatter by as much as the tolerance, an arm that stands still
at its goal would leave it several times a second; then what counts is the mean of a joint and how far it swings, over
each stretch of the dwell time, without what the scatter alone explains.
"""

import math

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1.0
"""Within so much [degrees] a joint is at its goal, unless it is said otherwise."""
DWELL = 0.3
"""For how long [s] it stays there at least to have settled."""
_DIFFERENCES = 4  # of readings, to which motion of up to a few Hz adds little: 1, -4, 6, -4, 1 ...
_SHARE = math.comb(2 * _DIFFERENCES, _DIFFERENCES)  # ... and independent noise so many times its variance
_SCATTERED = 0.25  # of the tolerance; with more scatter, single readings are off by all of it now and then
_FARTHEST = 3.0  # standard deviations by which a single reading may be farther off than the tolerance
_DOUBT = 1.0  # standard errors by which means and swings of scattered readings may be too large


def settled_at(
    times: NDArray[np.float64], off: NDArray[np.float64], tolerance: float = TOLERANCE, dwell: float = DWELL
) -> float | None:
    """Return the first of the ``times`` from which on all joints stay within the ``tolerance``.

    Args:
        times: of the readings, shape (n,) [s].
        off: by how much each joint is off its goal, shape (n, joints) [degrees].
        tolerance: [degrees].
        dwell: for how long they have to stay at least, to the last of the times [s]; otherwise None is returned.

    """
    outside = np.zeros(len(times), bool)
    for joint in off.T:
        noise = reading_noise(joint[times > times[-1] - 1])
        if not noise < math.inf:
            return None  # numbers too large to say anything of
        if noise <= _SCATTERED * tolerance:
            outside |= np.abs(joint) > tolerance
        else:
            outside |= np.abs(joint) > tolerance + _FARTHEST * noise
            outside |= _swing(times, joint, noise, dwell) > tolerance
    left = np.flatnonzero(outside)
    first = int(left[-1]) + 1 if len(left) else 0
    return float(times[first]) if first < len(times) and times[-1] - times[first] >= dwell else None


def reading_noise(readings: NDArray[np.float64]) -> float:
    """Return the standard deviation of the noise of ``readings`` (n,) that were made one period after the other."""
    if len(readings) <= _DIFFERENCES:
        return 0.0
    with np.errstate(over="ignore"):
        return float(np.sqrt((np.diff(readings, _DIFFERENCES) ** 2).mean() / _SHARE))


def _swing(times: NDArray[np.float64], off: NDArray[np.float64], noise: float, dwell: float) -> NDArray[np.float64]:
    """Return how far a joint surely is off at most in the ``dwell`` time from each of the ``times`` on, shape (n,).

    What is left of its variance without that of the ``noise`` is taken for a sinusoid's about the mean. It is 0 where
    there are no readings for so long.
    """
    ends = np.searchsorted(times, times + dwell, side="right")
    count = ends - np.arange(len(times))
    sums, squares = (np.concatenate([[0.0], np.cumsum(values)]) for values in (off, off**2))
    mean, square = ((total[ends] - total[:-1]) / count for total in (sums, squares))
    explained = noise**2 * (1 + _DOUBT * np.sqrt(2 / count))
    swing = np.sqrt(2 * np.maximum(square - mean**2 - explained, 0.0))
    farthest = np.maximum(np.abs(mean) - _DOUBT * noise / np.sqrt(count), 0.0) + swing
    return np.where(times + dwell <= times[-1], farthest, 0.0)
