"""Actions that an arm does not have, left out of networks with an output for each action of each joint."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import NEVER, possible_actions
from pneumarm.networks.layers import split


def leave_out(spec: ArmSpec, weights: NDArray[np.float32], mask: NDArray[np.float32], sizes: tuple[int, ...]) -> None:
    """Have the network of ``weights`` (size,) never choose an action that the arm ``spec`` does not have.

    Its outputs for these always say so, whatever is learned: ``mask`` (size,) is 0 where a weight stays as it is.
    """
    outputs = np.tile(~possible_actions(spec.muscles), spec.joints)
    last, kept = split(weights, sizes)[-1], split(mask, sizes)[-1]
    last[:, outputs], kept[:, outputs] = 0.0, 0.0
    last[-1, outputs] = NEVER
