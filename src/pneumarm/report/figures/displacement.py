"""Actions and switches against the angular displacement (thesis section 5.5.2, figures 5.15 and 5.16)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import INK, MIDDLE
from pneumarm.report.style import Described, key, nothing, of_joint, panels, scatter, styled, whole_ticks
from pneumarm.statistics import running_median

Array = NDArray[Any]


@styled
def against_displacement(distance: Array, actions: Array, switches: Array, spec: ArmSpec) -> Described:
    """Draw actions and switches of episodes against the distance that they had to move, with a running median.

    Args:
        distance: |goal - angle at the begin| of each successful episode, shape (n, joints) [counts].
        actions: its number of actions, shape (n,).
        switches: its number of switches, shape (n,).
        spec: the arm, for units.

    """
    joints = distance.shape[1]
    figure, axes = panels(joints, 2, 3.0 * joints)
    # Whole numbers would lie on each other; a fixed pattern of shifts keeps the picture the same every time.
    jitter = 0.7 * (np.arange(len(actions)) * 0.618034 % 1 - 0.5)
    for joint in range(joints):
        x = distance[:, joint] / spec.counts_per_degree
        for place, y, label in zip(axes[joint], (actions, switches), ("actions [-]", "switches [-]"), strict=True):
            place.set_xlabel(f"angular displacement{of_joint(joint, joints)} [°]")
            place.set_ylabel(label)
            if len(x) == 0:
                nothing(place, "no successful episodes")
                continue
            scatter(place, x, y + jitter, s=7, alpha=0.35)
            place.plot(*running_median(x, y), color=MIDDLE, marker="s", mec=INK, mew=0.5)
            place.set_xlim(0)
            place.set_ylim(min(0, float((y + jitter).min())))
            whole_ticks(place, "y")
            place.legend([key(MIDDLE, marker="s", mec=INK, mew=0.5)], ["running median"], loc="upper left")
    figure.alt = "There are no successful episodes."
    if len(actions):
        far = distance.max(axis=1) / spec.counts_per_degree
        third, two_thirds = np.percentile(far, (100 / 3, 200 / 3))
        thirds = "; ".join(
            f"the {name} third (median {np.median(far[members]):.0f}°) takes a median of "
            f"{np.median(actions[members]):g} actions and {np.median(switches[members]):g} switches"
            for name, members in (("shortest", far <= third), ("longest", far >= two_thirds))
        )
        figure.alt = f"{len(actions):,} successful episodes by displacement: {thirds}."
    return figure
