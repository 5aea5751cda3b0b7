"""What a check-up says of an arm, as the spec, corrections and sound that everything else works with.

A logarithmic potentiometer is linearised by the symmetry of the joint. Its track turns the true share x of the way
into the share (e^(k x) - 1) / (e^k - 1) of the counts; k is what makes the two halves of the sweep turn the joint
equally far for equal differences of pressure. What then remains beside an odd cubic of that difference is the
residual: a joint whose residual is large is refused, not bent straight.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from msgspec import Meta

from pneumarm.arm.spec_file import ArmFile, SensorCorrection, SoundState
from pneumarm.checkup.diagnose import LOGARITHMIC
from pneumarm.checkup.figures import ends, halves, joint_figures
from pneumarm.checkup.measure import Array, Checkup, JointTest
from pneumarm.errors import UnusableInput
from pneumarm.settings import PositiveFloat, Settings, Valid

POINTS = 17
"""Points of a linearisation table."""
WORST_RESIDUAL = 2.5
"""Largest residual of a linearised potentiometer [degrees]."""
_CURVATURES = (-12.0, 12.0)
"""Range in which k is sought; an audio potentiometer has about 4."""
_LEAST_SWEEP = 0.05  # of the sensor's range
_ROUNDING = 0.01  # counts
_STEADY = 0.02  # a muscle is full when its pressure rises by less than this share in the last 0.2 s
_REACTION = 2.0  # a period must be so many times the 99th percentile of setting and reading


@dataclass(frozen=True)
class Known(Settings):
    """What only a person can say of an arm."""

    angles: tuple[tuple[float, float], ...] = ()
    """Angles with muscle 2 full and with muscle 1 full, by a protractor [degrees]; for all joints, or for each."""
    counts_per_degree: PositiveFloat | None = None
    """... or what the angle's sensors count, by their data sheet; where both are missing the spec's scale stays."""
    supply: Annotated[float, Meta(ge=0.1, le=10)] | None = None
    """Pressure of the supply by its manometer, which full muscles reach [bar gauge]."""
    counts_per_bar: PositiveFloat | None = None
    """... or what the pressure sensors count, by their data sheet; where both are missing the spec's scale stays."""

    def _valid(self) -> Valid:
        both = {
            "counts_per_degree": self.counts_per_degree is not None and self.angles and "angles",
            "counts_per_bar": self.counts_per_bar is not None and self.supply and "supply",
        }
        return {
            "angles": all(low < high for low, high in self.angles) or "a lower and a higher one in degrees",
            **{name: not other or f"{other} or this, not both" for name, other in both.items()},
        }


@dataclass(frozen=True)
class ArmCalibration:
    """What came of it."""

    file: ArmFile
    residual: tuple[float | None, ...]
    """For each joint what a linearised potentiometer leaves [degrees]; None where nothing was to linearise."""


def calibrate(checkup: Checkup, known: Known = Known()) -> ArmCalibration:
    """Return spec, corrections and sound of the arm that was checked with its sensors raw.

    Raises:
        UnusableInput: the arm cannot be calibrated like this; what it needs first is said.

    """
    spec = checkup.spec
    lines = [_linearised(checkup, j) for j in range(len(checkup.joints))]
    at_ends = np.array([line.ends for line in lines])
    if (np.diff(at_ends) < _LEAST_SWEEP * np.diff(spec.angle_range)).any():
        raise UnusableInput(f"{spec.name}: its angle hardly moves; run `pneumarm arm check` and mend what it finds")
    per_degree, angle_range = spec.counts_per_degree, spec.angle_range
    # By joint where its 0 degrees are, where they go, and how angles are stretched.
    scales = [(0.0, 0.0, 1.0)] * len(lines)
    if known.counts_per_degree is not None:
        per_degree = known.counts_per_degree
    if known.angles:
        if len(known.angles) not in (1, len(lines)):
            raise UnusableInput(f"{spec.name}: give the angles once, or once for each of its {len(lines)} joints")
        degrees = np.broadcast_to(known.angles, at_ends.shape)
        each = np.diff(at_ends)[:, 0] / np.diff(degrees)[:, 0]
        zeros = at_ends[:, 0] - degrees[:, 0] * each
        per_degree, middle = float(each.mean()), float(zeros.mean())
        reach = max(middle - spec.angle_range[0], spec.angle_range[1] - middle)
        angle_range = (middle - reach, middle + reach)
        scales = [(float(z), middle, per_degree / float(e)) for z, e in zip(zeros, each, strict=True)]
    at_rest, per_bar = _pressures(checkup, known)
    mean_per_bar = float(per_bar.mean())
    raw = np.linspace(*spec.angle_range, POINTS)
    true = [
        middle + stretch * (straightened(raw, line.curvature, *spec.angle_range) - zero)
        for line, (zero, middle, stretch) in zip(lines, scales, strict=True)
    ]
    straight = np.allclose(true, raw, atol=_ROUNDING)
    correction = SensorCorrection(
        pressure_zero=_pairs(at_rest),
        pressure_gain=_pairs(mean_per_bar / per_bar),
        angle_raw=() if straight else (tuple(raw.tolist()),) * len(lines),
        angle_true=() if straight else tuple(tuple(np.round(t, 3).tolist()) for t in true),
    )
    needed = _REACTION * float(np.quantile(checkup.timing.set_and_read, 0.99))
    period = max(spec.period, math.ceil(1e3 * needed) / 1e3)
    calibrated = replace(
        spec, counts_per_degree=per_degree, counts_per_bar=mean_per_bar, angle_range=angle_range, period=period
    )
    file = ArmFile(calibrated, correction, _sound_state(checkup, correction))
    return ArmCalibration(file, tuple(line.residual for line in lines))


def _sound_state(checkup: Checkup, correction: SensorCorrection) -> SoundState | None:
    """Return what the arm did, with its sensors corrected; None where its muscles hold no air to lose."""
    muscles = [joint_figures(checkup, j).muscles for j in range(len(checkup.joints))]
    leak, error = (np.array([[getattr(m, name) / 100 for m in pair] for pair in muscles]) for name in _LEAKS)
    if np.isnan(leak).any():
        return None
    raw = np.array([ends(test) for test in checkup.joints])
    true = np.stack([correction.angle(at) for at in raw.T], axis=1)
    return SoundState(_pairs(leak, 6), _pairs(error, 6), _pairs(true))


_LEAKS = ("leak", "leak_error")


def _pairs(values: Array, digits: int = 4) -> tuple[tuple[float, float], ...]:
    return tuple((round(float(a), digits), round(float(b), digits)) for a, b in values)


def _pressures(checkup: Checkup, known: Known) -> tuple[Array, Array]:
    """Return what each sensor reads at atmosphere [counts] and its counts per bar, both (joints, 2)."""
    zero, full = (np.zeros((len(checkup.joints), 2)) for _ in range(2))
    for j, test in enumerate(checkup.joints):
        for m in range(2):
            fill = test.muscles[m].fill
            zero[j, m] = test.before.pressure[-10:, m].mean()
            late = fill.time > fill.time[-1] - 0.2
            end = fill.pressure[late, m]
            full[j, m] = np.median(end[-10:])
            rising = np.median(end[-10:]) - np.median(end[:10]) > _STEADY * (full[j, m] - zero[j, m])
            stopped = full[j, m] >= checkup.spec.max_pressure_counts
            if known.supply is not None and (rising or stopped):
                why = "is cut off at the pressure limit" if stopped else "still rises when its time is over"
                raise UnusableInput(
                    f"{checkup.spec.name}: joint {j + 1}, muscle {m + 1} {why}, and does not show the supply's "
                    "pressure; turn the reducer down, or fill longer (--measure.fill), or give --counts-per-bar"
                )
    if known.supply is None:
        return zero, np.full_like(zero, known.counts_per_bar or checkup.spec.counts_per_bar)
    if (full - zero <= 0).any():
        raise UnusableInput(f"{checkup.spec.name}: a muscle does not fill; run `pneumarm arm check`")
    return zero, (full - zero) / known.supply


@dataclass(frozen=True)
class _Line:
    """How a joint's potentiometer is put right."""

    ends: Array
    """Linearised angles with muscle 2 full and with muscle 1 full, shape (2,) [counts]."""
    curvature: float
    residual: float | None


def _linearised(checkup: Checkup, j: int) -> _Line:
    test, spec = checkup.joints[j], checkup.spec
    ratio = halves(test)
    at_ends = ends(test)
    if math.isnan(ratio):
        raise UnusableInput(
            f"{spec.name}: joint {j + 1} does not turn as its pressures say; run `pneumarm arm check` and mend it"
        )
    if 1 / LOGARITHMIC < ratio < LOGARITHMIC:
        return _Line(at_ends, 0.0, None)
    low, high = spec.angle_range
    curvature = _curvature(test, low, high)
    angle = straightened(test.sweep.angle, curvature, low, high)
    residual = asymmetry(test, angle) / spec.counts_per_degree
    if residual > WORST_RESIDUAL:
        raise UnusableInput(
            f"{spec.name}: the potentiometer of joint {j + 1} is not linear, and linearised as a logarithmic one "
            f"it is still off by {residual:.1f} degrees; put in a linear one"
        )
    return _Line(straightened(at_ends, curvature, low, high), curvature, residual)


def straightened(raw: Array, curvature: float, low: float, high: float) -> Array:
    """Return what a linear track reads where one of ``curvature`` k reads ``raw`` [counts] in ``low`` to ``high``."""
    share = np.clip((raw - low) / (high - low), 0.0, 1.0)
    if abs(curvature) < 1e-6:
        return low + share * (high - low)
    return low + (high - low) * np.log1p(share * math.expm1(curvature)) / curvature


def _curvature(test: JointTest, low: float, high: float) -> float:
    """Return the k with which both halves of the sweep turn the joint equally far, by bisection."""
    below, above = _CURVATURES
    for _ in range(50):
        middle = (below + above) / 2
        sweep = replace(test.sweep, angle=straightened(test.sweep.angle, middle, low, high))
        if halves(replace(test, sweep=sweep)) > 1:
            below = middle
        else:
            above = middle
    return (below + above) / 2


def asymmetry(test: JointTest, angle: Array) -> float:
    """Return how far ``angle`` of the sweep is off an odd cubic of the pressure difference (rms) [counts].

    The way up and the way down have a constant of their own each: dry friction holds the joint back.
    """
    difference = test.sweep.pressure[:, 0] - test.sweep.pressure[:, 1]
    scaled = difference / np.abs(difference).max()
    up = np.arange(len(scaled)) <= len(scaled) // 2
    basis = np.stack([up, ~up, scaled, scaled**3], axis=1).astype(float)
    fitted = basis @ np.linalg.lstsq(basis, angle, rcond=None)[0]
    return float(np.sqrt(np.mean((angle - fitted) ** 2)))
