"""The pressure of one muscle: what its valves do to it, and the inner loop that brings it to where it is wanted."""

from collections import deque
from dataclasses import dataclass

from pneumarm.classical.static_map import interpolate

_LEAST_RATE = 0.05
"""Rates below this count as this: a muscle near the supply's pressure takes for ever [bar/s]."""


@dataclass(frozen=True)
class Rates:
    """How fast a muscle's pressure changes with a valve open, measured on the arm."""

    pressures: tuple[float, ...]
    """Rising [bar]."""
    filling: tuple[float, ...]
    """At these, with the inlet open [bar/s]."""
    emptying: tuple[float, ...]
    """At these, with the exhaust open, positive [bar/s]."""
    dead_time: float
    """Time from setting the valve until the pressure changes [s]."""

    def at(self, pressure: float, way: float) -> float:
        """Return the rate [bar/s] at ``pressure`` [bar]: of filling where ``way`` is positive, else of emptying."""
        table = self.filling if way > 0 else self.emptying
        return max(interpolate(pressure, self.pressures, table), _LEAST_RATE)


class PressureLoop:
    """Brings the pressure of one muscle to a set-point, by whole periods (bang-bang with a dead band) or by pulses.

    What was commanded and is not yet to be seen, for the dead time and the time between reading and acting, is added
    to what is read (a Smith predictor). The pressure lacking, in units of what an open valve gives in a period, is
    the share of the period that the valve is opened for.

    Args:
        rates: of the muscle.
        period: of control [s].
        latency: between reading and acting [s].
        shortest: pulse that the valves can do [s]; None for valves that are set for whole periods.
        gain: share of the error that is taken away in a period.
        dead_band: errors below this are left [bar].
        trust: share of a reading that goes into the estimate of the pressure while the joint stands still; the
            rest is predicted.

    """

    def __init__(
        self,
        rates: Rates,
        period: float,
        latency: float,
        shortest: float | None,
        gain: float,
        dead_band: float,
        trust: float,
    ) -> None:
        self.rates, self.period, self.shortest = rates, period, shortest
        self.gain, self.dead_band, self.trust = gain, dead_band, trust
        self._delay = latency + rates.dead_time
        self._commands: deque[float] = deque(maxlen=int(self._delay / period) + 2)
        self.estimate: float | None = None
        """Of the pressure now [bar]."""

    def reset(self) -> None:
        """Begin with valves that were closed for longer than the dead time."""
        self._commands.clear()
        self.estimate = None

    def read(self, pressure: float, motion: float = 0.0) -> float:
        """Take in a reading [bar] and return the pressure that there will be when a command now takes effect.

        ``motion``, from 0 for a joint that stands still to 1, is how far the reading is trusted beyond ``trust``: a
        moving joint compresses the air, which no rate foresees.
        """
        if self.estimate is None:
            self.estimate = pressure
        else:
            expected = self.estimate + self._change(-self.period)
            trust = self.trust + (1 - self.trust) * motion
            self.estimate = expected + trust * (pressure - expected)
        return self.estimate + self._change(0.0)

    def command(self, target: float, expected: float) -> float:
        """Return the command, -1 to 1, that brings the pressure from ``expected`` to ``target`` [bar]."""
        lacking = target - expected
        periods = lacking / (self.rates.at(expected, lacking) * self.period)
        if abs(lacking) < self.dead_band:
            return 0.0
        if self.shortest is None:
            return 0.0 if abs(periods) < 0.5 else (1.0 if lacking > 0 else -1.0)
        return self.pulse(self.gain * periods)

    def pulse(self, share: float) -> float:
        """Return ``share`` as the valves can do it: not over a period, not under the shortest pulse."""
        size, least = abs(share), (self.shortest or self.period) / self.period
        if size < least:
            size = least if size > least / 2 else 0.0
        return min(size, 1.0) * (1.0 if share > 0 else -1.0)

    def commanded(self, command: float) -> None:
        """Remember the ``command`` that is carried out after the last reading."""
        self._commands.appendleft(command)

    def _change(self, since: float) -> float:
        """Return by how much the commands so far change the pressure from ``since`` on [bar].

        ``since`` is from now [s]: 0 for what is still to come, minus a period for what came since the last reading.
        """
        pressure, total = self.estimate or 0.0, 0.0
        for periods_ago, command in enumerate(self._commands, 1):
            if command:
                begin = self._delay - periods_ago * self.period
                end = begin + abs(command) * self.period
                until = 0.0 if since < 0 else end
                lasting = max(min(end, until) - max(begin, since), 0.0)
                if lasting:
                    total += lasting * self.rates.at(pressure, command) * (1.0 if command > 0 else -1.0)
        return total
