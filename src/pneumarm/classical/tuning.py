"""Tuning on the arm itself: calibrate, then try gains on movements and go on from the better ones.

What gains cost is measured as it will be used: for a movement the time until it has settled within a degree and
within two, the rest error, the overshoot and the valve changes; for sinusoids the error. Candidates come from a
covariance matrix adaptation (:mod:`pneumarm.classical.search`); one that is clearly worse than the best after a few
movements is broken off. In the end the best few are measured again on movements that none was chosen by.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, GuardedArm, guarded
from pneumarm.arm.reference import Reference
from pneumarm.classical.calibration import calibration_seconds, measure_calibration
from pneumarm.classical.following import CommonGains
from pneumarm.classical.ranges import RANGES, Range
from pneumarm.classical.search import Evolution
from pneumarm.classical.tuned import KINDS, Tuned
from pneumarm.errors import UnusableInput
from pneumarm.moving import Moved, MoveSettings, at_period, move, track
from pneumarm.progress import Report
from pneumarm.settings import Settings, Valid
from pneumarm.task.reference import parse_reference

_STEP = 0.05
"""Standard deviation of the first candidates, in units of a gain's range."""
_HOLD = 1.2
"""For how long a goal is held while tuning [s]."""
_PLACES = (0.1, 0.62, 0.33, 0.9, 0.45, 0.5)
"""Places of the goals within the range, in order; each is moved a little for every generation."""
_SINES = (0.5, 1.0)
"""Frequencies that are followed [Hz]."""
_SINE_SECONDS = 2.0
_TRIAL = len(_PLACES) * _HOLD + len(_SINES) * _SINE_SECONDS
"""Arm time of one trial [s]."""
_AMPLITUDE = 20.0
"""Amplitude of the sinusoids, as far as the arm reaches [degrees]."""
_SETTLED = ((1.0, 1.0), (2.2, 0.5))
"""Within how many degrees a movement is to settle, and what a second until then counts as."""
_REST = 0.6
"""What a degree of rest error counts as [s]."""
_OVERSHOOT = 0.02
"""What a degree of overshoot counts as [s]."""
_CHANGE = 0.002
"""What a change of a valve counts as [s]."""
_FOLLOWING = 0.06
"""What a degree of error in following a sinusoid counts as [s]."""
_BREAK_OFF = 1.35
"""A candidate is broken off when it has cost so many times what the best had by then ..."""
_PATIENCE = 3
"""... after so many movements."""
_FINALISTS = 4
_FINAL_SHARE = 0.2
"""Share of the arm time that is left for measuring the best again."""


@dataclass(frozen=True)
class TuneSettings(Settings):
    """How a controller is tuned."""

    seconds: Annotated[float, Meta(gt=0, le=10_000_000)] = 1200.0
    """Arm time [s]; calibration takes some 150 of them a joint."""
    rate: float = 0.0
    """Control periods a second [Hz]; 0: as the arm's spec says."""
    whole_periods: bool = False
    """Set valves for whole periods, also on an arm that can do pulses."""

    def _valid(self) -> Valid:
        return {"rate": self.rate == 0 or 1 <= self.rate <= 2000 or "1 to 2000 Hz, or 0 for that of the arm"}


def require_time(spec: ArmSpec, settings: TuneSettings) -> None:
    """Raise UnusableInput where the time is not enough to calibrate an arm and to measure once how its gains do."""
    least = 10 * math.ceil((1.05 * calibration_seconds(spec) + 2 * _TRIAL) / 10)
    if settings.seconds < least:
        raise UnusableInput(
            f"seconds cannot be {settings.seconds:g}: calibrating {spec.name} and measuring once how it moves needs "
            f"{least} s of its time, trying gains twice that and more; give {least} or more (1200 by default)"
        )


def tune(
    kind: str, arm: Arm, settings: TuneSettings = TuneSettings(), seed: int = 0, report: Report | None = None
) -> Tuned:
    """Return a controller of ``kind`` tuned on ``arm``, as it was opened.

    Where the time is not enough to try any gains, the calibrated controller has those that it begins with; commands
    refuse that, see :func:`require_time`.

    Raises:
        UnusableInput: there is no such kind, or the arm has one muscle a joint.
        ArmFailure: the arm does not answer to its valves.

    """
    if kind not in KINDS:
        raise UnusableInput(f"controller {kind!r}: expected one of {', '.join(KINDS)}")
    arm.spec.require_pairs("classical controllers balance two; train an agent (`pneumarm run`), which needs one")
    if settings.rate:
        at_period(arm, 1 / settings.rate)
    guard = guarded(arm)
    begin = guard.read().time

    def passed() -> float:
        return guard.read().time - begin

    def tell(*_: float) -> None:
        if report is not None:
            report(min(passed(), settings.seconds), settings.seconds)

    calibration = measure_calibration(guard, tell)
    pulses = KINDS[kind].pulses and arm.spec.pulses and not settings.whole_periods
    shortest = arm.spec.shortest_pulse if pulses else None
    space = RANGES[kind]
    start = Tuned(kind, arm.spec, calibration, KINDS[kind].gains(), shortest, 0.0, np.inf)
    trials = _Trials(guard, start, space, lambda: settings.seconds - passed(), tell)
    found = _searched(trials, space.begin, np.random.default_rng(seed))
    return replace(found, seconds=passed())


def _searched(trials: "_Trials", begin: NDArray[np.float64], random: np.random.Generator) -> Tuned:
    """Return the best that there is time to find from the point ``begin`` on."""
    search = Evolution(begin, _STEP, random)
    everything = trials.left()
    tried: list[tuple[float, NDArray[np.float64]]] = []
    while trials.left() - trials.seconds * search.population > _FINAL_SHARE * everything:
        goals = trials.goals(random)
        points = [np.clip(point, 0.0, 1.0) for point in search.ask()]
        costs = trials.measure(points, goals)
        search.tell(points, costs)
        tried += zip(costs, points, strict=True)
    finalists = [np.clip(search.mean, 0.0, 1.0), begin]
    finalists += [point for _, point in sorted(tried, key=lambda one: one[0])[: _FINALISTS - 1]]
    totals = np.zeros(len(finalists))
    rounds = 0
    while trials.left() > trials.seconds * len(finalists):
        totals += trials.measure(finalists, trials.goals(random), whole=True)
        rounds += 1
    best = int(np.argmin(totals))
    cost = float(totals[best] / rounds) if rounds else np.inf
    return replace(trials.start, gains=trials.gains(finalists[best]), cost=cost if np.isfinite(cost) else -1.0)


class _Trials:
    """Tries gains on the arm."""

    def __init__(
        self, guard: GuardedArm, start: Tuned, space: "Range", left: Callable[[], float], tell: Callable[[], None]
    ) -> None:
        self.guard, self.start, self._space, self.left, self._tell = guard, start, space, left, tell
        self.seconds = _TRIAL
        """Arm time of one trial [s]."""
        self._low, self._high = start.goal_range.T
        self._sines = [self._sine(frequency) for frequency in _SINES]

    def goals(self, random: np.random.Generator) -> NDArray[np.float64]:
        """Return goals of a trial, shape (n, joints) [counts], mirrored at random; the last is the middle."""
        shape = (len(_PLACES), len(self._low))
        places = np.array(_PLACES)[:, None] + random.uniform(-0.08, 0.08, shape)
        places = np.where(random.uniform(size=len(self._low)) < 0.5, places, 1 - places)
        places[-1] = 0.5
        return self._low + places * (self._high - self._low)

    def gains(self, point: NDArray[np.float64]) -> CommonGains:
        """Return the gains at a ``point`` of the search."""
        return self._space.gains(self.start.gains, point)

    def measure(
        self, points: Sequence[NDArray[np.float64]], goals: NDArray[np.float64], whole: bool = False
    ) -> list[float]:
        """Return what each of the ``points`` costs with the same ``goals``, poor ones broken off unless ``whole``."""
        best: list[float] = []
        costs = []
        for point in points:
            running: list[float] = []
            for cost in self._costs(point, goals):
                running.append(cost + (running[-1] if running else 0.0))
                done = len(running)
                if not whole and best and done >= _PATIENCE and running[-1] > _BREAK_OFF * best[done - 1]:
                    # As if it went on as badly against the best.
                    running.append(running[-1] / best[done - 1] * best[-1])
                    break
            else:
                best = running if not best or running[-1] < best[-1] else best
            costs.append(running[-1] / len(_PLACES))
            self._tell()
        return costs

    def _costs(self, point: NDArray[np.float64], goals: NDArray[np.float64]) -> Iterator[float]:
        """Yield what each movement and each sinusoid costs [s]."""
        controller = replace(self.start, gains=self.gains(point)).controller()
        for one in move(self.guard, controller, goals, MoveSettings(hold=_HOLD, tries=1)):
            yield cost_of(one, self.guard.spec.counts_per_degree)
        for sine in self._sines:
            followed = track(self.guard, controller, sine, _SINE_SECONDS, lead_in=0.0)
            yield _FOLLOWING * len(_PLACES) * float(followed.rms_error.mean()) + _CHANGE * followed.switches

    def _sine(self, frequency: float) -> Reference:
        spec = self.guard.spec
        reach = np.minimum(self._high - sum(spec.angle_range) / 2, sum(spec.angle_range) / 2 - self._low)
        amplitudes = np.clip(0.8 * reach / spec.counts_per_degree, 1.0, _AMPLITUDE)
        return parse_reference(f"sine:{frequency}Hz,{','.join(f'{one:.2f}' for one in amplitudes)}", spec)


def cost_of(moved: Moved, counts_per_degree: float) -> float:
    """Return what a movement cost [s]."""
    recorded = moved.recorded
    time = recorded.time - recorded.time[0]
    error = np.abs(recorded.angle - moved.goal).max(axis=1) / counts_per_degree
    cost = 0.0
    for tolerance, weight in _SETTLED:
        outside = np.flatnonzero(error > tolerance)
        cost += weight * (float(time[outside[-1]]) if len(outside) else 0.0)
    resting = error[time > time[-1] - _HOLD / 3]
    cost += _REST * float(resting.mean()) + _OVERSHOOT * float(moved.overshoot.mean())
    return cost + _CHANGE * moved.switches
