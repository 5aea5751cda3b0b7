"""What is wrong with an arm, in plain words: what, where, how it shows, and what to do.

Every rule looks at one thing that a healthy arm cannot do. The limits are far from what healthy virtual arms show
(``python -m benchmarks checkup`` makes the figures again), because a false complaint costs more than a fault that the
monitor finds a minute later.
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.arm.spec_file import SoundState
from pneumarm.checkup.exchanged import Exchange, What, exchanged
from pneumarm.checkup.figures import (
    FILLED,
    MOVED,
    JointFigures,
    autocorrelation,
    detrended,
    ends,
    irregularity,
    joint_figures,
    let_in,
    ljung_box,
    quickening,
    rise,
)
from pneumarm.checkup.leaks import LeakRates, leaking
from pneumarm.checkup.measure import Array, Checkup, JointTest, MuscleTest

WHITE = 0.25
"""Noise whose autocorrelation at any of the first lags exceeds this is not white."""
NOISY_ANGLE = 0.31
"""An angle is noisy whose standard deviation at rest exceeds so many degrees (thesis A.1.3: 4 counts, which are 0.35
degrees and 0.024 bar of its arm, are relatively high)."""
NOISY_PRESSURE = 0.02
"""A pressure is noisy whose standard deviation at rest exceeds so much of the limit."""
LEAK = 12.0
"""A muscle leaks if it loses more than so many percent of its pressure a minute, where it has no sound."""
LOW_SUPPLY = 0.75
"""The supply is low if a full muscle reads less than this share of the pressure limit."""
HIGH_SUPPLY = 1.04
"""The supply is high if a joint's muscles, on average, fill to more than this share of the limit before their inlets
can be closed."""
RISING = 0.85
"""The supply rises if at the end of the check-up muscles fill in less than this share of the time as before."""
LET_IN = 0.2
"""An inlet is stuck open if, closed, it lets in so much [of the limit] while the other muscle is filled and vented:
air that stays when the joint has gone back."""
ZERO = 0.05
"""A pressure sensor is not as calibrated if it reads so much more or less in a vented muscle [of the limit]."""
ENDS = 6.0
"""A joint is not as calibrated if its ends have moved by so much [degrees]."""
LEAP = 0.08
"""A sensor is at the valve's side if its reading drops by so much [of the limit] at once when the valve closes."""
LOGARITHMIC = 1.3
"""A potentiometer is logarithmic if one half of the sweep turns it so many times further than the other half."""
WORN = 0.4
"""A place of the potentiometer is worn if its readings are off by so many degrees there (root mean square)."""

Kind = Literal[
    What,
    "muscles swapped", "pressure sensors swapped", "valves swapped", "inlet stuck closed", "inlet stuck open",
    "exhaust stuck closed", "exhaust stuck open", "low supply", "high supply", "rising supply", "leak",
    "angle reversed", "angle dead", "angle frozen", "pressure frozen", "angle logarithmic", "angle worn",
    "pressure at the valve's side", "noise", "noise not white", "not as calibrated", "jitter",
]  # fmt: skip


class Complaint(NamedTuple):
    """Something that is wrong."""

    kind: Kind
    where: str
    told_by: str
    """The figure that tells."""
    remedy: str
    """What to do."""

    def __str__(self) -> str:
        return f"{self.where}: {self.kind}: {self.told_by}. {self.remedy}."


def diagnose(checkup: Checkup, sound: SoundState | None = None) -> list[Complaint]:
    """Return what is wrong with the arm; an empty list for a healthy one.

    Args:
        checkup: what was measured.
        sound: what the same arm did when it was calibrated, with its sensors corrected as they are now.

    """
    crossed = exchanged(checkup)
    found = [_of_exchange(exchange) for exchange in crossed]
    untold = set(range(len(checkup.joints))).difference(*(exchange.joints for exchange in crossed))
    found += [finding for j in sorted(untold) for finding in _of_joint(checkup, j, sound)]
    periods = checkup.timing.periods
    if np.quantile(periods, 0.95) > 1.5 * checkup.spec.period:
        worst = f"95 % of the control periods are below {1e3 * np.quantile(periods, 0.95):.0f} ms"
        remedy = f"This host or link cannot keep {1e3 * checkup.spec.period:.0f} ms: take a longer period"
        found.append(Complaint("jitter", "control cycle", worst, remedy))
    return found


def _of_exchange(exchange: Exchange) -> Complaint:
    """Return the complaint of what shows in no joint alone."""
    places = [f"joint {j + 1}, muscle {m + 1}" for j, m in exchange.muscles]
    places += [f"joint {j + 1}" for j in exchange.angles]
    other, mend = "other", "Swap the two"
    if len(places) > 2:
        other, mend = "next, of the last that of the first", "Connect each in its place"
    details: dict[What, str] = {
        "valves exchanged": f"filling each raises the pressure of the {other}, and turns its joint",
        "inlets exchanged": f"filling each raises the pressure of the {other}, which its own exhaust does not vent",
        "pressure sensors exchanged": f"filling each raises the pressure of the {other}, yet turns its own joint",
        "angle sensors exchanged": f"filling the muscles of each turns the angle of the {other}",
    }
    remedy = f"{mend}, then check again, for what else is wrong there"
    return Complaint(exchange.what, " and ".join(places), details[exchange.what], remedy)


def _of_joint(checkup: Checkup, j: int, sound: SoundState | None) -> Iterator[Complaint]:
    test, figures, spec = checkup.joints[j], joint_figures(checkup, j), checkup.spec
    limit = spec.max_pressure
    name = f"joint {j + 1}"
    rose = np.array([rise(test.muscles[m].fill) for m in range(2)]) / spec.counts_per_bar  # [muscle filled, sensor]
    own, other = rose.diagonal(), rose[:, ::-1].diagonal()
    turned = np.array([m.turned for m in figures.muscles])
    crossed = bool((other > FILLED * limit).all() and (own < 0.5 * other).all())
    reversed_ = bool(turned[0] < -5 and turned[1] > 5)
    yield from _of_sensors(checkup, j, name)
    before = test.before.pressure
    filled_by_venting = before[-10:].mean(axis=0) - before[0] > MOVED * spec.max_pressure_counts
    stays = np.array([_stays(test.muscles[m], m, checkup) for m in range(2)])
    swapped_pair = False
    for m in range(2):
        where = f"{name}, muscle {m + 1}"
        swapped = _vents_up(test.muscles[m], m, checkup)
        if (filled_by_venting[m] or swapped) and _filled_by_venting(test.muscles[m], m, checkup):
            swapped_pair = True
            yield Complaint(
                "valves swapped",
                where,
                "its pressure rises when its exhaust opens",
                "Swap its inlet and exhaust wires",
            )
    if crossed and reversed_:
        detail = "filling one raises the pressure of the other and turns the joint the other way"
        yield Complaint("muscles swapped", name, detail, "Swap the valves of muscle 1 with those of muscle 2")
    elif crossed:
        detail = "filling one raises the pressure of the other, yet the joint turns the right way"
        yield Complaint("pressure sensors swapped", name, detail, "Swap the two pressure sensors")
    elif reversed_:
        detail = f"muscle 1 turns it by {turned[0]:.0f}, muscle 2 by {turned[1]:.0f} degrees"
        yield Complaint("angle reversed", name, detail, "Swap the outer wires of the potentiometer")
    if crossed or swapped_pair:
        return
    full = np.mean([muscle.full for muscle in figures.muscles])
    if full > HIGH_SUPPLY * limit:
        detail = f"muscles fill to {full:.2f} bar before their inlets can be closed at the limit of {limit:.2f} bar"
        remedy = "Turn the reducer down; if it creeps up again, put a safety valve on the buffer (thesis A.1.1)"
        yield Complaint("high supply", name, detail, remedy)
        return  # so fast nothing else can be judged
    frozen = [_is_frozen(test, m) for m in range(2)]
    valves = list(_of_valves(checkup, j, figures, rose, stays, frozen, name))
    stuck = [finding for finding in valves if "stuck" in finding.kind]
    if stuck:
        yield from stuck  # while air flows that should not, nothing else can be judged
        return
    yield from valves
    yield from _of_leaks(checkup, figures, name, sound, j)
    if (quicker := quickening(test, checkup)) < RISING:
        detail = f"at the end of the check-up muscles fill in {100 * quicker:.0f} % of the time that they took before"
        remedy = "Check whether the reducer leaks: its buffer fills up while no air is used (thesis A.1.1)"
        yield Complaint("rising supply", name, detail, remedy)
    yield from _of_noise(checkup, j, name)
    potentiometer = list(_of_potentiometer(checkup, test, figures, name))
    yield from potentiometer
    if sound is not None and not potentiometer:
        yield from _of_calibration(checkup, test, name, sound.ends[j])


def _of_valves(
    checkup: Checkup,
    j: int,
    figures: JointFigures,
    rose: Array,
    stays: NDArray[np.bool_],
    frozen: list[bool],
    name: str,
) -> Iterator[Complaint]:
    spec, test, limit = checkup.spec, checkup.joints[j], checkup.spec.max_pressure
    own = rose.diagonal()
    full = np.array([m.full for m in figures.muscles])
    if (own < MOVED * limit).all():
        yield Complaint("low supply", name, "no muscle fills", "Turn the air on; check the valves' power")
        return
    if (np.maximum(full, own) < LOW_SUPPLY * limit).all():
        detail = f"full muscles reach {full[0]:.2f} and {full[1]:.2f} bar of {limit:.2f}"
        yield Complaint("low supply", name, detail, "Check the reducer, the buffer and the filters")
    for m, muscle in enumerate(figures.muscles):
        where = f"{name}, muscle {m + 1}"
        if frozen[m]:
            continue  # nothing is known of its valves
        if own[m] < MOVED * limit:
            detail = f"it gains {own[m]:.2f} bar when its inlet opens"
            yield Complaint("inlet stuck closed", where, detail, "Check the inlet valve, its wire and its hose")
        elif muscle.full < 0.6 * own[m]:
            detail = f"it keeps {muscle.full:.2f} of {own[m]:.2f} bar when its valves close"
            yield Complaint("exhaust stuck open", where, detail, "Check the exhaust valve; or the muscle has burst")
        elif let_in(test.muscles[1 - m], m, spec) > LET_IN * limit or (muscle.leak < -LEAK and _stands(test, spec)):
            detail = "its pressure rises while its valves are closed"
            yield Complaint(
                "inlet stuck open", where, detail, "Check the inlet valve: it sticks, or its seat is dirty"
            )
        elif stays[m]:
            detail = "its pressure does not fall when its exhaust opens"
            yield Complaint(
                "exhaust stuck closed", where, detail, "Check the exhaust valve, its wire and its silencer"
            )
        elif muscle.leap > max(LEAP * limit, _CLEAR * muscle.noise / checkup.spec.counts_per_bar):
            detail = f"its reading leaps by {muscle.leap:.2f} bar while air flows and drops at once when it stops"
            remedy = "Move the pressure sensor to the far end of the muscle (thesis A.1.1)"
            yield Complaint("pressure at the valve's side", where, detail, remedy)


def _of_leaks(
    checkup: Checkup, figures: JointFigures, name: str, sound: SoundState | None, j: int
) -> Iterator[Complaint]:
    remedy = "Look for the leak with soap water: clamps, hose, exhaust valve"
    for number, muscle in enumerate(figures.muscles, 1):
        if np.isnan(muscle.leak) and muscle.full > FILLED * checkup.spec.max_pressure:
            detail = f"closed, it has lost its {muscle.full:.2f} bar before {checkup.settings.settle:.0f} s are over"
            yield Complaint("leak", f"{name}, muscle {number}", detail, remedy)
    now = np.array([[muscle.leak, muscle.leak_error] for muscle in figures.muscles]).T / 100
    if np.isnan(now).any():
        return
    leaks = (now[0] > LEAK / 100) & (now[0] > _ALIKE * now[0].max())
    then = np.zeros_like(now)
    if sound is not None:
        then = np.array([sound.leak[j], sound.leak_error[j]])
        healthy, found = (LeakRates(rate[None], error[None], np.nan) for rate, error in (then, now))
        leaks |= leaking(healthy, found)[0]
    for m in np.flatnonzero(leaks):
        detail = f"closed, it loses {100 * now[0, m]:.1f} % of its pressure a minute"
        if then[0, m] > _CLEAR * then[1, m]:
            detail = (
                f"it leaks {now[0, m] / then[0, m]:.1f} times as much as when calibrated: "
                f"{detail} instead of {100 * then[0, m]:.1f} %"
            )
        elif sound is not None:
            detail += f", instead of {100 * then[0, m]:.1f} % when calibrated"
        yield Complaint("leak", f"{name}, muscle {m + 1}", detail, remedy)


_ALIKE = 0.5
"""Both muscles leak where one loses more than so many times what the other does; one that only sags because the other
leaks loses less."""


def _of_calibration(
    checkup: Checkup, test: JointTest, name: str, calibrated: tuple[float, float]
) -> Iterator[Complaint]:
    spec = checkup.spec
    vented = spec.bar(test.before.pressure[-10:].mean(axis=0))
    for m in np.flatnonzero(np.abs(vented) > ZERO * spec.max_pressure):
        detail = f"vented, its sensor reads {vented[m]:.2f} bar; the zero has moved, or the spec is of another arm"
        yield Complaint("not as calibrated", f"{name}, muscle {m + 1}", detail, _AGAIN)
    moved = (ends(test) - calibrated) / spec.counts_per_degree
    if np.abs(moved).max() > ENDS:
        detail = (
            f"its ends are {moved[0]:+z.1f} and {moved[1]:+z.1f} degrees from where they were; the potentiometer has "
            "slipped on its axis, the muscles or their mounting have changed, or the spec is of another arm"
        )
        yield Complaint("not as calibrated", name, detail, _AGAIN)


_AGAIN = "Check it, then calibrate again with `pneumarm arm calibrate`"


def _of_sensors(checkup: Checkup, j: int, name: str) -> Iterator[Complaint]:
    test = checkup.joints[j]
    everything = np.concatenate([trace.angle for m in test.muscles for trace in (m.whole, m.pulse)])
    low, high = checkup.spec.angle_range
    if np.ptp(everything) == 0:
        dead = everything[0] <= low or everything[0] >= high
        remedy = "Check the potentiometer's wires" if dead else "Check the potentiometer's axis and its wires"
        detail = f"it reads {everything[0]:.0f} no matter what moves"
        yield Complaint("angle dead" if dead else "angle frozen", name, detail, remedy)
    for m in range(2):
        if _is_frozen(test, m):
            detail = f"it reads {test.rest.pressure[0, m]:.0f} no matter what moves"
            yield Complaint("pressure frozen", f"{name}, muscle {m + 1}", detail, "Check the pressure sensor's wires")


def _of_noise(checkup: Checkup, j: int, name: str) -> Iterator[Complaint]:
    test, spec = checkup.joints[j], checkup.spec
    degree = "degrees", spec.counts_per_degree, NOISY_ANGLE
    bar = "bar", spec.counts_per_bar, NOISY_PRESSURE * spec.max_pressure
    for what, values, (unit, counts, most) in (
        ("angle", test.rest.angle, degree),
        *((f"pressure {m + 1}", test.rest.pressure[:, m], bar) for m in (0, 1)),
    ):
        clean = detrended(test.rest.time, values)
        correlation = autocorrelation(clean)
        worst = int(np.argmax(np.abs(correlation[1:]))) + 1
        unlikely = ljung_box(correlation, len(values)) > _LIKELY
        if unlikely and abs(correlation[worst]) > WHITE:
            detail = f"at rest its readings {worst} apart have a correlation of {correlation[worst]:.2f}"
            remedy = "Look for hum of the mains, a bad ground, or a filter; medians of such readings help little"
            yield Complaint("noise not white", f"{name}, {what}", detail, remedy)
        elif clean.std() > most * counts and not (what == "angle" and len(_worn(test, checkup)[0])):
            detail = f"at rest its readings vary by {clean.std() / counts:.2g} {unit}, independently of each other"
            remedy = "Let the board take the median of more conversions (thesis A.1.3); check ground and shield"
            yield Complaint("noise", f"{name}, {what}", detail, remedy)


_CLEAR = 5.0  # standard deviations of the noise: what stands out of hundreds of readings
_LIKELY = 90.0
"""White noise gives a larger statistic of Ljung and Box once in 10^10 times, with 20 lags."""


def _of_potentiometer(checkup: Checkup, test: JointTest, figures: JointFigures, name: str) -> Iterator[Complaint]:
    emptied = any(np.isnan(muscle.leak) for muscle in figures.muscles)  # while the joint was moved in steps, too
    if not emptied and not np.isnan(figures.halves) and not 1 / LOGARITHMIC < figures.halves < LOGARITHMIC:
        detail = (
            f"the upper half of the pressure difference turns it {figures.halves:.2f} times as far as the lower half"
        )
        remedy = "Put in a linear one, or let `pneumarm arm calibrate` linearise it"
        yield Complaint("angle logarithmic", name, detail, remedy)
    degrees, off = _worn(test, checkup)
    if len(degrees):
        zones = np.split(degrees, np.flatnonzero(np.diff(degrees) > _APART) + 1)
        places = " and ".join(f"{z[0]:.0f}" if len(z) == 1 else f"{z[0]:.0f} to {z[-1]:.0f}" for z in zones)
        detail = f"readings are off by up to {off.max():.1f} degrees at {places} degrees"
        remedy = "Put in a new potentiometer, and mount it so that nothing presses on its axis (thesis A.1.2)"
        yield Complaint("angle worn", name, detail, remedy)


_APART = 6.0  # degrees between two worn zones


def _worn(test: JointTest, checkup: Checkup) -> tuple[Array, Array]:
    """Return worn places of the angle [degrees], and how irregular its readings are at all places [degrees]."""
    places, off = irregularity(test, checkup.spec)
    usual = float(np.median(off)) if len(off) else 0.0  # noise is as wide everywhere
    return places[off > max(WORN, _CLEARLY * usual)], off


_CLEARLY = 3.0  # times as irregular as elsewhere


def _is_frozen(test: JointTest, m: int) -> bool:
    """Return whether the pressure sensor of muscle ``m`` never says anything else."""
    pressures = np.concatenate([trace.pressure[:, m] for o in test.muscles for trace in (o.whole, o.pulse)])
    return bool(np.ptp(pressures) == 0)


def _stands(test: JointTest, spec: ArmSpec) -> bool:
    """Return whether the joint stands still while its muscles rest: where it sags it compresses one of them."""
    angle = spec.degrees(test.rest.angle)
    return bool(abs(angle[-10:].mean() - angle[:10].mean()) < _SAGS)


_SAGS = 3.0  # degrees


def _stays(test: MuscleTest, m: int, checkup: Checkup) -> bool:
    """Return whether muscle ``m`` keeps most of its air while its exhaust is open."""
    held = np.median(test.hold.pressure[:, m])
    least = MOVED * checkup.spec.max_pressure_counts
    return bool(held > least and test.exhaust.pressure[-10:, m].mean() > 0.7 * held)


def _vents_up(test: MuscleTest, m: int, checkup: Checkup) -> bool:
    """Return whether the pressure of muscle ``m`` rises while its exhaust is open."""
    exhaust = test.exhaust
    gained = exhaust.pressure[-10:, m].mean() - exhaust.pressure[0, m]
    return bool(gained > MOVED * checkup.spec.max_pressure_counts)


def _filled_by_venting(test: MuscleTest, m: int, checkup: Checkup) -> bool:
    """Return whether muscle ``m`` holds as much air after its exhaust was opened as after its inlet was.

    Not more: where it is then over the limit the guard keeps its inlet closed, whose wire would vent it. A muscle
    whose inlet is stuck open holds less.
    """
    more = test.exhaust.pressure[-10:, m].mean() - test.fill.pressure[-10:, m].mean()
    return bool(more > -MOVED / 2 * checkup.spec.max_pressure_counts)
