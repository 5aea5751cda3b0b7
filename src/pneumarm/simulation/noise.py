"""Noise on the simulation's predictions, so that an agent cannot rely on them more than they deserve (section 3.4).

The injected noise is Gaussian with the standard deviation of the fit's error. Correlated noise is a moving average,

    ma_k = (n - 1)/n ma_{k-1} + 1/n noise_k          (thesis eq. 3.8)
    std(ma) = std(noise) / sqrt(2 n - 1)             (thesis eq. 3.9, appendix B)

so ``noise`` is drawn with sqrt(2 n - 1) times the wanted deviation. Slow arms are predicted well: below 0.2
counts/ms only 20 % of the noise is injected, above 1 count/ms all of it, in between linearly.

Differences from the thesis, where it is silent:

1. The velocity that decides is the predicted one, before noise; it scales what is injected, not what enters the
   average, so that noise of a fast movement does not linger when the arm has stopped.
2. The average begins an episode in its stationary distribution, so that eq. 3.9 holds from the first step.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import part
from pneumarm.random import normal, uniform
from pneumarm.settings import NonNegativeFloat, PositiveFloat, PositiveInt, Settings, Share, Valid
from pneumarm.simulation.simulation import Simulation


@dataclass(frozen=True)
class NoiseSettings(Settings):
    """How much noise the simulation's predictions get, and of what kind."""

    kind: Literal["correlated", "white", "uniform", "none"] = "correlated"
    """Correlated over some steps (thesis: section 3.4), independent from step to step, uniform within a share of the
    range as the thesis' [10] has it, or no noise at all."""
    share: PositiveFloat = 0.01
    """Largest uniform noise, as a share of the range of each quantity ([10]: about 0.01 to 0.1)."""
    factor: NonNegativeFloat = 1.0
    """Standard deviation of the noise in standard deviations of the fit's error (thesis: 1)."""
    steps: PositiveInt = 5
    """Number n of steps that correlated noise is averaged over (thesis: 5)."""
    by_velocity: bool = True
    """Whether a slow arm gets less noise (thesis: yes)."""
    slow: NonNegativeFloat = 0.2
    """Speed below which only ``slow_share`` is injected [counts/ms] (thesis: 0.2)."""
    fast: float = 1.0
    """Speed above which the whole noise is injected [counts/ms] (thesis: 1)."""
    slow_share: Share = 0.2
    """Share of the noise that a slow arm gets (thesis: 20 %)."""

    def _valid(self) -> Valid:
        return {"slow": self.slow < self.fast or "below fast"}


class NoiseParameters(NamedTuple):
    """The noise as a kernel needs it; arrays of length 0 where there is none. Made by :func:`noise_parameters`."""

    std: NDArray[np.float32]
    """Standard deviation by output of the networks, or its largest noise, shape (outputs,) [scaled]."""
    is_uniform: bool
    """Whether noise is uniform: then nothing else of it is Gaussian or an average."""
    keep: float
    """(n - 1)/n."""
    gain: float
    """sqrt(2 n - 1)/n, so that the average of standard normal deviates has deviation 1."""
    source: NDArray[np.int64]
    """By joint the output that tells the speed, and the place of the velocity in the state, shape (joints, 2)."""
    further: int
    """Outputs after those of the joints: of further sensors, whose noise has no share by speed."""
    speed: NDArray[np.float32]
    """By joint p, q, r in omega = p change + q velocity + r, in [counts/ms], shape (joints, 3)."""
    ramp: NDArray[np.float32]
    """Share of a slow arm, slow speed, slope of the share above it, shape (3,)."""


def noise_parameters(settings: NoiseSettings, simulation: Simulation) -> NoiseParameters:
    """Return the noise of ``simulation`` as arrays, scaled as its state is."""
    joints = simulation.window.joints
    window, scaling = simulation.window, simulation.scaling
    scale, further = window.of_joints(scaling.observation_scale), len(window.further)
    derived = simulation.velocity == "derived"
    std = settings.factor * (simulation.errors / scaling.observation_scale)[simulation.outputs]
    if settings.kind == "uniform":
        std = settings.share * ranges(simulation)[simulation.outputs] / scaling.observation_scale[simulation.outputs]
    outputs = (std.size - further) // joints
    if settings.kind == "none" or settings.factor == 0:
        std = std[:0]
    speed = np.zeros((joints, 3))
    if derived:
        speed[:, 0] = scale[:, 0] / (1e3 * simulation.spec.period)
    else:
        speed[:, 0] = speed[:, 1] = scale[:, 1]
        speed[:, 2] = window.of_joints(scaling.observation_offset)[:, 1]
    first = np.arange(joints)
    output = first * outputs + (0 if derived else 1)
    n = settings.steps if settings.kind == "correlated" else 1
    share = settings.slow_share if settings.by_velocity else 1.0
    return NoiseParameters(
        std=np.ascontiguousarray(std, np.float32),
        is_uniform=settings.kind == "uniform",
        keep=(n - 1) / n,
        gain=math.sqrt(2 * n - 1) / n,
        source=np.stack([output, 4 * first + 1], axis=1),
        further=further,
        speed=speed.astype(np.float32),
        ramp=np.array([share, settings.slow, (1 - share) / (settings.fast - settings.slow)], np.float32),
    )


def ranges(simulation: Simulation) -> NDArray[np.float64]:
    """Return the range of each place in an observation, shape (observation_size,) [sensor units].

    That of angles and pressures is of their sensors or what was predicted; of velocities twice their scale.
    """
    low, high = simulation.limits
    return np.where(np.isfinite(high - low), high - low, 2 * simulation.scaling.observation_scale)


@part
def begin_noise(noise, average, random):  # type: ignore[no-untyped-def]
    """Put the moving ``average`` (outputs,) into its stationary distribution."""
    for o in range(noise.std.shape[0]):
        average[o] = normal(random)


@part
def noise_share(noise, joint, x, change):  # type: ignore[no-untyped-def]
    """Return the share of the noise that ``joint`` gets, moving as fast as ``change`` predicts."""
    output, place = noise.source[joint, 0], noise.source[joint, 1]
    velocity = noise.speed[joint, 0] * change[output] + noise.speed[joint, 1] * x[place] + noise.speed[joint, 2]
    share = noise.ramp[0] + noise.ramp[2] * max(abs(velocity) - noise.ramp[1], np.float32(0.0))
    return min(share, np.float32(1.0))


@part
def deviate(noise, average, o, random):  # type: ignore[no-untyped-def]
    """Return the noise of output ``o`` in units of its ``noise.std``; its ``average`` goes on if it has one."""
    if noise.is_uniform:
        return np.float32(2.0 * uniform(random) - 1.0)
    average[o] = noise.keep * average[o] + noise.gain * normal(random)
    return average[o]


@part
def add_noise(noise, x, change, average, random):  # type: ignore[no-untyped-def]
    """Add noise to ``change`` (outputs,), the scaled change that the networks predict from the state ``x``."""
    if noise.std.shape[0] == 0:
        return
    outputs = (noise.std.shape[0] - noise.further) // noise.speed.shape[0]
    for joint in range(noise.speed.shape[0]):
        share = noise_share(noise, joint, x, change)
        for o in range(joint * outputs, (joint + 1) * outputs):
            change[o] += share * noise.std[o] * deviate(noise, average, o, random)
    for o in range(noise.std.shape[0] - noise.further, noise.std.shape[0]):
        change[o] += noise.std[o] * deviate(noise, average, o, random)
