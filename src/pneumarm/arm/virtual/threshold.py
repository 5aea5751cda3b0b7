"""The threshold pressure: below it the bladder does not touch the weave, and the muscle does not pull.

The pressure that reaches the weave is p_eff = w ln(1 + exp((p - p_th(l)) / w)), with a width w of 0.01 bar. It
is needed in every substep of every muscle, so the soft part is a table of cubics; its slope s = dp_eff/dp is
the slope of these cubics, so that both belong together exactly.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner

SOFTNESS = 1000.0
"""Width w of the threshold, 0.01 bar [Pa]."""
_PER_WIDTH = 4  # cubics per width: the error is 1e-6 widths
_SATURATED = 14.0  # widths from the threshold where soft is as good as sharp (1e-6 widths)


def _cubics() -> NDArray[np.float64]:
    """Return the coefficients, lowest order first, of Hermite cubics through ln(1 + exp(-y)), y = 0.._SATURATED."""
    y = np.arange(0, _SATURATED * _PER_WIDTH + 1) / _PER_WIDTH
    value, slope = np.log1p(np.exp(-y)), -1 / (1 + np.exp(y)) / _PER_WIDTH
    value[-1] = slope[-1] = 0.0  # it joins the sharp threshold without a step
    rise = np.diff(value)
    second = 3 * rise - 2 * slope[:-1] - slope[1:]
    third = slope[:-1] + slope[1:] - 2 * rise
    return np.stack([value[:-1], slope[:-1], second, third], axis=1)


_CUBICS = _cubics()


@inner
def threshold(at_rest, c, length):  # type: ignore[no-untyped-def]
    """Return the pressure p_th [Pa gauge] at which the bladder touches the weave at ``length`` [m].

    It is ``at_rest`` at the rest length and grows with the gap between bladder and weave, up to twice that.
    """
    relative = length * c.per_rest_length
    sine = math.sqrt(max(0.0, 1.0 - c.cosine_squared * relative * relative))
    return at_rest * min(max(c.contact * sine - c.contact_offset, 0.0), 2.0)


@inner
def engage(above):  # type: ignore[no-untyped-def]
    """Return p_eff [Pa] and s = dp_eff/dp for a pressure that is ``above`` the threshold by so much [Pa]."""
    widths = above * (1.0 / SOFTNESS)
    distance = abs(widths)
    if distance >= _SATURATED:
        return max(above, 0.0), 1.0 if above > 0.0 else 0.0
    place = distance * _PER_WIDTH
    i = int(place)
    x = place - i
    c0, c1, c2, c3 = _CUBICS[i, 0], _CUBICS[i, 1], _CUBICS[i, 2], _CUBICS[i, 3]
    tail = c0 + x * (c1 + x * (c2 + x * c3))
    slope = -_PER_WIDTH * (c1 + x * (2.0 * c2 + x * 3.0 * c3))
    return SOFTNESS * (max(widths, 0.0) + tail), 1.0 - slope if above > 0.0 else slope
