"""A joint that is to stay at a goal: when it is nearly at rest there, and what moves it then."""

import math

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.learning.servo.at_rest import (
    Resting,
    RestParameters,
    blank,
    choose_joints,
    leave_goals,
    limit_pulses,
    look_at_joints,
    note_pulses,
)
from pneumarm.learning.servo.commands import NEAR
from pneumarm.learning.servo.foresight import Foresight
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.servo.two_ways import is_second_better, ways_of, ways_parameters
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
        fine = is_fine(spec, simulation)
        self._spec, self.parameters = spec, rest_parameters(spec, simulation, wanted)
        self.tolerance = self.parameters.tolerance
        """Tolerance of a joint that comes to rest [counts]."""
        self._foresight = Foresight(simulation) if fine else None
        self._after = slice(*(round(time / spec.period) for time in _AFTER))
        self._stays = _STAYS * self.tolerance + _STAYS_NOISE * _noise(simulation, wanted)
        self.state = resting(self.parameters, spec.joints, wanted.ways)
        leave_goals(self.parameters, self.state)

    @property
    def ways(self) -> tuple[float, ...]:
        """What was learned of the joints of this arm, as in :attr:`.ServoSettings.ways`."""
        return tuple(np.hstack([self.state.damped.off, self.state.active.off]).ravel().tolist())

    @property
    def bias(self) -> NDArray[np.float64]:
        """What is added to what is asked for, shape (joints,) [counts]: integral action."""
        return self.state.bias.copy()

    @property
    def calm(self) -> NDArray[np.bool_]:
        """Which joints are nearly at rest and get single pulses, shape (joints,)."""
        return self.state.calm.copy()

    @property
    def active(self) -> NDArray[np.bool_]:
        """Which joints are moved by their policy in every period, also near their goal, shape (joints,)."""
        return np.array([is_second_better(self.state.active, j) for j in range(len(self.state.calm))])

    def forget_readings(self) -> None:
        """Note that the arm was moved by others."""
        self.state.seen[0] = 0

    def leave(self) -> None:
        """Note that something else is asked for."""
        leave_goals(self.parameters, self.state)

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
        look_at_joints(self.parameters, self.state, now, stays, angle)
        acts = np.ones(now.size, bool)
        choose_joints(self.parameters, self.state, now, stays, self._stay(self.state.asked, state), acts)
        return acts

    def shaped(
        self,
        command: NDArray[np.float64],
        acts: NDArray[np.bool_],
        pressure: NDArray[np.float64],
        state: NDArray[np.float32],
    ) -> NDArray[np.float64]:
        """Return what is done of a ``command`` (joints, 2) by the joints that may act; ``pressure`` (joints, 2)."""
        limit_pulses(self.parameters, self.state, pressure, acts, command)
        for j in np.flatnonzero(self.state.calm & acts & np.any(command != 0, axis=1)):
            command[j] = self._sized(int(j), state, command)
        note_pulses(self.state, acts, command)
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
        short = _WANTED * self.state.error[joint] + _BESIDES * self.state.bias[joint] - (angle - angle[0])
        chosen: NDArray[np.float64] = tried[np.abs(short).mean(axis=1).argmin(), joint]
        return chosen

    def _stay(self, asked: NDArray[np.bool_], state: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which joints that are ``asked`` about (joints,) will stay where they are with closed valves.

        ``state`` is the scaled state.
        """
        if self._foresight is None or not asked.any():
            return np.ones(asked.size, bool)
        closed = np.zeros((1, 2 * asked.size))
        moved = np.ptp(self._foresight.angles(state, closed, self.parameters.foreseen)[0], axis=0)
        return ~asked | (moved <= self._stays)


def is_fine(spec: ArmSpec, simulation: Simulation) -> bool:
    """Return whether pulses move an arm by less than a tolerance, as far as its simulation knows.

    Whole periods move it by more: without pulses it is to swing, and not to be pushed.
    """
    return spec.pulses and (simulation.commands == "pulses" or simulation.spread)


def _noise(simulation: Simulation, wanted: ServoSettings) -> float:
    """Return the noise of a reading of an angle [counts]."""
    return float((wanted.reading_noise * simulation.error_std[:, 0]).max())


def rest_parameters(spec: ArmSpec, simulation: Simulation, wanted: ServoSettings) -> RestParameters:
    """Return the numbers by which the joints of an arm come to rest."""
    unit = wanted.tolerance * spec.counts_per_degree
    tolerance = unit * (1.0 if spec.pulses else _COARSE)
    noise, single, fine = _noise(simulation, wanted), spec.muscles == 1, is_fine(spec, simulation)
    least, most = (max(4, round(seconds / spec.period)) for seconds in _LOOK)
    look = min(max(least, math.ceil((noise / (_SURE * tolerance)) ** 2)), most)
    counted, close, kept, steady, waited = math.inf, 0.0, 0.0, math.inf, 0.0
    if single and fine:
        counted, close, kept = _COUNTED * tolerance, math.inf, _MORE * tolerance
        steady, waited = _NOISY * noise**2 + (_STEADY * tolerance) ** 2, _WAITED
    elif single or fine:
        close, kept = _CLOSE * tolerance, _KEPT * tolerance
    swing = _FAR_SWING if single else _SWING
    slowly, waiting, foreseen = (max(look, round(time / spec.period)) for time in (_SLOWLY, waited, _FORESEEN))
    left = _ANSWERED * noise / math.sqrt(look)
    lowest, highest = np.moveaxis(simulation.pressure_range, -1, 0)
    active = (_ACTIVE,) if spec.pulses else (_ACTIVE_WHOLE, _COUNTS_WHOLE)
    return RestParameters(
        tolerance=tolerance,
        unit=unit,
        near=NEAR * tolerance,
        still=_STILL * tolerance,
        easy=_EASY,
        steady=steady,
        seen_still=_SEEN_STILL * tolerance + _SEEN_STILL_NOISE * noise,
        counted=counted,
        close=close,
        kept=kept,
        swing=max(swing * tolerance, _ANSWERED * noise) if fine else math.inf,
        farther=_FARTHER * tolerance,
        share=spec.period / _SWINGING,
        far=_LEAVING[0],
        fast=_LEAVING[1],
        quiet=max(wanted.quiet * tolerance, left / 2),
        alert=max(wanted.alert * tolerance, left),
        most_bias=_BIASED * tolerance,
        integral=_INTEGRAL,
        done=_DONE,
        most_pulses=look if single else 1,
        swings=_SWINGS,
        look=look,
        slowly=slowly,
        waited=waiting,
        foreseen=foreseen,
        arrived=round(_ARRIVED / spec.period),
        actively=(fine or not spec.pulses) and not single,
        damped=ways_parameters(spec.period, _DAMPED),
        active=ways_parameters(spec.period, *active),
        empty=lowest + _EMPTY * (highest - lowest),
    )


def resting(parameters: RestParameters, joints: int, known: tuple[float, ...] = ()) -> Resting:
    """Return what changes, at first, where so much is ``known`` as in :attr:`.ServoSettings.ways`."""
    numbers = np.reshape(known, (joints, _KNOWN)) if len(known) == _KNOWN * joints else np.empty((joints, 0))
    longest = max(parameters.slowly, parameters.waited, parameters.foreseen)
    return Resting(
        **blank(Resting, joints, angles=(longest, joints), seen=(1,), pulse=(joints, 2)),
        damped=ways_of(list(numbers[:, :2]), parameters.damped.hoped),
        active=ways_of(list(numbers[:, 2:]), parameters.active.hoped),
    )
