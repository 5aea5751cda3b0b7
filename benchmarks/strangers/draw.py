"""Draw the arm of a number: its air, its joints and their loads, what it remembers, its sensors and its spec.

What no controller could hold is bounded: loads are lightened until muscles lift them with something left, and valves
are throttled until the shortest time that they can be open turns the joint by little enough. Where that is not
enough, another arm is drawn.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.strangers import motion
from benchmarks.strangers.air import ATMOSPHERE, CAPILLARY, LAG, NOZZLE, Air
from benchmarks.strangers.air import KINDS as FLOWS
from benchmarks.strangers.body import Body
from benchmarks.strangers.hysteresis import KINDS as MEMORIES
from benchmarks.strangers.hysteresis import Loops, draw_loops
from benchmarks.strangers.joints import Statics, joined, stronger
from benchmarks.strangers.muscles import Law, Muscles, draw_law, measured
from benchmarks.strangers.sensors import Sensor, draw_angle, draw_pressure
from pneumarm.arm import ArmSpec

Array = NDArray[np.float64]

_GRAVITY = 9.81  # m/s2
_RATES = 25, 30, 40, 50, 60, 80, 100  # Hz
_LOADS = "none", "hanging", "held out", "inverted", "spring"
_REACH = 0.9
"""How far each muscle must turn against a load, of the way to the stop."""
_FINEST = math.radians(0.6), math.radians(1.8)
"""What the shortest opening of a valve may turn at most [rad]: of pulses, of whole periods."""
_SLOWEST = 4.0
"""Longest time to fill a muscle in [s]."""
_CALM = 2.5
"""Longest time constant in which a joint whose valves are closed stops swinging [s]."""
_ATTEMPTS = 1000


class Hinge(NamedTuple):
    """One joint as drawn."""

    statics: Statics
    loops: Loops
    family: str
    load: str
    frequency: float
    """Natural frequency with closed valves [Hz]."""
    damping: float
    """Damping ratio, without what loops and muscles damp."""
    half_width: float
    """Of its loop [rad]."""


@dataclass(frozen=True)
class Design:
    """Everything that an arm is made of."""

    body: Body
    muscles: Muscles
    loops: Loops
    air: Air
    opening: Array
    """Dead times of valves, shape (joints, 2, 2) [s]."""
    closing: Array
    angles: tuple[Sensor, ...]
    pressures: Sensor
    spec: ArmSpec
    about: tuple[dict[str, str | float], ...]
    """What there is to say of each joint."""


class _Supply(NamedTuple):
    gauge: float
    """[bar]."""
    full: float
    """Pressure that muscles are filled up to [bar gauge]."""
    kind: int
    exponent: float
    rate: int
    """[Hz]."""
    pulses: bool
    opening: float
    """Dead times of its valves, about [s]."""
    closing: float


class _Unholdable(Exception):
    """An arm that nobody could have used."""


def draw_arm(number: int, joints: int) -> Design:
    """Return the arm of a ``number`` with so many ``joints``, 1 or 2."""
    for attempt in range(_ATTEMPTS):
        try:
            return _drawn(np.random.default_rng([number, joints, attempt]), number, joints)
        except _Unholdable:
            pass
    raise AssertionError(f"no arm of number {number} can be held")


def _drawn(random: np.random.Generator, number: int, joints: int) -> Design:
    supply = _draw_supply(random)
    hinges = [_draw_hinge(random, supply, (1.0, 6.0))] if joints == 1 else _draw_chain(random, supply)
    dead = [about * random.uniform(0.85, 1.15, (joints, 2, 2)) for about in (supply.opening, supply.closing)]
    shortest = _up(float(dead[0].max()) + 1e-3)
    air = _draw_air(random, supply, hinges, shortest)
    angles = _draw_angles(random, hinges)
    pressures = draw_pressure(random, supply.gauge)
    bodies = [one.statics.body for one in hinges]
    spec = ArmSpec(
        name=f"stranger {('one', 'two')[joints - 1]}_{number}",
        joints=joints,
        period=1 / supply.rate,
        counts_per_degree=angles[0].slope,
        counts_per_bar=pressures.slope,
        angle_range=(0.0, angles[0].top),
        max_pressure=supply.full + pressures.zero / pressures.slope,
        pulses=supply.pulses,
        shortest_pulse=shortest,
        fill_times=_fill_times(air, hinges[0].statics, supply),
    )
    return Design(
        body=joined(bodies),
        muscles=joined([one.statics.muscles for one in hinges]),
        loops=joined([one.loops for one in hinges]),
        air=air,
        opening=dead[0],
        closing=dead[1],
        angles=angles,
        pressures=pressures,
        spec=spec,
        about=tuple(_about(one, supply, air, angle) for one, angle in zip(hinges, angles, strict=True)),
    )


def _draw_supply(random: np.random.Generator) -> _Supply:
    gauge, rate = _spread(random, 1.5, 5.0), int(random.choice(_RATES))
    opening = _spread(random, 0.001, min(0.008, 0.4 / rate))
    return _Supply(
        gauge,
        full=gauge * random.uniform(0.65, 1.0),
        kind=int(random.choice((NOZZLE, CAPILLARY, LAG))),
        exponent=random.uniform(1.0, 1.4),
        rate=rate,
        pulses=bool(random.random() < 0.5),
        opening=opening,
        closing=_spread(random, 0.001, 0.008),
    )


def _draw_chain(random: np.random.Generator, supply: _Supply) -> list[Hinge]:
    """Draw two links of which the first carries the second, in a plane that is level or upright."""
    loads = random.permutation(["none", "spring"]) if random.random() < 0.4 else ["hanging", "hanging"]
    second = _draw_hinge(random, supply, (1.5, 6.0), str(loads[1]))
    first = _draw_hinge(random, supply, (1.0, 3.0), str(loads[0]))
    ratio, along, bend = random.uniform(4.0, 10.0), random.uniform(0.2, 0.8), math.radians(random.uniform(0, 70))
    light, heavy = float(second.statics.body.inertia[0]), float(first.statics.body.inertia[0])
    muscles, body = stronger(first.statics.muscles, first.statics.body, ratio * light / heavy)
    statics = first.statics._replace(muscles=muscles, body=body)
    loops = _loops(random, statics, first.half_width, supply)
    jointed = second.statics.body._replace(carried=np.array([along * light]), bend=np.array([bend]))
    second = second._replace(statics=second.statics._replace(body=jointed))
    weighs = float(second.statics.body.weight[0])
    if (
        min(statics.reach(supply.full, first.half_width * statics.stiffness(supply.full / 2, False) + weighs))
        < _REACH
    ):
        raise _Unholdable
    return [first._replace(statics=statics, loops=loops), second]


def _draw_hinge(
    random: np.random.Generator, supply: _Supply, frequencies: tuple[float, float], load: str | None = None
) -> Hinge:
    law = draw_law(random, supply.full)
    stop = math.radians(random.uniform(50, 130) / 2)
    muscles, body = _draw_muscles(random, law, stop), _bare(random, stop)
    body = body._replace(lever=np.array([_lever(muscles[1], body)]))
    bare = Statics(body, muscles[0], supply.exponent)
    load = str(random.choice(_LOADS)) if load is None else load
    frequency = _spread(random, *frequencies)
    damping = max(_spread(random, 0.03, 0.6), 1 / (2 * math.pi * frequency * _CALM))
    half_width = math.radians(_spread(random, 0.1, 3.0)) if random.random() < 0.8 else 0.0
    creeps = random.uniform(0.01, 0.12) if random.random() < 0.7 else 0.0
    statics = _loaded(random, bare, supply, load, frequency, half_width)
    closed, held = (statics.stiffness(supply.full / 2, one) for one in (True, False))
    inertia = float(statics.body.inertia[0])
    viscous = 2 * damping * math.sqrt(closed * inertia)
    muscle_damping = 0.0
    if law.damped:
        share = random.uniform(0.03, 0.2)
        lever = float(body.lever[0])
        muscle_damping = 2 * share * math.sqrt(closed * inertia) / (supply.full * lever**2)
    statics = statics._replace(
        muscles=statics.muscles._replace(damping=np.full((1, 2), muscle_damping)),
        body=statics.body._replace(
            viscous=np.array([viscous]),
            stop_stiffness=np.array([30 * closed]),
            stop_damping=np.array([0.6 * math.sqrt(30 * closed * inertia)]),
            creep=np.array([creeps * held]),
        ),
    )
    loops = _loops(random, statics, half_width, supply)
    return Hinge(statics, loops, law.family, load, frequency, damping, half_width)


def _draw_muscles(random: np.random.Generator, law: Law, stop: float) -> tuple[Muscles, tuple[float, float]]:
    """Return two muscles of a ``law``, and how far they are drawn in at the stops [m] with the angle of these."""
    low = law.low + random.uniform(0.0, 0.15) * (law.high - law.low)
    high = law.low + random.uniform(0.82, 0.95) * (law.high - law.low)
    area, length, dead = _spread(random, 4e-4, 3e-3), random.uniform(0.08, 0.3), random.uniform(0.2, 0.7)
    second = random.choice((1 / 0.7, 0.7)) if random.random() < 0.3 else random.uniform(0.95, 1.05)
    made = [measured(law, one, length, (low, high), dead) for one in (area, area * second)]
    pair = (1, 2)
    muscles = Muscles(
        table=np.stack([one[0] for one in made])[None],
        lowest=np.array([[one[1] for one in made]]),
        spacing=np.array([[one[2] for one in made]]),
        middle=np.full(pair, (low + high) / 2),
        length=np.full(pair, length),
        start=np.full(pair, law.start),
        damping=np.zeros(pair),
        pushes=np.full(pair, law.pushes),
    )
    return muscles, (length * (high - low) / 2, stop)


def _bare(random: np.random.Generator, stop: float) -> Body:
    """Return a hinge without a load, inertia or a lever."""
    names: dict[str, float] = dict.fromkeys(Body._fields, 0.0)
    names |= {"stop": stop, "creep_time": _spread(random, 1.0, 15.0), "inertia": 1.0}
    names["crank"] = 0.0 if random.random() < 0.6 else random.uniform(0.3, 1.0)
    return Body(**{name: np.array([value]) for name, value in names.items()})


def _lever(drawn: tuple[float, float], body: Body) -> float:
    """Return the lever [m] with which a joint is at its stop when its muscles are at the end of what they use."""
    most, stop = drawn
    crank = float(body.crank[0])
    return most / ((1 - crank) * stop + crank * math.sin(stop))


def _loaded(
    random: np.random.Generator, bare: Statics, supply: _Supply, load: str, frequency: float, half_width: float
) -> Statics:
    """Return a joint with a ``load`` that its muscles lift, and the inertia that gives it its ``frequency``."""
    middle = supply.full / 2
    upright = {"hanging": 0.0, "held out": random.choice([-1, 1]) * math.pi / 2, "inverted": math.pi}.get(load, 0.0)
    upright += math.radians(random.uniform(-20, 20))
    share = random.uniform(0.2, 1.0) if load in ("hanging", "held out", "inverted") else 0.0
    radius = random.uniform(0.12, 0.4)  # of gyration [m]
    spring = bare.stiffness(middle, False) * (random.uniform(0.2, 1.0) if load == "spring" else 0.0)
    rest = random.uniform(-0.4, 0.4) * float(bare.body.stop[0])
    swing = (2 * math.pi * frequency) ** 2
    for _ in range(20):
        by_inertia = share * _GRAVITY / radius  # weight by inertia [1/s2]
        closed = bare.stiffness(middle, True) + spring
        inertia = closed / max(swing - by_inertia * math.cos(upright), 0.3 * swing)
        weighs = inertia * by_inertia
        body = bare.body._replace(
            inertia=np.array([inertia]),
            spring=np.array([spring]),
            rest=np.array([rest]),
            weight=np.array([weighs]),
            upright=np.array([upright]),
        )
        statics = bare._replace(body=body)
        held = statics.stiffness(middle, False)
        friction = half_width * max(held, 0.0)
        holds = held > 0.15 * closed and abs(swing * inertia / statics.stiffness(middle, True) - 1) < 0.02
        if holds and min(statics.reach(supply.full, friction)) >= _REACH:
            return statics
        share, spring = 0.75 * share, 0.75 * spring
    raise _Unholdable


def _loops(random: np.random.Generator, statics: Statics, half_width: float, supply: _Supply) -> Loops:
    middle = supply.full / 2
    return draw_loops(random, half_width, statics.stiffness(middle, False), statics.by_bar(middle), supply.full)


def _draw_angles(random: np.random.Generator, hinges: list[Hinge]) -> tuple[Sensor, ...]:
    """Return an angle sensor a joint, alike but for their noise: a spec has one slope and one range for all."""
    widest = max(float(one.statics.body.stop[0]) for one in hinges)
    drawn = [draw_angle(random, math.degrees(widest) + 1.0) for _ in hinges]
    return tuple(replace(drawn[0], noise=one.noise) for one in drawn)


def _draw_air(random: np.random.Generator, supply: _Supply, hinges: list[Hinge], shortest: float) -> Air:
    """Return valves that fill and empty muscles in times drawn, throttled to what turns them finely enough."""
    pair = (len(hinges), 2)
    volumes = np.array([[one.statics.volume(0.0, m) for m in (0, 1)] for one in hinges])
    unit = Air(
        supply.kind,
        supply.gauge + ATMOSPHERE,
        recovery=_spread(random, 0.05, 0.8),
        tank=1.0,
        exponent=supply.exponent,
        slower=random.uniform(0.0, [1.0, 1.5]),
        conductance=np.ones((*pair, 2)),
        leak=np.zeros(pair),
        hose=np.zeros(pair),
        line=np.ones(pair),
    )
    times = _spread(random, 0.2, 2.5) * np.array([1.0, _spread(random, 0.4, 1.6)])
    shortest = max(shortest + supply.closing - supply.opening, 1e-3) if supply.pulses else 1 / supply.rate
    conductance = np.empty((*pair, 2))
    for j, hinge in enumerate(hinges):
        alone = random.uniform(0.85, 1.15, 2)
        for v in (0, 1):
            wanted = volumes[j].mean() * _time(unit, supply, v) / (times[v] * alone[v])
            finest = _FINEST[0 if supply.pulses else 1]
            turns = _turned(unit, hinge.statics, supply, v, volumes[j].mean()) * wanted * shortest
            throttled = wanted * min(1.0, finest / turns)
            if throttled < volumes[j].mean() * _time(unit, supply, v) / _SLOWEST:
                raise _Unholdable
            conductance[j, :, v] = throttled * random.uniform(0.95, 1.05, 2)
    drawn = conductance[..., 0].mean() * motion.flow(unit, unit.full, ATMOSPHERE + supply.full / 2, True)
    sags = supply.gauge * _spread(random, 0.004, 0.12)  # what the supply gives way by in the end for an open inlet
    leaks = volumes * math.log(2) / supply.exponent / _spread(random, 5.0, 200.0) * random.uniform(0.6, 1.0, pair)
    hose, line = np.zeros(pair), np.ones(pair)
    if random.random() < 0.35:
        line = volumes * random.uniform(0.08, 0.2)
        hose = conductance.mean(axis=2) * motion.flow(unit, unit.full, ATMOSPHERE + supply.full / 2, True)
        hose = hose / (supply.full * random.uniform(0.08, 0.25))
        hose = np.minimum(hose, 600 * line)
    return unit._replace(
        tank=unit.recovery * drawn / sags,
        conductance=conductance,
        leak=leaks if random.random() < 0.7 else np.zeros(pair),
        hose=hose,
        line=line,
    )


def _time(unit: Air, supply: _Supply, valve: int) -> float:
    """Return the time that an inlet (0) or outlet (1) takes for nine tenths, by litre and conductance [s]."""
    gauge = np.linspace(0.0, 0.9, 46) * supply.full
    flows = [_flow(unit, supply, valve, float(one if valve == 0 else supply.full - one)) for one in gauge]
    return float(np.trapezoid(1 / np.array(flows), gauge)) / supply.exponent


def _flow(unit: Air, supply: _Supply, valve: int, gauge: float) -> float:
    """Return what flows by conductance into or out of a muscle at a pressure [bar gauge]."""
    pressure = ATMOSPHERE + gauge
    if valve == 0:
        return max(float(motion.flow(unit, unit.full, pressure, True)), 1e-3)
    return float(motion.flow(unit, pressure, ATMOSPHERE, False))


def _turned(unit: Air, statics: Statics, supply: _Supply, valve: int, volume: float) -> float:
    """Return how far a joint turns by second and conductance, as one of its muscles is filled or emptied [rad]."""
    middle = supply.full / 2
    rise = supply.exponent * _flow(unit, supply, valve, middle) / volume
    return rise * statics.by_bar(middle) / statics.stiffness(middle, True)


def _fill_times(air: Air, statics: Statics, supply: _Supply) -> tuple[float, float]:
    """Return the times to fill and to empty a muscle of joint 1 in [s]."""
    unit = air._replace(conductance=np.ones_like(air.conductance))
    found = [statics.volume(0.0, 0) * _time(unit, supply, v) / float(air.conductance[0, 0, v]) for v in (0, 1)]
    return round(found[0], 2), round(found[1], 2)


def _about(hinge: Hinge, supply: _Supply, air: Air, angle: Sensor) -> dict[str, str | float]:
    return {
        "muscles": hinge.family,
        "air": FLOWS[supply.kind] + (", hose" if air.hose.any() else ""),
        "memory": MEMORIES[int(hinge.loops.kind[0])],
        "loop +- [deg]": math.degrees(hinge.half_width),
        "load": hinge.load,
        "swing [Hz]": hinge.frequency,
        "damping ratio": hinge.damping,
        "range [deg]": 2 * math.degrees(float(hinge.statics.body.stop[0])),
        "noise [deg]": angle.noise,
        "supply [bar]": supply.gauge,
    }


def _spread(random: np.random.Generator, least: float, most: float) -> float:
    """Return a number drawn evenly by its logarithm."""
    return float(np.exp(random.uniform(np.log(least), np.log(most))))


def _up(seconds: float) -> float:
    """Return a time rounded up to tenths of milliseconds."""
    return math.ceil(1e4 * seconds) / 1e4
