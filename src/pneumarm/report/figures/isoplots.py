"""Predicted against observed change (thesis section 3.3, figures 3.3 to 3.5)."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.report.colours import INK, MIDDLE
from pneumarm.report.style import (
    DENSITY,
    counts_bar,
    counts_norm,
    key,
    nothing,
    of_joint,
    panels,
    quantities,
    scatter,
    styled,
)
from pneumarm.statistics import slope

Array = NDArray[np.float64]

_BINS = 70
_TICKS = 6  # at most, between 0 and the ends: more would overlap where numbers have many digits


@styled
def isoplot(observed: Array, simulated: Array, spec: ArmSpec, *, density: bool = False) -> Figure:
    """Draw the simulated change of every quantity against the observed one, with the ideal 45 degree line.

    Args:
        observed: o_{k+1} - o_k (eq. 3.4), shape (n, joints, 4) [sensor units].
        simulated: sim_{k+1} - o_k (eq. 3.3), the same shape.
        spec: the arm, for units.
        density: colour by the number of transitions instead of drawing points (figure 3.5).

    """
    joints = observed.shape[1]
    figure, axes = panels(joints * 2, 2, 6.0 * joints)
    for joint in range(joints):
        places = axes[2 * joint : 2 * joint + 2].flat
        for i, (place, kind) in enumerate(zip(places, quantities(spec), strict=True)):
            x, y = (kind.per_count * change[:, joint, i] for change in (observed, simulated))
            place.set_xlabel(f"observed change of {kind.in_units()}")
            place.set_ylabel(f"simulated change [{kind.unit}]")
            if len(x) == 0:
                nothing(place, "no transitions")
                continue
            limit = float(np.percentile(np.abs(np.concatenate([x, y])), 99.7)) or 1.0
            if density:
                count, xs, ys = np.histogram2d(x, y, _BINS, range=[(-limit, limit)] * 2)
                image = place.pcolormesh(
                    xs, ys, np.ma.masked_equal(count.T, 0), cmap=DENSITY, norm=counts_norm(count), rasterized=True
                )
                counts_bar(figure, image, place, "transitions", aspect=25)
            else:
                scatter(place, x, y, s=3, alpha=0.25)
            inclined = slope(x, y)
            middle = float(y.mean() - inclined * x.mean())
            ends = np.array([-limit, limit])
            place.plot(ends, ends, color=INK, ls="--", lw=1)
            keys, labels = [key(INK, "--", lw=1)], ["ideal, 45°"]
            if np.isfinite(inclined):
                keys.append(key(MIDDLE, lw=1.2))
                labels.append(f"slope {inclined:.3f}")
                place.plot(ends, middle + inclined * ends, color=MIDDLE, lw=1.2)
            place.set(xlim=ends, ylim=ends)
            place.locator_params(nbins=_TICKS)
            place.set_title(kind.name + of_joint(joint, joints))
            place.legend(keys, labels, loc="upper left")
    return figure


def isoplot_alt(observed: Array, simulated: Array, spec: ArmSpec) -> str:
    """Say in words what :func:`isoplot` shows."""
    if len(observed) < 2:
        return f"There are too few transitions to compare: {len(observed)}."
    parts = []
    for joint in range(observed.shape[1]):
        for i, kind in enumerate(quantities(spec)):
            x, y = (kind.per_count * change[:, joint, i] for change in (observed, simulated))
            parts.append(
                f"{kind.name}{of_joint(joint, observed.shape[1])}: slope {slope(x, y):.3f}, standard deviation about "
                f"the 45 degree line {(y - x).std():.2g} {kind.unit}"
            )
    return f"Simulated against observed change of {len(observed):,} transitions. " + "; ".join(parts) + "."
