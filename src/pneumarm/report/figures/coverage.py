"""What the collected data covers: projections of the transitions, cells of the grid (thesis section 3.2.3)."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import DARK, INK, MIDDLE
from pneumarm.report.style import (
    DENSITY,
    Described,
    counts_bar,
    counts_norm,
    nothing,
    of_joint,
    panels,
    quantities,
    styled,
    whole_ticks,
)

Array = NDArray[np.float64]

PROJECTIONS = ((0, 1), (0, 2), (2, 3))
"""Pairs of quantities that are looked at: angle and velocity, angle and pressure 1, both pressures."""
_BINS = 56
_BANDS = 7  # cells holding 1, 2-3, 4-7, ... transitions are too many bars beyond some powers of two


@styled
def projections(observation: Array, spec: ArmSpec) -> Described:
    """Draw how many observations lie where, for pairs of quantities.

    Args:
        observation: angle, velocity, pressure 1, pressure 2, shape (n, joints, 4) [sensor units].
        spec: the arm, for units.

    """
    joints = observation.shape[1]
    figure, axes = panels(joints, len(PROJECTIONS), 2.7 * joints)
    kinds = quantities(spec)
    scale = np.array([k.per_count for k in kinds])
    words = []
    for joint in range(joints):
        seen = observation[:, joint] * scale
        seen[:, 0] = spec.degrees(observation[:, joint, 0])
        if len(seen):
            within = zip(kinds, *np.percentile(seen, (1, 99), axis=0), strict=True)
            ranges = ", ".join(f"{kind.name} {low:.3g} to {high:.3g} {kind.unit}" for kind, low, high in within)
            words.append(f"98% of the observations{of_joint(joint, joints)} lie within {ranges}.")
        for place, (i, j) in zip(axes[joint], PROJECTIONS, strict=True):
            place.set_xlabel(kinds[i].in_units() + of_joint(joint, joints))
            place.set_ylabel(kinds[j].in_units() + of_joint(joint, joints))
            if len(seen) == 0:
                nothing(place, "no observations")
                continue
            # A few outliers would squeeze everything else into a corner.
            ends = np.percentile(seen[:, (i, j)], (0.05, 99.95), axis=0).T
            ends[:, 1] = np.where(ends[:, 1] > ends[:, 0], ends[:, 1], ends[:, 0] + 1)
            count, xs, ys = np.histogram2d(seen[:, i], seen[:, j], _BINS, range=ends)
            image = place.pcolormesh(
                xs, ys, np.ma.masked_equal(count.T, 0), cmap=DENSITY, norm=counts_norm(count), rasterized=True
            )
            counts_bar(figure, image, place, "observations", location="top", aspect=30)
    maps = (
        f"Maps of {len(observation):,} observations over angle and velocity, angle and pressure 1, and the pressures."
    )
    figure.alt = " ".join([maps, *words]) if words else "No observations were recorded."
    return figure


@styled
def cells(cells_holding: NDArray[np.int64], per_cell: int, growth: NDArray[np.int64]) -> Described:
    """Draw how many transitions the cells of the filter's grid hold, and how the cells filled while collecting.

    Args:
        cells_holding: number of occupied cells that hold exactly i transitions, shape (most + 1,); [0] is not used.
        per_cell: most transitions of a cell that the filter keeps.
        growth: transitions collected and cells occupied by then, shape (m, 2); m may be 0.

    """
    grown = len(growth) > 0
    figure, axes = panels(1, 2 if grown else 1, 2.6)
    place = axes[0, 0]
    place.set_xlabel("transitions in a cell [-]")
    place.set_ylabel("cells [-]")
    edges, held = _doubling(cells_holding)
    if held.sum() == 0:
        nothing(place, "no cell is occupied")
    else:
        ticks = [f"{a}" if b - a == 1 else f"{a}–{b - 1}" for a, b in pairwise(edges)]
        ticks[-1] = ticks[-1] if held.size < _BANDS else f"≥{edges[-2]}"
        place.bar(range(len(held)), held, color=DARK, width=0.75)
        place.set_xticks(range(len(held)), ticks)
        place.grid(visible=False, axis="x")
        place.set_title(f"filter keeps at most {per_cell} a cell")
    if grown:
        place = axes[0, 1]
        place.plot(growth[:, 0] / 1e3, growth[:, 1], color=DARK, marker="o")
        place.plot(growth[-1:, 0] / 2e3, np.interp(growth[-1:, 0] / 2, *growth.T), "D", color=MIDDLE, mec=INK)
        place.annotate("half of the data", (growth[-1, 0] / 2e3, np.interp(growth[-1, 0] / 2, *growth.T)),
                       xytext=(8, -14), textcoords="offset points")  # fmt: skip
        place.set_xlabel("transitions collected [thousands]")
        place.set_ylabel("cells occupied [-]")
        place.set_xlim(0)
        place.set_ylim(0)
        whole_ticks(place, "y")
    occupied, full = int(cells_holding[1:].sum()), int(cells_holding[per_cell:].sum())
    figure.alt = f"{occupied:,} cells of the grid are occupied" + (
        f", {full:,} of them ({full / occupied:.0%}) by at least {per_cell} transitions." if occupied else "."
    )
    if occupied and grown:
        figure.alt += f" {new_share(growth):.1%} of them were first reached in the second half of the data."
    return figure


def new_share(growth: NDArray[np.int64]) -> float:
    """Return which share of the occupied cells the second half of the transitions added (thesis section 3.2.3)."""
    total, last = float(growth[-1, 1]), float(growth[-1, 0])
    return 1 - float(np.interp(last / 2, growth[:, 0], growth[:, 1])) / total if total else math.nan


def _doubling(cells_holding: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return edges 1, 2, 4, ... and the number of cells between them, the last class open."""
    most = len(cells_holding) - 1
    classes = min(_BANDS, max(1, math.floor(math.log2(max(most, 1))) + 1))
    edges = 2 ** np.arange(classes + 1)
    held = [int(cells_holding[a:b].sum()) for a, b in pairwise(edges)]
    held[-1] += int(cells_holding[edges[-1] :].sum())
    return edges, np.array(held)
