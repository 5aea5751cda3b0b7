"""How fast a simulation's networks are fitted: three 18-10-1 networks on 40,000 rows, and one beside SciPy."""

import contextlib
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pneumarm.networks import LevenbergMarquardt, Network, levenberg_marquardt, nguyen_widrow

ROWS, INPUTS, HIDDEN, EPOCHS, OUTPUTS = 40_000, 18, 10, 15, 3


class _EnoughError(Exception):
    """Raised to stop SciPy after as many Jacobians as we take."""


def problem(seed: int = 0) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return inputs (rows, inputs) and noisy targets (rows, outputs) that no network of this size fits exactly."""
    generator = np.random.default_rng(seed)
    x = generator.uniform(-1, 1, (ROWS, INPUTS)).astype(np.float32)
    hidden = np.tanh(x @ generator.normal(0, 0.6, (INPUTS, 2 * HIDDEN)))
    return x, hidden @ generator.normal(0, 0.5, (2 * HIDDEN, OUTPUTS)) + generator.normal(0, 0.1, (ROWS, OUTPUTS))


def scipy_fit(x: NDArray[np.float32], y: NDArray[np.float64], start: Network) -> tuple[float, float]:
    """Return the mean squared error after ``EPOCHS`` Jacobians of SciPy's Levenberg-Marquardt, and its seconds."""
    from scipy.optimize import least_squares

    inputs = np.column_stack([x.astype(np.float64), np.ones(len(x))])
    hidden = start.hidden_bias.size
    best, jacobians = np.inf, 0

    def split(p: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        v, w = p[: -hidden - 1].reshape(-1, hidden), p[-hidden - 1 :]
        return v, w, np.tanh(inputs @ v)

    def residues(p: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal best
        _, w, h = split(p)
        r = h @ w[:-1] + w[-1] - y[:, 0]
        best = min(best, float(r @ r) / len(r))
        return r

    def jacobian(p: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal jacobians
        jacobians += 1
        if jacobians > EPOCHS:
            raise _EnoughError
        _, w, h = split(p)
        of_hidden = (inputs[:, :, None] * ((1 - h**2) * w[:-1])[:, None, :]).reshape(len(x), -1)
        return np.column_stack([of_hidden, h, np.ones(len(x))])

    v = np.vstack([start.hidden_weights, start.hidden_bias])
    p = np.concatenate([v.ravel(), start.output_weights[:, 0], start.output_bias])
    began = time.perf_counter()
    with contextlib.suppress(_EnoughError):
        least_squares(residues, p, jacobian, method="lm", max_nfev=10**6)
    return best, time.perf_counter() - began


def measure() -> Iterator[str]:
    """Yield the figures."""
    from concurrent.futures import ThreadPoolExecutor

    x, y = problem()
    settings = LevenbergMarquardt(epochs=EPOCHS, tolerance=0)
    began = time.perf_counter()
    levenberg_marquardt(x[:1000], y[:1000, :1], nguyen_widrow(INPUTS, HIDDEN, 1, 0), settings)
    yield f"compiled, or read from the cache, in {time.perf_counter() - began:.1f} s"

    def one(output: int) -> tuple[float, float]:
        started = time.perf_counter()
        fit = levenberg_marquardt(x, y[:, [output]], nguyen_widrow(INPUTS, HIDDEN, 1, output), settings)
        return float(fit.mse[-1]), time.perf_counter() - started

    began = time.perf_counter()
    with ThreadPoolExecutor() as threads:
        list(threads.map(one, range(OUTPUTS)))
    yield f"{OUTPUTS} fits {INPUTS}-{HIDDEN}-1, {ROWS} rows, {EPOCHS} epochs: {time.perf_counter() - began:.2f} s"
    began = time.perf_counter()
    together = nguyen_widrow(INPUTS, HIDDEN, OUTPUTS, 0)
    levenberg_marquardt(x, y, together, settings)
    yield f"one fit {INPUTS}-{HIDDEN}-{OUTPUTS} with all outputs: {time.perf_counter() - began:.2f} s"
    mse, seconds = one(0)
    scipy_mse, scipy_seconds = scipy_fit(x, y, nguyen_widrow(INPUTS, HIDDEN, 1, 0))
    yield (
        f"one fit: {seconds:.2f} s, SciPy's lm with the same start and {EPOCHS} Jacobians: {scipy_seconds:.1f} s, "
        f"{scipy_seconds / seconds:.0f} times as long; mean squared error {mse:.5f}, SciPy {scipy_mse:.5f}"
    )
