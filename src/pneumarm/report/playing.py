"""The picture that a page opens with: the arm as it moved."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.report.moving_arm import moving_arm, moving_arm_alt
from pneumarm.report.page import Picture

Array = NDArray[np.float64]


def playing(
    time: Array, angle: Array, wanted: Array | None, spec: ArmSpec, caption: str, *, dashed: str = "asked for"
) -> Picture:
    """Return a picture that plays a record by itself, on wide and on narrow screens.

    Args:
        time: of the readings, shape (n,) [s].
        angle: shape (n, joints) [counts].
        wanted: what the arm is compared with, shape (n, joints) [counts]; None where it is nothing.
        spec: the arm.
        caption: what it is.
        dashed: what ``wanted`` is.

    """
    wide, narrow = (moving_arm(time, angle, wanted, spec, dashed=dashed, narrow=narrow) for narrow in (False, True))
    return Picture(wide, caption, moving_arm_alt(time, angle, wanted, spec, dashed=dashed), narrow)
