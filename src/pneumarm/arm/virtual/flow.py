"""Air through valves and hoses (ISO 6358) and through leaks."""

import math

from pneumarm.kernels import inner


@inner
def flow_function(ratio, c):  # type: ignore[no-untyped-def]
    """Return the flow relative to choked flow at the pressure ``ratio`` <= 1 (downstream over upstream).

    phi = 1 up to the critical ratio b, the quarter ellipse sqrt(1 - ((ratio - b) / (1 - b))^2) above it, and a
    straight line to 0 above the laminar ratio, because the ellipse ends with an infinite slope.

    Source: ISO 6358-1.
    """
    if ratio <= c.critical_ratio:
        return 1.0
    if ratio <= c.laminar_ratio:
        place = (ratio - c.critical_ratio) * c.per_subsonic
        return math.sqrt(1.0 - place * place)
    return c.laminar_slope * (1.0 - ratio)


@inner
def free_air(conductance, source, sink, c):  # type: ignore[no-untyped-def]
    """Return the flow from ``source`` to ``sink`` (absolute pressures [Pa]), negative where it runs back.

    Q = C p1 phi(p2 / p1) [m3/s of free air] with the sonic ``conductance`` C [m3/(s Pa)].
    """
    if source >= sink:
        return conductance * source * flow_function(sink / source, c)
    return -conductance * sink * flow_function(source / sink, c)
