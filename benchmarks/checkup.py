"""How far healthy arms are from every limit of the check-up, and how many faults it finds on how many arms.

Limits were chosen on arms 1 to 10 and two rules mended after a look at 11 to 20; arms 21 to 30 verify them.
PNEUMARM_CHECKUP_ARMS takes others, as 1-10.

python -m benchmarks checkup
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from benchmarks import _environment as environment
from pneumarm.arm.corrected import CorrectedArm
from pneumarm.arm.spec_file import SoundState
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.arm.virtual.faults import (
    DeadPotentiometer,
    Fault,
    FrozenPotentiometer,
    Leak,
    LogarithmicPotentiometer,
    ReducerLeak,
    SensorNoise,
    StuckValve,
    SupplyLoss,
    SwappedMuscles,
    SwappedValves,
    ValveSideSensor,
    WornPotentiometer,
)
from pneumarm.checkup import Checkup, calibrate, diagnose, ends, joint_figures, quickening
from pneumarm.checkup import measure as check_up
from pneumarm.checkup.diagnose import ENDS, HIGH_SUPPLY, LEAK, LEAP, LOGARITHMIC, RISING, WORN

ARMS = "21-30"
NOISES = 3
"""Check-ups of each healthy arm, with other noise, each raw and again as it was calibrated."""
NIGHT = 12 * 3600.0
"""Time that a healthy arm rests between check-ups [s]."""
IDLE = 3600.0
"""Time that nobody uses air [s]: a buffer behind a leaking reducer then is at 5.9 bar."""


class Case(NamedTuple):
    """A fault and what the check-up calls it."""

    told: str
    fault: Callable[[int], Fault]
    """What is wrong with muscle 1 or 2."""
    before: float = 0.0
    """Time that it has lasted before the check-up [s]."""
    calibrated: bool = False
    """Whether the arm was calibrated when it was healthy."""


CASES = {
    "muscles swapped": Case("muscles swapped", lambda m: SwappedMuscles()),
    "valves swapped": Case("valves swapped", lambda m: SwappedValves(muscle=m)),
    "inlet stuck closed": Case("inlet stuck closed", lambda m: StuckValve(muscle=m)),
    "inlet stuck open": Case("inlet stuck open", lambda m: StuckValve(muscle=m, position="open")),
    "exhaust stuck closed": Case("exhaust stuck closed", lambda m: StuckValve(muscle=m, valve="outlet")),
    "exhaust stuck open": Case("exhaust stuck open", lambda m: StuckValve(muscle=m, valve="outlet", position="open")),
    "supply of 0.6 bar": Case("low supply", lambda m: SupplyLoss(to=0.6, over=0.0)),
    "no supply": Case("low supply", lambda m: SupplyLoss(to=0.0, over=0.0)),
    "reducer's creep, from now on": Case("rising supply", lambda m: ReducerLeak()),
    "reducer's creep to 6 bar, an hour ago": Case("high supply", lambda m: ReducerLeak(), before=IDLE),
    "leak, 40 times": Case("leak", lambda m: Leak(muscle=m, factor=40.0)),
    "leak, 3 times, calibrated": Case("leak", lambda m: Leak(muscle=m, factor=3.0), calibrated=True),
    "potentiometer dead": Case("angle dead", lambda m: DeadPotentiometer(rail="low" if m == 1 else "high")),
    "potentiometer frozen": Case("angle frozen", lambda m: FrozenPotentiometer()),
    "potentiometer logarithmic": Case("angle logarithmic", lambda m: LogarithmicPotentiometer()),
    "potentiometer worn at 10 degrees": Case("angle worn", lambda m: WornPotentiometer(angle=10.0)),
    "sensor at the valve's side": Case("pressure at the valve's side", lambda m: ValveSideSensor(muscle=m)),
    "noise": Case("noise", lambda m: SensorNoise(angle=8.0, pressure=8.0)),
}
"""Faults by what is said of them here."""


OF_MUSCLES = (
    "valves swapped",
    "inlet stuck closed",
    "inlet stuck open",
    "exhaust stuck closed",
    "exhaust stuck open",
    "leak",
    "pressure at the valve's side",
)
"""What is said of one muscle of a joint, not of all of it."""


def played(case: Case, arm: int) -> tuple[Checkup, SoundState | None]:
    """Return the check-up of ``arm`` with a fault, on muscle 1 of even and 2 of odd arms, and its sound state."""
    opened = VirtualArm(draw_parameters(arm), seed=arm)
    seen, sound = opened, None
    if case.calibrated:
        known = calibrate(check_up(opened)).file
        seen, sound = CorrectedArm(opened, known), known.sound
    opened.faults = (case.fault(1 + arm % 2),)
    opened.wait(case.before)
    return check_up(seen), sound


def complaints_of(case: Case, arm: int) -> set[str]:
    """Return what is said of ``arm``; a fault of a muscle counts only if it is said of the right one."""
    place = f"muscle {1 + arm % 2}" if case.told in OF_MUSCLES else "joint"
    return {f.kind if place in f.where else f"{f.kind} elsewhere" for f in diagnose(*played(case, arm))}


def measure() -> Iterator[str]:
    """Yield lines with what was found on healthy arms, and then on faulty ones."""
    arms = environment.seeds("PNEUMARM_CHECKUP_ARMS", ARMS)
    complaints, later, figures = 0, 0, []
    for arm in arms:
        known = calibrate(check_up(VirtualArm(draw_parameters(arm), seed=arm))).file
        for noise in range(NOISES):
            opened = VirtualArm(draw_parameters(arm), seed=1000 * (noise + 1) + arm)
            checkup = check_up(opened)
            complaints += bool(diagnose(checkup))
            figures.append(_extremes(checkup))
            opened.wait(noise * NIGHT)
            again = check_up(CorrectedArm(opened, known))
            later += bool(diagnose(again, known.sound))
            moved = (ends(again.joints[0]) - known.sound.ends[0]) / known.spec.counts_per_degree
            figures[-1]["ends moved [degrees]"] = float(np.abs(moved).max())
    count = len(arms) * NOISES
    which = f"arms {arms[0]} to {arms[-1]}"
    yield f"{which}, healthy: {complaints} of {count} complained of, calibrated {later} of {count}"
    limits = (LEAK, HIGH_SUPPLY, LEAP, LOGARITHMIC, WORN, -RISING, ENDS)
    for name, limit in zip(figures[0], limits, strict=True):
        worst = max(np.sign(limit) * each[name] for each in figures)
        yield f"  worst {name}: {abs(worst):.3g}, limit {abs(limit):g}"
    for name, case in CASES.items():
        kinds = [complaints_of(case, arm) for arm in arms]
        found, alone = sum(case.told in k for k in kinds), sum(k == {case.told} for k in kinds)
        others = sorted(set().union(*kinds) - {case.told})
        besides = f" (besides: {', '.join(others)})" if others else ""
        yield f"{name}: found on {found} of {len(kinds)} arms, and nothing else on {alone}{besides}"


def _extremes(checkup: Checkup) -> dict[str, float]:
    """Return what comes nearest to the limits on an arm of one joint."""
    figures = joint_figures(checkup, 0)
    return {
        "leak [%/min]": max(m.leak for m in figures.muscles),
        "full muscle [of the limit]": max(m.full for m in figures.muscles) / checkup.spec.max_pressure,
        "leap [of the limit]": max(m.leap for m in figures.muscles) / checkup.spec.max_pressure,
        "halves": max(figures.halves, 1 / figures.halves),
        "irregularity [degrees]": figures.worst,
        "fill time at the end [of that before]": quickening(checkup.joints[0], checkup),
    }
