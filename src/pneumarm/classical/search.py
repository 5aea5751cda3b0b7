"""Search without gradients for the least of a costly, noisy function: covariance matrix adaptation.

Hansen, The CMA evolution strategy: a tutorial (2016), with its default constants. Coordinates are the caller's; they
should be such that a step of 1 is a step of the same interest in each.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Evolution:
    """Asks for points, is told what they cost, and asks for better ones.

    Args:
        start: where to begin, shape (n,).
        step: standard deviation of the first points.
        random: source of the points.
        population: points of a generation.

    """

    def __init__(self, start: ArrayLike, step: float, random: np.random.Generator, population: int = 0) -> None:
        self.mean: NDArray[np.float64] = np.array(start, np.float64)
        n = self.mean.size
        self.population = population or 4 + int(3 * math.log(n))
        self._random, self._step = random, step
        raw = math.log((self.population + 1) / 2) - np.log(np.arange(1, self.population // 2 + 1))
        self._weights = raw / raw.sum()
        mu = 1 / (self._weights**2).sum()
        self._mu = mu
        self._c_step = (mu + 2) / (n + mu + 5)
        self._damping = 1 + 2 * max(0.0, math.sqrt((mu - 1) / (n + 1)) - 1) + self._c_step
        self._c_path = (4 + mu / n) / (n + 4 + 2 * mu / n)
        self._c_one = 2 / ((n + 1.3) ** 2 + mu)
        self._c_mu = min(1 - self._c_one, 2 * (mu - 2 + 1 / mu) / ((n + 2) ** 2 + mu))
        self._expected = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))
        self._covariance, self._generation = np.eye(n), 0
        self._path_step, self._path = np.zeros(n), np.zeros(n)
        self._decompose()

    def ask(self) -> list[NDArray[np.float64]]:
        """Return the points of a generation, each of shape (n,)."""
        drawn = self._random.standard_normal((self.population, self.mean.size))
        return [self.mean + self._step * self._basis @ (self._scales * z) for z in drawn]

    def tell(self, points: Sequence[NDArray[np.float64]], costs: Sequence[float]) -> None:
        """Move on from the ``costs`` of ``points``, which may differ from those that were asked for."""
        order = np.argsort(costs, kind="stable")[: len(self._weights)]
        steps = (np.array([points[i] for i in order]) - self.mean) / self._step
        moved = self._weights @ steps
        self.mean = self.mean + self._step * moved
        self._generation += 1
        white = self._basis @ ((self._basis.T @ moved) / self._scales)
        c = self._c_step
        self._path_step = (1 - c) * self._path_step + math.sqrt(c * (2 - c) * self._mu) * white
        length = float(np.linalg.norm(self._path_step))
        short = length / math.sqrt(1 - (1 - c) ** (2 * self._generation)) / self._expected < 1.4 + 2 / (
            self.mean.size + 1
        )
        c = self._c_path
        self._path = (1 - c) * self._path + short * math.sqrt(c * (2 - c) * self._mu) * moved
        kept = 1 - self._c_one - self._c_mu + (0 if short else self._c_one * c * (2 - c))
        self._covariance = kept * self._covariance + self._c_one * np.outer(self._path, self._path)
        self._covariance += self._c_mu * (steps.T * self._weights) @ steps
        self._step *= math.exp(min(1.0, self._c_step / self._damping * (length / self._expected - 1)))
        self._decompose()

    def _decompose(self) -> None:
        values, self._basis = np.linalg.eigh((self._covariance + self._covariance.T) / 2)
        self._scales = np.sqrt(np.maximum(values, 1e-12))
