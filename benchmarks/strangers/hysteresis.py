"""How joints of strangers remember where they came from: loops that one of four models makes.

- none: tendons on ball bearings, and muscles that are new.
- slip: blocks on springs that are dragged along, in parallel (the Maxwell slip model; T. Vo-Minh et al., 2011).
- bouc-wen: a state that follows the angle and saturates (R. Bouc, 1967; Y.-K. Wen, 1976; M. Ismail, F. Ikhouane and
  J. Rodellar, 2009).
- play: what the pressure is worth lags behind it by plays (Prandtl and Ishlinskii; M. Brokate and J. Sprekels, 1996).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NONE, SLIP, BOUC_WEN, PLAY = range(4)
KINDS = "none", "slip", "bouc-wen", "play"
BLOCKS, PLAYS = 4, 3
MEMORY = max(BLOCKS, 2 * PLAYS)
"""Numbers that a joint remembers: of its blocks [N m], of its Bouc-Wen model, or the plays of two muscles [bar]."""


class Loops(NamedTuple):
    """Hysteresis of the joints of an arm, as it enters the compiled loop."""

    kind: NDArray[np.int64]
    """Shape (joints,)."""
    stiffness: Array
    """Of the blocks' springs, shape (joints, BLOCKS) [N m/rad]."""
    limit: Array
    """At which blocks slip, shape (joints, BLOCKS) [N m]."""
    height: Array
    """Torque at which the Bouc-Wen model saturates, shape (joints,) [N m]."""
    width: Array
    """Angle that it takes to, shape (joints,) [rad]."""
    sigma: Array
    """What shapes its loops, at least 1/2; shape (joints,)."""
    sharpness: Array
    """Exponent of its loops' corners, at least 1; shape (joints,)."""
    play: Array
    """Half widths of the plays, shape (joints, PLAYS) [bar]."""
    weight: Array
    """What each play is worth, shape (joints, PLAYS); the rest is the pressure as it is."""
    base: Array
    """Share of the loops' torque that does not grow with the pressures, shape (joints,)."""
    full: Array
    """Pressure at which loops are as they are told [bar], shape (joints,)."""


def draw_loops(random: np.random.Generator, half_width: float, stiffness: float, by_bar: float, full: float) -> Loops:
    """Draw the loops of a joint.

    Args:
        random: what draws.
        half_width: of the loop at a steady pressure [rad]; 0 for none.
        stiffness: of the joint at a steady pressure [N m/rad].
        by_bar: torque that a bar in one muscle makes [N m/bar].
        full: highest pressure [bar].

    """
    kind = int(random.integers(SLIP, PLAY + 1)) if half_width > 0 else NONE
    torque = half_width * stiffness
    shares = random.dirichlet(np.full(BLOCKS, 2.0))
    bends = np.radians(random.uniform(0.2, 1.5)) * np.linspace(0.4, 1.0, BLOCKS)  # angles until they slip
    plays = random.dirichlet(np.full(PLAYS, 2.0)) * 0.8
    # In step both muscles lag, one up and one down.
    depth = min(torque / by_bar / 2, 0.15 * full)
    return Loops(
        kind=np.array([kind]),
        stiffness=(shares * torque / bends)[None],
        limit=(shares * torque)[None],
        height=np.array([torque]),
        width=np.radians([random.uniform(0.5, 2.5)]),
        sigma=np.array([random.uniform(0.6, 2.0)]),
        sharpness=np.array([random.uniform(1.0, 2.0)]),
        play=(depth / 0.8 * np.array([0.5, 1.0, 1.5]))[None],
        weight=plays[None],
        base=np.array([random.uniform(0.3, 1.0)]),
        full=np.array([full]),
    )
