"""The figures that a check-up tells: of muscles and valves, of noise, of potentiometers, of the supply."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.arm.spec_file import SoundState
from pneumarm.checkup.leaks import falling
from pneumarm.checkup.measure import Array, Checkup, JointTest, MuscleTest, Trace

MOVED = 0.10
"""A pressure moved if it changed by so much [of the limit]."""
FILLED = 0.35
"""What the pressure of a filled muscle always rises by [of the limit]. That of a closed one that is stretched or
slackened may do so as well: whether it took air is told when its joint has gone back."""
LAGS = 20
"""Readings apart up to which noise is correlated."""


@dataclass(frozen=True)
class MuscleFigures:
    """What one muscle and its valves do."""

    full: float
    """Pressure when full [bar]."""
    fill_time: float
    """Time from the command until 63 % of that [s]; not a number if it does not fill."""
    exhaust_time: float
    """Time from the command until 37 % of that [s]; not a number if it does not empty."""
    fill_delay: float
    """Time from the command until the pressure begins to rise [s]; not a number where that cannot be told."""
    exhaust_delay: float
    """Time from the command until it begins to fall [s]; not a number where that cannot be told."""
    leak: float
    """Share of the pressure lost by closed valves [% a minute]; not a number if there is none to lose."""
    leak_error: float
    """Standard error of that [% a minute]."""
    turned: float
    """How far filling turned the joint [degrees]."""
    noise: float
    """Standard deviation of the pressure's reading at rest [counts]."""
    leap: float
    """By how much the reading drops at once when a pulse of air has ended [bar]."""


@dataclass(frozen=True)
class JointFigures:
    """What one joint does."""

    muscles: tuple[MuscleFigures, MuscleFigures]
    angle_noise: float
    """Standard deviation of the angle's reading at rest [counts]."""
    lowest: float
    """Lowest angle of the sweep [counts]."""
    highest: float
    """Highest angle of the sweep [counts]."""
    halves: float
    """How many times further the upper half of the pressure difference turns the joint than the lower half."""
    worst: float
    """Largest irregularity of the angle at any place (root mean square) [degrees]."""


def joint_figures(checkup: Checkup, joint: int) -> JointFigures:
    """Return the figures of ``joint``."""
    test = checkup.joints[joint]
    one, two = (_muscle_figures(checkup, test, m) for m in range(2))
    return JointFigures(
        muscles=(one, two),
        angle_noise=float(np.std(detrended(test.rest.time, test.rest.angle))),
        lowest=float(test.sweep.angle.min()),
        highest=float(test.sweep.angle.max()),
        halves=halves(test),
        worst=float(max(irregularity(test, checkup.spec)[1], default=0.0)),
    )


def _muscle_figures(checkup: Checkup, test: JointTest, m: int) -> MuscleFigures:
    bar = checkup.spec.counts_per_bar
    muscle = test.muscles[m]
    fill, hold, exhaust = muscle.fill, muscle.hold, muscle.exhaust
    rise = fill.pressure[:, m] - fill.pressure[0, m]
    full = float(np.median(hold.pressure[:, m]) - fill.pressure[0, m])
    fall = exhaust.pressure[:, m] - exhaust.pressure[-10:, m].mean()
    least = MOVED * checkup.spec.max_pressure_counts
    moved = full > least
    rest = test.rest
    above = rest.pressure[:, m] - test.before.pressure[-10:, m].mean()  # its sensor may not be calibrated
    leak, leak_error = falling(rest.time, above) if above.mean() > least else (np.nan, np.nan)
    pulse = muscle.pulse
    pulsing = pulse[: int(np.searchsorted(pulse.time, muscle.pulsed))]
    fills = [(each.time, each.pressure[:, m]) for each in (fill, pulsing, test.again[m]) if len(each.time) >= _FEWEST]
    return MuscleFigures(
        full=full / bar,
        fill_time=_first(fill.time, rise > 0.63 * full) if moved else float("nan"),
        exhaust_time=_first(exhaust.time - exhaust.time[0], fall < 0.37 * full) if moved else float("nan"),
        fill_delay=onset(fills) if moved else float("nan"),
        exhaust_delay=onset([(exhaust.time - exhaust.time[0], -exhaust.pressure[:, m])]) if moved else float("nan"),
        leak=float(100 * leak),
        leak_error=float(100 * leak_error),
        turned=float(fill.angle[-1] - fill.angle[0]) / checkup.spec.counts_per_degree,
        noise=float(np.std(detrended(rest.time, rest.pressure[:, m]))),
        leap=dropped(pulse.time - muscle.pulsed, pulse.pressure[:, m]) / bar,
    )


def rise(fill: Trace) -> Array:
    """Return how far each pressure rose in a ``fill``, (2,) [counts]."""
    rose: Array = np.quantile(fill.pressure, 0.95, axis=0) - fill.pressure[:3].mean(axis=0)
    return rose


def dropped(time: Array, pressure: Array) -> float:
    """Return by how much a ``pressure`` drops at once when the inlet closes, shortly after 0 s.

    Air that cools, and a muscle that is stretched or goes on shortening, change it slowly: what it was is compared
    with where a straight line through what comes after the drop began.
    """
    drops = [0.0]
    for peak in np.flatnonzero(_window(time, -0.01, 0.04)):
        after = np.flatnonzero(_window(time, time[peak] + _GONE, _SLOWLY))
        if len(after) < _LINE:
            after = np.flatnonzero(time >= time[peak] + _GONE)[:_LINE]
        if len(after) >= _LINE:
            _, began = np.polyfit(time[after] - time[peak], pressure[after], 1)
            drops.append(float(pressure[peak] - began))
    return max(drops)


_GONE = 0.012  # s: when a leap is over (thesis figure A.1: after 10 ms)
_SLOWLY = 0.045  # s: in which nothing else bends much
_LINE = 4  # readings for a straight line


def let_in(other: MuscleTest, m: int, spec: ArmSpec) -> float:
    """Return what the pressure of muscle ``m``, closed, has gained when the ``other`` was filled and vented [bar].

    A joint that turns changes the volume of the closed muscle, and so its pressure: in some arms by nearly half of
    the limit. That goes back with the angle, and what the angle has not gone back (a joint that sticks, or that falls
    over) keeps its share. Air that came in stays.
    """
    filled = len(other.fill.time) + len(other.hold.time)
    pressure, angle = spec.bar(other.whole.pressure[:, m]), spec.degrees(other.whole.angle)
    then = slice(filled - 10, filled), slice(-10, None)
    turned, gone = (angle[end].mean() - angle[:3].mean() for end in then)
    rose, left = (pressure[end].mean() - pressure[:3].mean() for end in then)
    kept = float(np.clip(gone / turned, 0.0, 1.0)) if abs(turned) > _TURNS else 0.0
    return float(left - kept * rose)


_TURNS = 5.0  # degrees: a joint that turns less compresses nothing


def onset(rises: Sequence[tuple[Array, Array]]) -> float:
    """Return after what time [s] values begin to rise, the same in all ``rises``; NaN where readings are too few.

    A rise is times from 0 on [s] and values. Least squares of a level that goes over into a parabola: finer than the
    readings are apart, and without the lateness of a threshold above the noise. What is looked at ends soon after the
    first of the rises is seen by such a threshold.
    """
    if not rises:
        return float("nan")
    least = _BEGUN * max(np.ptp(values) for _, values in rises)
    risen = [float(time[values - values[0] > least][:1].sum()) for time, values in rises]  # 0 where it never has
    until = max(_ONSET, min(filter(None, risen), default=0.0) + _ONSET / 2)
    begins = np.arange(0.0, until - _ONSET / 2, _ONSET / 400)
    left = np.zeros(len(begins))
    for time, values in rises:
        seen = time <= until
        if seen.sum() < _FEWEST:
            return float("nan")
        since = np.maximum(time[seen] - begins[:, None], 0.0) / _ONSET
        basis = np.stack([np.ones_like(since), since, since**2], axis=-1)
        fitted = basis @ (np.linalg.pinv(basis) @ values[seen])[..., None]
        left += ((values[seen] - fitted[..., 0]) ** 2).sum(axis=1)
    return float(begins[np.argmin(left)])


_ONSET = 0.1  # s: what is looked at for the beginning of a rise at least
_BEGUN = 0.1  # of a rise: what is surely more than noise
_FEWEST = 10  # readings that tell it


def ends(test: JointTest) -> Array:
    """Return the angles with muscle 2 full and with muscle 1 full, shape (2,) [counts]."""
    return np.array([np.median(test.muscles[m].hold.angle) for m in (1, 0)])


def quickening(test: JointTest, checkup: Checkup) -> float:
    """Return in what share of the time muscles fill at the end of the check-up; NaN where they do not fill.

    While air is scarce a muscle fills as fast as the supply's pressure says. Both muscles count, because supplies
    fluctuate.
    """
    limit = checkup.spec.max_pressure_counts
    before = [_passage(test.muscles[m].fill, m, limit) for m in range(2)]
    after = [_passage(test.again[m], m, limit) for m in range(2)]
    return float(np.mean(np.array(after) / np.array(before)))


def _passage(fill: Trace, m: int, limit: float) -> float:
    """Return the time [s] in which muscle ``m`` fills between two shares of the ``limit`` [counts]."""
    pressure = np.convolve(fill.pressure[:, m] - fill.pressure[:3, m].mean(), np.full(_SMOOTH, 1 / _SMOOTH), "valid")
    time = fill.time[_SMOOTH // 2 : len(fill.time) - _SMOOTH // 2]
    rising = np.maximum.accumulate(pressure)
    if not len(rising) or rising[-1] < _PASSAGE[1] * limit:
        return float("nan")
    begin, end = np.interp(np.array(_PASSAGE) * limit, rising, time)
    return float(end - begin)


_PASSAGE = (0.1, 0.7)  # shares of the limit: after the first unfolding, before the supply's pressure is near
_SMOOTH = 5  # readings


def _window(time: Array, begin: float, length: float) -> NDArray[np.bool_]:
    return (time >= begin) & (time <= begin + length)


def _first(time: Array, reached: NDArray[np.bool_]) -> float:
    return float(time[np.argmax(reached)]) if reached.any() else float("nan")


def detrended(time: Array, values: Array) -> Array:
    """Return ``values`` without what changes slowly: creep, heat and leak (thesis A.1.3: "we detrend this data").

    Piece by piece: what a muscle that leaks much loses, and how its joint falls, is no polynomial for long.
    """
    pieces = max(1, round((time[-1] - time[0]) / _PIECE))
    clean = np.empty(len(values))
    for piece in np.array_split(np.arange(len(values)), pieces):
        scaled = np.linspace(-1.0, 1.0, len(piece))
        clean[piece] = values[piece] - np.polyval(np.polyfit(scaled, values[piece], 4), scaled)
    return clean


_PIECE = 5.0  # s

_NOTHING = 1e-6
"""A variance below this [counts^2] is that of rounding."""


def autocorrelation(values: Array) -> Array:
    """Return the autocorrelation at lags 0..LAGS; zeros where nothing varies.

    The covariance is the inverse Fourier transform of the power spectrum (thesis A.1.3), zero-padded, so that the end
    of the record does not meet its beginning.
    """
    spectrum = np.abs(np.fft.rfft(values - values.mean(), 2 * len(values))) ** 2
    covariance = np.fft.irfft(spectrum)[: LAGS + 1]
    return covariance / covariance[0] if covariance[0] > _NOTHING * len(values) else np.zeros(LAGS + 1)


def ljung_box(correlation: Array, count: int) -> float:
    """Return the statistic of Ljung and Box of ``count`` values, which is chi-squared with LAGS degrees if white.

    G. M. Ljung and G. E. P. Box, "On a measure of lack of fit in time series models", Biometrika 65, 1978.
    """
    lags = np.arange(1, len(correlation))
    return float(count * (count + 2) * np.sum(correlation[1:] ** 2 / (count - lags)))


def halves(test: JointTest) -> float:
    """Return how many times further the upper half of the pressure difference turns the joint than the lower half.

    Two muscles that are alike turn a joint by the same angle for the same difference either way; weight and unlike
    muscles bend that by a tenth, the track of a logarithmic potentiometer by a factor of three to eight.
    """
    difference = test.sweep.pressure[:, 0] - test.sweep.pressure[:, 1]
    low, high = difference.min(), difference.max()
    reach = 0.8 * min(-low, high)
    if reach <= 0:
        return float("nan")
    turns = []
    n = len(difference) // 2 + 1
    for half in (slice(0, n), slice(n - 1, None)):
        order = np.argsort(difference[half])
        at = np.interp((-reach, 0.0, reach), difference[half][order], test.sweep.angle[half][order])
        turns.append(np.diff(at))
    lower, upper = np.mean(turns, axis=0)
    return float(upper / lower) if lower > 0 and upper > 0 else float("nan")


def irregularity(test: JointTest, spec: ArmSpec) -> tuple[Array, Array]:
    """Return places of the angle [degrees] and how far readings there are off those around them (rms) [degrees].

    A joint has inertia: within a few readings it moves on a parabola. What departs from the parabola at the same
    angle again and again, whatever the movement, is the potentiometer. A few, because a light joint that bounces off
    its end stop is on no parabola for longer than that. Readings that are not as far apart in time as their
    neighbours tell nothing: one movement's last is the next one's first.
    """
    places, offs = [], []
    for trace in [piece for muscle in test.muscles for piece in (muscle.whole, muscle.pulse)]:
        angle = spec.degrees(trace.angle)
        if len(angle) < 2 * _AROUND + 1:
            continue
        around = np.lib.stride_tricks.sliding_window_view(angle, 2 * _AROUND + 1)
        steps = np.lib.stride_tricks.sliding_window_view(np.diff(trace.time), 2 * _AROUND)
        even = steps.min(axis=1) > 0.5 * steps.max(axis=1)
        places.append(np.median(around, axis=1)[even])
        offs.append((angle[_AROUND:-_AROUND] - around @ _PARABOLA)[even])
    place, off = np.concatenate(places), np.concatenate(offs)
    bins = np.floor(place / _PLACE).astype(int)
    found = [(b, off[bins == b]) for b in np.unique(bins)]
    kept = [(b, values) for b, values in found if len(values) >= 3]
    centres = np.array([(b + 0.5) * _PLACE for b, _ in kept])
    return centres, np.array([float(np.sqrt(np.mean(values**2))) for _, values in kept])


_PLACE = 1.0
"""How wide a place of the angle is [degrees]."""
_AROUND = 3
"""Readings either side that a parabola is fitted to, without the one in the middle."""


def _parabola() -> Array:
    """Return the weights that give a parabola's value in the middle of 2 * _AROUND + 1 readings."""
    x = np.arange(-_AROUND, _AROUND + 1.0)
    outer = x != 0
    weights = np.zeros(len(x))
    weights[outer] = np.linalg.pinv(np.vander(x[outer], 3, increasing=True))[0]
    return weights


_PARABOLA = _parabola()


MUSCLE_HEADER = (
    "full [bar]",
    "filling begins [ms]",
    "fills in [ms]",
    "emptying begins [ms]",
    "empties in [ms]",
    "leak [%/min]",
    "when calibrated [%/min]",
    "turns by [°]",
    "noise [counts]",
    "drop [bar]",
)
"""What :func:`muscle_row` gives."""
MUSCLE_WORDS = (
    "Times are from the command: to the first air, and to 63 % of the way. The drop is what the reading loses at "
    "once when a pulse of air has ended."
)
"""What that means."""


def muscle_row(figures: JointFigures, joint: int, muscle: int, sound: SoundState | None) -> tuple[str, ...]:
    """Return the figures of a muscle as words for a table."""
    one = figures.muscles[muscle]
    times = (one.fill_delay, one.fill_time, one.exhaust_delay, one.exhaust_time)
    return (
        _told(one.full, ".2f"),
        *(_told(1e3 * time, ".0f") for time in times),
        _NONE if np.isnan(one.leak) else f"{_told(one.leak, '.2f')}\u00a0±\u00a0{one.leak_error:.2f}",
        _NONE if sound is None else _told(100 * sound.leak[joint][muscle], ".2f"),
        _told(one.turned, ".0f"),
        _told(one.noise, ".2f"),
        _told(one.leap, ".2f"),
    )


def _told(value: float, form: str) -> str:
    """Return ``value`` for people: with a minus, not a hyphen, and a dash where it is not known."""
    return _NONE if np.isnan(value) else format(value, f"z{form}").replace("-", "−")


_NONE = "–"

JOINT_HEADER = ("lowest [°]", "highest [°]", "upper : lower half", "irregular by [°]", "noise [counts]")
"""What :func:`joint_row` gives."""
JOINT_WORDS = (
    "By a slow sweep. Upper : lower half is how many times as far the upper half of the sweep turns the joint as the "
    "lower half does; irregular by is the largest error of the potentiometer at any place."
)
"""What that means."""


def joint_row(figures: JointFigures, spec: ArmSpec) -> tuple[str, ...]:
    """Return the figures of a joint as words for a table."""
    lowest, highest = spec.degrees([figures.lowest, figures.highest])
    return (
        _told(lowest, ".0f"),
        _told(highest, ".0f"),
        _told(figures.halves, ".2f"),
        _told(figures.worst, ".2f"),
        _told(figures.angle_noise, ".2f"),
    )
