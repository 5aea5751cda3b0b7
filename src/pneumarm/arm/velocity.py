"""The velocity of a joint, derived from two angles and the time between them (thesis section 2.3.4).

Plain Python, for numbers and arrays alike; loops compile it from here by :func:`pneumarm.kernels.part`.
"""

from typing import Any


def derived_velocity(angle: Any, before: Any, elapsed: Any) -> Any:
    """Return the velocity at ``angle``, ``elapsed`` [s] after the angle was ``before`` [counts], in counts/ms."""
    return (angle - before) / (1e3 * elapsed)
