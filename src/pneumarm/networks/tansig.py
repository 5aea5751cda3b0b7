"""The hyperbolic tangent of many units at once, as compiled loops need it."""

import numpy as np

from pneumarm.kernels import part

FASTMATH = {"contract"}
"""What a compiler may do to sums here: round a product and a sum once. Their order is the source's."""

_CLIP = np.float32(6.29701)  # where the ratio in tansig reaches 1; tanh is 1 - 6.8e-6 there


@part(fastmath=FASTMATH)
def tansig(hidden):  # type: ignore[no-untyped-def]
    """Replace ``hidden`` (units,) by its hyperbolic tangent, within 7e-6.

    Source: J. H. Lambert's continued fraction x/(1 + x^2/(3 + x^2/(5 + ...))), cut after eight fractions; a ratio of
    polynomials needs neither tables nor branches, so eight or sixteen units are done at once.
    """
    for u in range(hidden.shape[0]):
        z = hidden[u]
        z = z if z < _CLIP else _CLIP
        z = z if z > -_CLIP else -_CLIP
        s = z * z
        above = np.float32(34459425) + s * (
            np.float32(4729725) + s * (np.float32(135135) + s * (np.float32(990) + s))
        )
        below = np.float32(34459425) + s * (
            np.float32(16216200) + s * (np.float32(945945) + s * (np.float32(13860) + s * np.float32(45)))
        )
        hidden[u] = z * above / below
