"""What the boards of strangers read: counts of their own, with offsets, noise and steps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BITS = 10, 12, 14, 16


@dataclass(frozen=True)
class Sensor:
    """A potentiometer or an encoder at a joint, or pressure sensors; of what they measure in degrees or bar."""

    top: float
    """Highest count; the lowest is 0."""
    step: float
    """From one reading to the next that its converter tells apart [counts]."""
    slope: float
    """Counts by degree or bar."""
    zero: float
    """What it reads at 0 degrees or at atmosphere [counts]."""
    bow: float
    """How its slope changes by degree, as a share."""
    noise: float
    """Standard deviation [degrees or bar]."""

    def read(self, value: Array, deviates: Array) -> Array:
        """Return the counts of ``value`` [degrees or bar]; ``deviates`` are those of the noise."""
        counts = self.zero + self.slope * (value + self.bow * value**2 + self.noise * deviates)
        return np.clip(self.step * np.round(counts / self.step), 0.0, self.top)


def draw_angle(random: np.random.Generator, reach: float) -> Sensor:
    """Draw an angle sensor for a joint that turns by ``reach`` either side of its middle [degrees]."""
    bits = random.choice(BITS)
    top, step = float(2**bits - 1), _step(random, bits)
    span = 2 * reach * random.uniform(1.12, 1.6 if bits == 10 else 2.6)
    bow = random.uniform(-3e-4, 3e-4)
    room = span / 2 - reach * (1 + abs(bow) * reach) - 1.5
    away = random.uniform(-1, 1) * max(min(room, 0.25 * reach), 0.0)
    slope = top / span
    noise = np.exp(random.uniform(np.log(0.02), np.log(0.3)))
    return Sensor(top, step, slope, top / 2 + slope * away, bow, float(noise))


def draw_pressure(random: np.random.Generator, full: float) -> Sensor:
    """Draw the pressure sensors for a supply of ``full`` [bar gauge]."""
    bits = random.choice(BITS)
    top, step = float(2**bits - 1), _step(random, bits)
    zero = top * (random.uniform(0.04, 0.1) if random.random() < 0.6 else 0.005)  # those of 0.5 to 4.5 V, or trimmed
    slope = (top - zero) / (full * random.uniform(1.1, 2.0))
    noise = full * np.exp(random.uniform(np.log(0.002), np.log(0.02)))
    return Sensor(top, step, slope, zero, 0.0, float(noise))


def _step(random: np.random.Generator, bits: int) -> float:
    """Return the step of a converter: a count, or more where not all of its bits are worth their name."""
    return float(2 ** random.integers(0, bits // 2 - 3)) if bits > 10 and random.random() < 0.4 else 1.0
