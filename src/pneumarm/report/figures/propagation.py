"""How the simulation's error grows over many steps (thesis section 3.3, eq. 3.7)."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import DARK, MIDDLE
from pneumarm.report.style import Described, legend_below, nothing, of_joint, panels, quantities, styled

Array = NDArray[np.float64]


@styled
def error_propagation(measured: Array, spec: ArmSpec) -> Described:
    """Draw the standard deviation of the error after 1, 2, ... simulated steps beside what eq. 3.7 expects.

    Args:
        measured: standard deviation after k+1 steps of free simulation, shape (steps, joints, 4) [sensor units].
        spec: the arm, for units and the period.

    """
    steps, joints = measured.shape[:2]
    figure, axes = panels(joints * 2, 2, 4.9 * joints, sharex=True)
    k = np.arange(1, steps + 1)
    handles, words = [], []
    for joint in range(joints):
        places = axes[2 * joint : 2 * joint + 2].flat
        for i, (place, kind) in enumerate(zip(places, quantities(spec), strict=True)):
            place.set_title(kind.name + of_joint(joint, joints))
            place.set_ylabel(f"std of error [{kind.unit}]")
            if steps == 0:
                nothing(place, "not measured")
                continue
            std, chance = (kind.per_count * one[:, joint, i] for one in (measured, expectation(measured)))
            handles = [*place.plot(k, std, "o-", color=DARK, ms=3), *place.plot(k, chance, "--", color=MIDDLE)]
            words.append(
                f"{kind.name}{of_joint(joint, joints)} {std[-1]:.3g} {kind.unit} "
                f"({chance[-1]:.3g} {kind.unit} expected)"
            )
            place.set_ylim(0)
            place.set_xlim(0, steps + 0.5)
    for place in axes[-1]:
        place.set_xlabel(f"steps simulated freely [-], {1e3 * spec.period:.3g} ms each")
    if handles:
        legend_below(figure, handles, ["measured on sequences not fitted", "expected by √k (eq. 3.7)"])
    after = f"Standard deviation of the error after {steps} steps ({steps * spec.period:.2g} s)"
    figure.alt = f"{after}: {'; '.join(words)}." if words else "The propagation of the error was not measured."
    return figure


def expectation(measured: Array) -> Array:
    """Return std_sim(k) = sqrt(k std_sim(1)^2) (eq. 3.7), shape as ``measured`` (steps, joints, 4)."""
    steps = np.arange(1, len(measured) + 1).reshape(-1, 1, 1)
    expected: Array = np.sqrt(steps * measured[:1] ** 2)
    return expected
