"""A joint that is to stay at a goal: when it is nearly at rest there, and what moves it then."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.kernels import kernel
from pneumarm.learning.servo.commands import NEAR
from pneumarm.learning.servo.foresight import Foresight
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.servo.two_ways import TwoWays
from pneumarm.simulation.simulation import Simulation

_LOOK = 0.134, 0.4  # s over which readings are averaged where the arm is nearly at rest: at least, at most
_SURE = 0.065  # tolerances of noise that may be left in that average
_ANSWERED = 3.0  # as many times the noise that is left is an error
_SWINGS = 3  # from one side of the goal to the other, after which the joint swings
_DAMPED = 0.7  # tolerances that a joint is hoped to be off by where it swings and goes on being damped ...
_ACTIVE, _ACTIVE_WHOLE = 0.4, 0.7  # ... and where its policy acts in every period; where valves know no shorter ones
_COUNTS_WHOLE = 1.5  # most tolerances of an error that count there: one late arrival says nothing of rest
_SWING, _FAR_SWING = 0.5, 4.0  # tolerances to either side that count as one, where noise is no larger; one muscle
_EMPTY = 0.03  # of the range of pressures: a muscle with less has nothing to let out
_STILL = 0.3  # tolerances that the average of half of them may differ from that of the other half
_SLOWLY, _EASY = 0.234, 1.2  # or that all readings for so long [s] differ by besides, as a share of the error
_FORESEEN = 0.3  # s in which a joint that is at rest hardly moves, by its simulation or by its readings
_STAYS, _STAYS_NOISE = 0.3, 3.0  # tolerances and noises of a reading by which it does, by the simulation ...
_SEEN_STILL, _SEEN_STILL_NOISE = 0.5, 3.5  # ... and by the readings
_SHARES = np.array([0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1])  # of a pulse that are tried
_AFTER = 0.1, 0.9  # s after a pulse in which the joint is to be at its goal ...
_WANTED, _BESIDES = 0.8, 0.5  # ... by that share of its error, and that of what the integral adds
_WAITED = 0.35  # s in which the readings of a joint with one muscle hardly differ, for it to come to rest
_STEADY, _NOISY = 0.3, 1.5  # their standard deviation in tolerances, besides so many times the variance of the noise
_COARSE = 3.0  # tolerances of an arm without pulses to one, since a whole period moves it by degrees
_LEAVING = 1.5, 2.5  # as many times the error and the drift of coming to rest end it
_BIASED = 8.0  # most tolerances that the integral adds to what is asked for
_DONE = 0.7  # share of an error that pulses of a joint with one muscle may leave, for the next not to be more
_SWINGING = 0.6  # s in which an error is added to what is asked for while a joint swings near its goal
_CLOSE, _KEPT = 2.5, 1.2  # tolerances of an error, for that, and most that is then added
_KNOWN = 4  # numbers that are learned of a joint
_ARRIVED = 0.5  # s after a joint was first near its goal, from which on it is noted how near it stays
_FARTHER = 4.0  # most that is added where the policy acts in every period
_COUNTED, _MORE = 2.0, 4.0  # of a joint with one muscle: most tolerances of an error that count, most that is added
_INTEGRAL = 0.5  # share of the mean error that is added to what is asked for, after every look


@kernel
def look_back(readings, look, mean, drift):  # type: ignore[no-untyped-def]
    """Set the ``mean`` (joints,) of the last ``look`` readings (n, joints), and how far that of each half differs.

    Where there are fewer readings their halves are taken. Loops, as NumPy takes ten times as long for so few numbers.
    """
    n, half = min(look, len(readings)), look // 2
    first = len(readings) - n
    for j in range(readings.shape[1]):
        total, early, late = 0.0, 0.0, 0.0
        for i in range(n):
            total += readings[first + i, j]
        for i in range(min(half, n)):
            early += readings[first + i, j]
        for i in range(len(readings) - min(half, n), len(readings)):
            late += readings[i, j]
        mean[j], drift[j] = total / n, abs(late / half - early / half)


@kernel
def extent(readings, span):  # type: ignore[no-untyped-def]
    """Set how far ``readings`` (n, joints) extend, ``span`` (joints,)."""
    for j in range(readings.shape[1]):
        low = high = readings[0, j]
        for i in range(1, len(readings)):
            low, high = min(low, readings[i, j]), max(high, readings[i, j])
        span[j] = high - low


@kernel
def variance(readings, scatter):  # type: ignore[no-untyped-def]
    """Set the variance of ``readings`` (n, joints), ``scatter`` (joints,)."""
    n = len(readings)
    for j in range(readings.shape[1]):
        total, squares = 0.0, 0.0
        for i in range(n):
            total += readings[i, j]
        for i in range(n):
            squares += (readings[i, j] - total / n) ** 2
        scatter[j] = squares / n


class Rest:
    """How all joints of an arm come to rest, and are kept there.

    Where the goal stays the same and a joint is nearly at rest near to it, it moves by single pulses, as much of what
    the policy asks for as its error takes by the simulation, and looks at what each did before the next, unless a
    valve is to be open for whole periods; what is left of the error is added to what is asked for (integral action),
    so that no bias of the simulation remains. Where the mean of the readings is off by less than ``quiet`` tolerances
    its valves stay closed, until it is off by more than ``alert``: closed muscles are springs of air that hold the
    joint, nothing wears, and no noise of the sensors is answered.

    At the turning points of a swing a joint stands still too. It is at rest only where it will stay with closed
    valves, which its simulation foresees, or where it has stayed for as long. A joint that goes on swinging about its
    goal is left alone until it is at rest, or goes on being damped: :class:`~.two_ways.TwoWays` learns which. It
    learns, too, whether a joint stays off its goal that way, as where friction lets go or air leaks: then its
    policy acts in every period, which changes more valves and keeps nearer.
    Integral action goes on while a joint swings near its goal, unless valves stay as they are for whole periods.

    A joint with one muscle has little damping and moves less by a pulse. So it gets several pulses before the next
    look, twice as many each time that those before did little. It has come to rest only once its readings hardly
    differ for a while; until then it is damped by what the agent does in every period, and integral action goes
    further.
    """

    def __init__(self, spec: ArmSpec, simulation: Simulation, wanted: ServoSettings) -> None:
        self._spec, self._unit = spec, wanted.tolerance * spec.counts_per_degree
        tolerance = self._unit * (1.0 if spec.pulses else _COARSE)
        self.tolerance = tolerance
        """Tolerance of a joint that comes to rest [counts]."""
        self._near, self._still, self._most = NEAR * tolerance, _STILL * tolerance, _BIASED * tolerance
        noise = float((wanted.reading_noise * simulation.error_std[:, 0]).max())
        least, most = (max(4, round(seconds / spec.period)) for seconds in _LOOK)
        self._look = min(max(least, math.ceil((noise / (_SURE * tolerance)) ** 2)), most)
        single = spec.muscles == 1
        self._most_pulses = self._look if single else 1
        # Whole periods move an arm by more than a tolerance: without pulses it is to swing, and not to be pushed.
        fine = spec.pulses and (simulation.commands == "pulses" or simulation.spread)
        self._counted, self._close, self._kept, self._steady, waited = math.inf, 0.0, 0.0, math.inf, 0.0
        if single and fine:
            self._counted, self._close, self._kept = _COUNTED * tolerance, math.inf, _MORE * tolerance
            self._steady, waited = _NOISY * noise**2 + (_STEADY * tolerance) ** 2, _WAITED
        elif single or fine:
            self._close, self._kept = _CLOSE * tolerance, _KEPT * tolerance
        swing = _FAR_SWING if single else _SWING
        self._swing = max(swing * tolerance, _ANSWERED * noise) if fine else math.inf
        self._slowly, self._waited, self._foreseen = (
            max(self._look, round(time / spec.period)) for time in (_SLOWLY, waited, _FORESEEN)
        )
        self._angles = np.zeros((max(self._slowly, self._waited, self._foreseen), spec.joints))  # the newest last
        self._seen = 0  # how many of them
        self._foresight = Foresight(simulation) if fine else None
        self._after = slice(*(round(time / spec.period) for time in _AFTER))
        self._stays = _STAYS * tolerance + _STAYS_NOISE * noise
        self._seen_still = _SEEN_STILL * tolerance + _SEEN_STILL_NOISE * noise
        left = _ANSWERED * noise / math.sqrt(self._look)
        self._quiet_below = max(wanted.quiet * tolerance, left / 2)
        self._alert_above = max(wanted.alert * tolerance, left)
        lowest, highest = np.moveaxis(simulation.pressure_range, -1, 0)
        self._empty = lowest + _EMPTY * (highest - lowest)
        known = wanted.ways if len(wanted.ways) == _KNOWN * spec.joints else ()
        self._joints = [_Joint(spec, known[_KNOWN * j : _KNOWN * (j + 1)]) for j in range(spec.joints)]
        self._actively, self._share = (fine or not spec.pulses) and not single, spec.period / _SWINGING
        self._arrived = round(_ARRIVED / spec.period)
        self._pulse = np.zeros((spec.joints, 2))  # the last of each joint

    @property
    def ways(self) -> tuple[float, ...]:
        """What was learned of the joints of this arm, as in :attr:`.ServoSettings.ways`."""
        return tuple(error for rest in self._joints for ways in (rest.damped, rest.active) for error in ways.known)

    @property
    def bias(self) -> NDArray[np.float64]:
        """What is added to what is asked for, shape (joints,) [counts]: integral action."""
        return np.array([rest.bias for rest in self._joints])

    @property
    def calm(self) -> NDArray[np.bool_]:
        """Which joints are nearly at rest and get single pulses, shape (joints,)."""
        return np.array([rest.calm for rest in self._joints])

    @property
    def active(self) -> NDArray[np.bool_]:
        """Which joints are moved by their policy in every period, also near their goal, shape (joints,)."""
        return np.array([rest.active.second for rest in self._joints])

    def forget_readings(self) -> None:
        """Note that the arm was moved by others."""
        self._seen = 0

    def leave(self) -> None:
        """Note that something else is asked for."""
        self._pulse[:] = 0.0
        for rest in self._joints:
            rest.leave()
            rest.near = 0
            rest.damped.leave()
            rest.active.leave()

    def which_act(
        self,
        now: NDArray[np.float64],
        stays: NDArray[np.bool_],
        angle: NDArray[np.float64],
        state: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Return which joints (joints,) may open valves now, and note which are nearly at rest.

        ``now`` is what is asked for, ``stays`` whether that will stay as it is, and ``angle`` what is read, all
        (joints,), and ``state`` the scaled state (state_size,).
        """
        self._angles[:-1] = self._angles[1:]
        self._angles[-1] = angle
        self._seen = seen = min(self._seen + 1, len(self._angles))
        mean, drift, longer, scatter, lately = np.empty((5, now.size))
        readings = self._angles[-seen:]
        look_back(readings, self._look, mean, drift)
        extent(readings[-self._slowly :], longer)
        extent(readings[-self._foreseen :], lately)
        variance(readings[-self._waited :], scatter)
        error = now - mean
        slow = (seen >= self._slowly) & (longer < self._still + _EASY * np.abs(error))
        steady = (seen >= self._waited) & (scatter < self._steady)
        still = (seen >= self._foreseen) & (lately < self._seen_still)
        asked = stays & ~still & (np.abs(error) <= self._near) & [not rest.calm for rest in self._joints]
        steady &= still | self._stay(asked, state)
        acts, saturated = np.ones(now.size, bool), np.abs(self._pulse).max(axis=1) >= 1
        for j, rest in enumerate(self._joints):
            far, fast = _LEAVING if rest.calm else (1.0, 1.0)
            off = now[j] - readings[-1, j]
            if rest.swings >= _SWINGS or rest.damped.is_tried:
                rest.damped.see(off / self.tolerance)
            if seen < self._look or not stays[j]:
                rest.leave()
                continue
            rest.near += abs(off) <= self._near or rest.near > 0
            if rest.near and self._actively:
                if rest.near > self._arrived:
                    rest.active.see(off / self._unit)
                if rest.active.second:
                    rest.swings = 0
                    rest.mark_moving(_FARTHER * self.tolerance, off * self._share if abs(off) < self._close else 0.0)
                    continue
            rest.see(off, self._swing)
            if abs(error[j]) > far * self._near:
                rest.leave_goal(still[j])
                acts[j] = rest.swings < _SWINGS or rest.damped.second
                continue
            if not (rest.calm or steady[j]) or (drift[j] > fast * self._still and not slow[j]):
                counted = min(max(error[j], -self._counted), self._counted) if abs(error[j]) < self._close else 0.0
                rest.mark_moving(self._kept, counted * self._share)
                acts[j] = rest.swings < _SWINGS or rest.damped.second
                continue
            rest.calm, rest.error = True, error[j]
            rest.quiet = abs(error[j]) < (self._alert_above if rest.quiet else self._quiet_below)
            rest.look = max(rest.look - 1, 0)
            begins = not rest.quiet and rest.look == 0
            if begins:
                rest.begin(error[j], self._most_pulses)
            acts[j] = not rest.quiet and (rest.left > 0 or saturated[j])
            if acts[j]:
                rest.left, rest.look = max(rest.left - 1, 0), self._look
                if begins and not saturated[j]:
                    rest.bias = float(np.clip(rest.bias + _INTEGRAL * error[j], -self._most, self._most))
        return acts

    def shaped(
        self,
        command: NDArray[np.float64],
        acts: NDArray[np.bool_],
        pressure: NDArray[np.float64],
        state: NDArray[np.float32],
    ) -> NDArray[np.float64]:
        """Return what is done of a ``command`` (joints, 2) by the joints that may act; ``pressure`` (joints, 2)."""
        calm = self.calm
        command[calm[:, None] & (command < 0) & (pressure < self._empty)] = 0.0
        command[~acts] = 0.0
        for j in np.flatnonzero(calm & acts & np.any(command != 0, axis=1)):
            command[j] = self._sized(int(j), state, command)
        self._pulse[acts] = command[acts]
        return command

    def _sized(self, joint: int, state: NDArray[np.float32], command: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return as much of the ``command`` (joints, 2) as takes a ``joint`` at rest nearest to its goal, shape (2,).

        A policy acts in every period, and a heavy joint that it sets in motion it would stop in the next ones.
        """
        if self._foresight is None:
            return command[joint]
        size = self._spec.possible(_SHARES[:, None] * np.abs(command[joint]))
        tried = np.zeros((len(size), *command.shape))
        tried[:, joint] = np.copysign(size, command[joint])
        angle = self._foresight.angles(state, tried.reshape(len(tried), -1), self._after.stop)[:, self._after, joint]
        rest = self._joints[joint]
        short = _WANTED * rest.error + _BESIDES * rest.bias - (angle - angle[0])
        chosen: NDArray[np.float64] = tried[np.abs(short).mean(axis=1).argmin(), joint]
        return chosen

    def _stay(self, asked: NDArray[np.bool_], state: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which joints that are ``asked`` about (joints,) will stay where they are with closed valves.

        ``state`` is the scaled state.
        """
        if self._foresight is None or not asked.any():
            return np.ones(asked.size, bool)
        closed = np.zeros((1, 2 * asked.size))
        moved = np.ptp(self._foresight.angles(state, closed, self._foreseen)[0], axis=0)
        return ~asked | (moved <= self._stays)


class _Joint:
    """How one joint is nearly at rest."""

    def __init__(self, spec: ArmSpec, known: Sequence[float]) -> None:
        period, ways = spec.period, known[2:]
        self.damped = TwoWays(period, _DAMPED, known[:2])
        if spec.pulses:
            self.active = TwoWays(period, _ACTIVE, ways)
        else:
            self.active = TwoWays(period, _ACTIVE_WHOLE, ways, _COUNTS_WHOLE)
        self.near = 0  # turns since it first was near this goal
        self.leave()

    def leave(self) -> None:
        """Note that it is far from what is asked for, or that this moves."""
        self.swings, self._side = 0, 0.0
        self.bias = 0.0
        self.mark_moving(0.0, 0.0)

    def leave_goal(self, still: np.bool_) -> None:
        """Note that it is far from its goal, and whether it lies still there: then its swings are over."""
        if still:
            self.leave()
        self.bias = 0.0
        self.mark_moving(0.0, 0.0)

    def mark_moving(self, kept: float, added: float) -> None:
        """Note that it is near, but moves: its bias, with what is ``added``, is ``kept`` at most."""
        self.calm, self.quiet, self.look = False, False, 0
        self.left, self._pulses, self.error, self._before = 0, 1, 0.0, 0.0
        if self.swings < _SWINGS:
            self.bias = min(max(self.bias + added, -kept), kept)

    def begin(self, error: float, most: int) -> None:
        """Note that a pulse is due for the ``error``; where those before did little, several in a row, ``most``."""
        done = error * self._before <= 0 or abs(error) < _DONE * abs(self._before)
        self._pulses, self._before = 1 if done else min(2 * self._pulses, most), error
        self.left = self._pulses

    def see(self, error: float, swing: float) -> None:
        """Count how often the ``error`` went from one side of the goal to the other, further than ``swing``."""
        if abs(error) > swing:
            side = math.copysign(1.0, error)
            self.swings += side == -self._side
            self._side = side
