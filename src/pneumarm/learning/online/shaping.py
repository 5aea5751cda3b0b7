"""Shaping: how far begin states are from the goal, what is demanded there, and how much is explored (section 4.3.2).

    deviation    +10 % if the performance exceeds the criterion, else -3 %, every 500 episodes
    criterion    0.5 -> 0.95     epsilon    0.5 -> 0.05     temperature    20 -> 1

linear in the deviation, from the initial one to the whole range of angles. The performance is the moving average of
the successes (thesis eq. 4.14), kept by the loop. Without shaping the criterion is looked at after every episode, as
the numbers of episodes in table C.22 show.

Difference from the thesis: the deviation does not shrink below the initial one, where exploration would be
extrapolated.
"""

from typing import NamedTuple

import numpy as np

from pneumarm.arm.seam import ArmSpec
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.settings import TrainSettings


class ShapingStage(NamedTuple):
    """Where shaping stands."""

    schedule: Schedule
    criterion: float
    """Performance demanded."""
    whole: bool
    """Whether the deviation is the whole range of angles."""


def initial_deviation(settings: TrainSettings, spec: ArmSpec) -> float:
    """Return the deviation of the first episode [counts], at most the whole range; without shaping that."""
    low, high = spec.angle_range
    if settings.shaping is None:
        return high - low
    return min(settings.shaping.initial_deviation * spec.counts_per_degree, high - low)


def stage(deviation: float, settings: TrainSettings, spec: ArmSpec) -> ShapingStage:
    """Return what holds at ``deviation`` [counts]."""
    shaping, last = settings.shaping, settings.exploration
    if shaping is None:
        rate, demanded = _NO_SHAPING
        enough = demanded if settings.stops else np.inf
        schedule = Schedule(np.inf, float(last.epsilon), float(last.temperature), rate, enough)
        return ShapingStage(_helped(schedule, settings, spec), demanded, True)
    low, high = spec.angle_range
    first, whole = initial_deviation(settings, spec), high - low
    share = (deviation - first) / (whole - first) if whole > first else 1.0

    def between(start: float, end: float) -> float:
        return start + share * (end - start)

    epsilon = between(shaping.exploration.epsilon, last.epsilon)
    temperature = between(shaping.exploration.temperature, last.temperature)
    criterion = between(shaping.initial_criterion, shaping.criterion)
    schedule = Schedule(float(deviation), epsilon, temperature, shaping.performance_rate)
    return ShapingStage(_helped(schedule, settings, spec), criterion, deviation >= whole)


def _helped(schedule: Schedule, settings: TrainSettings, spec: ArmSpec) -> Schedule:
    """Return ``schedule`` with what the settings have besides shaping."""
    help_, is_shaped = settings.help, settings.shaping is not None
    return schedule._replace(
        near_epsilon=float(settings.exploration.epsilon) if help_.by_position and is_shaped else -1.0,
        stray=float(help_.stray * schedule.deviation) if help_.stray and is_shaped else np.inf,
        local=float(help_.local / spec.counts_per_degree),
        retry=float(help_.retry),
    )


def adjusted(deviation: float, performance: float, settings: TrainSettings, spec: ArmSpec) -> float:
    """Return the deviation [counts] after another 500 episodes at whose end the ``performance`` was this."""
    if settings.shaping is None:
        return deviation
    low, high = spec.angle_range
    if performance > stage(deviation, settings, spec).criterion:
        return min(deviation * (1 + settings.shaping.grow), high - low)
    return max(deviation * (1 - settings.shaping.shrink), initial_deviation(settings, spec))


_NO_SHAPING = 0.002, 0.95  # the same average of successes and the same demand as at the end of shaping
