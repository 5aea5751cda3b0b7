"""Predicted against observed change (thesis section 3.3, figures 3.3 to 3.5)."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import INK, MIDDLE
from pneumarm.report.style import (
    DENSITY,
    Described,
    counts_bar,
    counts_norm,
    key,
    nothing,
    of_joint,
    panels,
    quantities,
    styled,
)
from pneumarm.statistics import slope

Array = NDArray[np.float64]

_BINS = 70
_TICKS = 6  # at most, between 0 and the ends: more would overlap where numbers have many digits


@styled
def isoplot(observed: Array, simulated: Array, spec: ArmSpec) -> Described:
    """Draw how often which change of a quantity was simulated for which observed one, with the ideal 45 degree line.

    Args:
        observed: o_{k+1} - o_k (eq. 3.4), shape (n, joints, 4) [sensor units].
        simulated: sim_{k+1} - o_k (eq. 3.3), the same shape.
        spec: the arm, for units.

    """
    joints = observed.shape[1]
    figure, axes = panels(joints * 2, 2, 6.0 * joints)
    words = []
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
            count, xs, ys = np.histogram2d(x, y, _BINS, range=[(-limit, limit)] * 2)
            image = place.pcolormesh(
                xs, ys, np.ma.masked_equal(count.T, 0), cmap=DENSITY, norm=counts_norm(count), rasterized=True
            )
            counts_bar(figure, image, place, "transitions", aspect=25)
            inclined = slope(x, y)
            words.append(
                f"{kind.name}{of_joint(joint, joints)}: slope {inclined:.3f}, standard deviation about the 45 degree "
                f"line {(y - x).std():.2g} {kind.unit}"
            )
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
    figure.alt = f"There are too few transitions to compare: {len(observed)}."
    if len(observed) >= 2:
        figure.alt = f"Simulated against observed change of {len(observed):,} transitions. {'; '.join(words)}."
    return figure
