"""The simulation's one-step error: along time and against classes (thesis section 3.3, figures 3.1 and 3.2)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import ACTIONS, VALVES
from pneumarm.drawing.colours import DARK, INK, MIDDLE
from pneumarm.report.style import Described, legend_below, nothing, of_joint, panels, scatter, styled
from pneumarm.statistics import Bins, binned, by_group

Array = NDArray[np.float64]

IN_A_ROW = 200
"""Transitions that are drawn one after the other (thesis figure 3.1: a sequence)."""


@styled
def residues(observed: Array, simulated: Array, spec: ArmSpec) -> Described:
    """Draw the observed angle, the simulated one, and their difference, transition after transition.

    Args:
        observed: angle of o_{k+1}, shape (n, joints) [counts], in order of time; the first 200 are drawn.
        simulated: angle of sim_{k+1} (eq. 3.1), the same shape.
        spec: the arm, for units.

    """
    joints = observed.shape[1]
    figure, axes = panels(2, joints, 3.9, sharex=True, height_ratios=(3, 2))
    for joint in range(joints):
        o, s = (spec.degrees(angle[:IN_A_ROW, joint]) for angle in (observed, simulated))
        k = np.arange(len(o))
        above, below = axes[:, joint]
        seen = above.plot(k, o, "o", color=DARK, ms=3)[0]
        told = above.plot(k, s, color=MIDDLE, lw=1)[0]
        above.set_ylabel(f"angle{of_joint(joint, joints)} [°]")
        below.vlines(k, 0, s - o, color=INK, lw=0.9)
        below.axhline(0, color=INK, lw=0.7)
        below.set_ylabel("residue [°]")
        below.set_xlabel("transition k [-]")
        if len(o) == 0:
            nothing(above, "no transitions")
    legend_below(figure, [seen, told], ["observed", "simulated"])
    error = (simulated - observed)[:IN_A_ROW] / spec.counts_per_degree
    figure.alt = (
        f"Observed and simulated angle of {len(error)} transitions, and their difference below: its mean is "
        f"{error.mean():.2f}°, its standard deviation {error.std():.2f}°, the largest {np.abs(error).max():.1f}°."
        if len(error)
        else "There are no transitions to compare."
    )
    return figure


@dataclass(frozen=True)
class Classification:
    """What transitions are classified by."""

    label: str
    """With its unit."""
    value: Array
    """Shape (n,)."""
    actions: bool = False
    """Whether the values are the actions 0..8 rather than numbers on a scale."""

    def statistics(self, residue: Array) -> Bins:
        """Return mean and standard deviation of ``residue`` (n,) in each class."""
        return by_group(self.value, self.value, residue) if self.actions else binned(self.value, residue)


@styled
def residue_by_class(residue: Array, classes: Sequence[Classification]) -> Described:
    """Draw the residue against every classification, with mean and standard deviation in each class.

    Args:
        residue: sim_{k+1} - o_{k+1} (eq. 3.2) of the angle, shape (n,) [degrees].
        classes: what the transitions are classified by.

    """
    rows = -(-len(classes) // 2)
    figure, axes = panels(rows, min(2, len(classes)), 2.6 * rows + 0.3, sharey=True)
    limit = 1.05 * float(np.percentile(np.abs(residue), 99.8)) if len(residue) else 1.0
    words = [f"Residue of {len(residue):,} transitions, with its mean and standard deviation in each class."]
    for place, kind in zip(axes.flat, classes, strict=False):
        place.set_xlabel(kind.label)
        place.set_ylabel("residue [°]")
        place.set_ylim(-limit or -1, limit or 1)
        if len(residue) == 0:
            nothing(place, "no transitions")
            continue
        x = kind.value
        if kind.actions:
            # A fixed pattern instead of random jitter: the same data must give the same picture.
            x = x + 0.6 * (np.arange(len(x)) * 0.618034 % 1 - 0.5)
            place.set_xticks(range(ACTIONS), [_valve_signs(a) for a in range(ACTIONS)])
        else:
            low, high = np.percentile(x, (0.2, 99.8))
            place.set_xlim(low, high) if high > low else None
        scatter(place, x, residue, s=3, alpha=0.25)
        stats = kind.statistics(residue)
        place.errorbar(stats.centre, stats.mean, stats.std, fmt="s-" if not kind.actions else "s", color=MIDDLE,
                       ms=4, capsize=2.5, lw=1.2, mec=INK, mew=0.5)  # fmt: skip
        if len(stats.std) == 0:
            continue
        least, most = int(np.argmin(stats.std)), int(np.argmax(stats.std))
        words.append(
            f"By {kind.label}: class means from {stats.mean.min():.2f} to {stats.mean.max():.2f}°, standard "
            f"deviation from {stats.std[least]:.2f}° (at {_at(kind, stats, least)}) to {stats.std[most]:.2f}° "
            f"(at {_at(kind, stats, most)})."
        )
    for place in list(axes.flat)[len(classes) :]:
        place.set_visible(False)
    figure.alt = " ".join(words)
    return figure


def _at(kind: Classification, stats: Bins, index: int) -> str:
    value = stats.centre[index]
    return _valve_signs(int(value)) if kind.actions else f"{value:.3g}"


def _valve_signs(action: int) -> str:
    """Return the action's two valve settings: + in, 0 closed, − out."""
    return "".join({-1: "−", 0: "0", 1: "+"}[int(v)] for v in VALVES[action])
