"""Where the hand of an arm is: the planar chain of its links.

Each joint turns all links from its own on, and at 0 degrees all hang straight down in a line. With phi_i the sum of
the angles of joints 1 to i and l_i the length of link i,

    x = sum_i l_i sin(phi_i)        y = -sum_i l_i cos(phi_i)

from the hinge of the first joint: x to where higher angles turn the arm, y up.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def link_ends(degrees: ArrayLike, links: Sequence[float]) -> Array:
    """Return where the links of an arm at ``degrees`` (..., joints) end, the first hinge before them.

    Shape (..., joints + 1, 2), in the unit of the lengths ``links``; the last is the hand.
    """
    turned = np.radians(np.cumsum(np.asarray(degrees, np.float64), axis=-1))
    steps = np.stack([np.sin(turned), -np.cos(turned)], axis=-1) * np.asarray(links)[:, None]
    return np.concatenate([np.zeros_like(steps[..., :1, :]), np.cumsum(steps, axis=-2)], axis=-2)


def hand(degrees: ArrayLike, links: Sequence[float]) -> Array:
    """Return where the hand of an arm at ``degrees`` (..., joints) is, shape (..., 2), in the unit of ``links``."""
    return np.asarray(link_ends(degrees, links)[..., -1, :])


def turning(degrees: ArrayLike, links: Sequence[float]) -> Array:
    """Return how the hand moves with the joints of an arm at ``degrees`` (..., joints), shape (..., 2, joints).

    In the unit of ``links`` per degree.
    """
    ends = link_ends(degrees, links)
    arms = ends[..., -1:, :] - ends[..., :-1, :]  # from each hinge to the hand
    return np.radians(np.stack([-arms[..., 1], arms[..., 0]], axis=-2))


def both_elbows(xy: ArrayLike, links: Sequence[float]) -> Array:
    """Return the angles of two joints that bring the hand to ``xy`` (2,), one pair an elbow, shape (2, 2) [degrees].

    Each is within a half turn of 0; shape (0, 2) where the hand does not reach so far out or so near to its hinge.
    """
    x, y = np.asarray(xy, np.float64)
    first, second = links
    cosine = (x * x + y * y - first**2 - second**2) / (2 * first * second)
    if abs(cosine) > 1:
        return np.empty((0, 2))
    bent = np.arccos(cosine) * np.array([1.0, -1.0])
    upper = np.arctan2(x, -y) - np.arctan2(second * np.sin(bent), first + second * np.cos(bent))
    degrees = np.degrees(np.stack([upper, bent], axis=1))
    return (degrees + 180.0) % 360.0 - 180.0
