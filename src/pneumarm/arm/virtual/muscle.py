"""A braided pneumatic muscle: force, threshold, dry friction, creep, and the pressure of the air in it.

The tension of a muscle of length l that stretches with l' is

    F = max(0, p_eff f(l) + F_bladder(l) + F_creep + F_slip + c(p_eff) l' + F_stop(l))

where f(l) = A0 (a (1 - k eps)^2 - b) with eps = 1 - l/l0 (thesis eq. 2.1; Tondu and Lopez' k where contracted).
The volume follows from the same law, dV/dl = -f(l), and the pressure from

    p' = n / (V + Vd) (p0 Q - p s dV/dl l'),    s = dp_eff/dp

The factor s makes dF/dp = -dV/dl at the threshold too, so that a closed muscle cannot create energy.
"""

from pneumarm.arm.virtual.flow import free_air
from pneumarm.arm.virtual.parameters import ATMOSPHERE, ELEMENTS, FREE_AIR
from pneumarm.arm.virtual.state import INLET, OUTLET
from pneumarm.arm.virtual.threshold import engage, threshold
from pneumarm.kernels import inner


@inner
def braid(c, length):  # type: ignore[no-untyped-def]
    """Return the pull per pressure f [m2] and the volume V [m3] of the braid at ``length`` [m]."""
    relative = length * c.per_rest_length
    k, per_k = (c.tip, c.per_tip) if relative < 1.0 else (1.0, 1.0)
    u = 1.0 + k * (relative - 1.0)
    pull = c.area * (c.a * u * u - c.b)
    volume = c.area * c.rest_length * (c.b * relative - c.a * ((u * u * u - 1.0) * per_k + 1.0) * (1.0 / 3.0))
    return pull, volume


@inner
def passive_pull(stiffness, bladder_length, c, length):  # type: ignore[no-untyped-def]
    """Return the pull of bladder and jammed braid [N] at ``length`` [m]."""
    return stiffness * max(0.0, length - bladder_length) + c.stop_stiffness * max(0.0, length - c.stop_length)


@inner
def air_in(muscle, c, supply):  # type: ignore[no-untyped-def]
    """Return what flows into the muscle through valves and leaks, and through the inlet alone [m3/s of free air]."""
    pressure, taken = muscle.pressure, 0.0
    flow = c.seat_leak * (supply - pressure) - c.leak * (pressure - ATMOSPHERE)
    if muscle.open[INLET]:
        taken = free_air(c.inlet, supply, pressure, c)
        flow += taken
    if muscle.open[OUTLET]:
        flow -= free_air(c.outlet, pressure, ATMOSPHERE, c)
    return flow, taken


@inner
def compress(muscle, c, volume, air, polytropic):  # type: ignore[no-untyped-def]
    """Bring the pressure up to date after ``air`` [m3 of free air] came in and the braid took ``volume`` [m3].

    The volume enters by (Vm - h) / (Vm + h) with h = n s dV / 2, which agrees with (V1 / V2)^n up to the third
    order in dV, so that a closed muscle keeps p (V + Vd)^n.
    """
    half = 0.5 * polytropic * muscle.engagement * (volume - muscle.volume)
    mean = 0.5 * (volume + muscle.volume) + c.dead_volume
    muscle.pressure = (muscle.pressure * (mean - half) + polytropic * FREE_AIR * air) / (mean + half)
    muscle.volume = volume


@inner
def slip(muscle, c, stretch):  # type: ignore[no-untyped-def]
    """Stretch the Maxwell-slip elements by ``stretch`` [m] and return their pull [N].

    Each element is a spring of stiffness W_i / Delta_i that slips at the force W_i = w_i (c0 + cp p_eff).
    """
    capacity = muscle.friction + muscle.friction_per_pressure * muscle.engaged
    total = 0.0
    for i in range(ELEMENTS):
        most = capacity * c.slip_weights[i]
        force = min(max(muscle.slip[i] + capacity * c.slip_rates[i] * stretch, -most), most)
        muscle.slip[i] = force
        total += force
    return total


@inner
def bring_to_length(muscle, c, length, speed, supply, polytropic, dt):  # type: ignore[no-untyped-def]
    """Bring the muscle to ``length`` [m], reached with ``speed`` [m/s] in ``dt`` [s], and update its tension.

    With ``dt`` and ``speed`` 0 it is an infinitely slow change of length.
    """
    stretch = length - muscle.length
    pull, volume = braid(c, length)
    flow, taken = air_in(muscle, c, supply)
    muscle.taken += dt * taken
    compress(muscle, c, volume, dt * flow, polytropic)
    muscle.length = length
    above = muscle.pressure - ATMOSPHERE - threshold(muscle.threshold, c, length)
    muscle.engaged, muscle.engagement = engage(above)
    dry = slip(muscle, c, stretch)
    viscous = (muscle.viscosity + muscle.viscosity_per_pressure * muscle.engaged) * speed
    muscle.heat += dt * (abs(dry * speed) + viscous * speed)
    creep = c.creep_total * (length - c.length_at_zero) - muscle.creep_pull
    passive = passive_pull(muscle.bladder_stiffness, muscle.bladder_length, c, length)
    muscle.tension = max(0.0, muscle.engaged * pull + passive + creep + dry + viscous)


@inner
def static_tension(c, pressure, length):  # type: ignore[no-untyped-def]
    """Return the pull [N] at ``pressure`` [Pa gauge] without friction and after all creep, at 20 degrees."""
    engaged, _ = engage(pressure - threshold(c.threshold, c, length))
    pull, _ = braid(c, length)
    return max(0.0, engaged * pull + passive_pull(c.bladder_stiffness, c.bladder_length, c, length))
