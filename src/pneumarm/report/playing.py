"""The picture that a page opens with: the arm as it moved."""

import numpy as np

from pneumarm.drawing.moving_arm import Shown, moving_arm
from pneumarm.report.page import Picture


def playing(shown: Shown, caption: str, *, dashed: str = "asked for") -> Picture:
    """Return a picture that plays a record by itself, on wide and on narrow screens.

    Args:
        shown: what was recorded.
        caption: what it is.
        dashed: what ``shown.wanted`` is.

    """
    wide, narrow = (moving_arm(shown, dashed=dashed, narrow=narrow) for narrow in (False, True))
    degrees = shown.spec.degrees(shown.angle)
    low, high = (f"{end:z.0f}".replace("-", "−") for end in (degrees.min(), degrees.max()))
    words = f"{shown.time[-1] - shown.time[0]:.0f} seconds of movement between {low} and {high} degrees"
    if shown.wanted is not None:
        near = (np.abs(degrees - shown.spec.degrees(shown.wanted)) <= 1).all(axis=1).mean()
        words += f"; the arm is within 1 degree of what is {dashed} in {near:.0%} of the time"
    return Picture(wide, caption, f"{words}.", narrow)
