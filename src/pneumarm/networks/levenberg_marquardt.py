"""Levenberg-Marquardt for networks with one hidden layer of tansig units and linear outputs (thesis section 3.2.4).

A fit minimises the mean squared error of ``n`` rows and ``m`` outputs,

    E(w) = 1/n sum_i |r_i(w)|^2,        r_i = y(x_i; w) - t_i.

**The step.** Near ``w`` the residue is linear, r(w + d) = r + J d, with J its Jacobian. Trusted only near ``w``,
the step is the least-squares solution of the system extended by sqrt(mu) I,

    min_d | [ J; sqrt(n mu) I ] d + [ r; 0 ] |^2    <=>    (A + mu I) d = -g,    A = J^T J / n,    g = J^T r / n.

A large ``mu`` gives a short step down the gradient, a small one the Gauss-Newton step. :func:`damped_step`.

**The damping.** The linear model promises a decrease of E by ``-d.g + mu d.d``. The share of it that came true, the
gain, says how far to trust the model: a good step shrinks ``mu``, a failed one is undone and ``mu`` grows faster and
faster (Nielsen's rule). :func:`next_damping`.

**The end.** After ``epochs`` accepted steps; or earlier when the error has all but stopped falling, or when no
step however short makes it fall.

**The normal equations** are all that is needed of J, and J has structure. With x_a the inputs (a constant 1 among
them), h_j the hidden units, s_j = 1 - h_j^2 their slopes and W the output weights,

    dy_o / dv_aj = W_jo s_j x_a        for the hidden weights v,
    dy_o / dW_ko = h_k                 for the output weights (h has a constant 1 too),

so that the largest block of A is a sum of products of two pairs,

    sum_o dy_o/dv_aj dy_o/dv_bk = (W W^T)_jk sum_i (x_a x_b)_i (s_j s_k)_i.

There are far fewer pairs (a <= b) times (j <= k) than entries in A, the weights stand outside of the sum, and more
outputs cost nothing. J is never formed. These sums are of float32 within a block of rows and of float64 over the
blocks; they only shape the step. Error and gradient, which judge it and say where the minimum is, are float64
throughout. The sums are in :mod:`pneumarm.networks.products`.

Sources: D. Marquardt, SIAM J. Appl. Math. 11(2), 1963; M. Hagan and M. Menhaj, IEEE Trans. Neural
Networks 5(6), 1994; H. B. Nielsen, Damping parameter in Marquardt's method, Technical University of Denmark, 1999.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.networks.network import Network
from pneumarm.networks.products import Sums, add_block, solve_positive, weighted_sums

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Settings of :func:`levenberg_marquardt`."""

    epochs: int = 60
    """Accepted steps at most; each takes one Jacobian (thesis: 15)."""
    tolerance: float = 1e-5
    """Converged when ``patience`` epochs in a row lower the error by less than this part of it; 0: never."""
    patience: int = 3
    """Epochs without notable progress before the fit counts as converged."""
    decay: float = 0.0
    """Weight decay: ``decay |w - c|^2`` is added to the error; 0 for none (thesis)."""
    anchored: bool = False
    """Whether weights decay towards those that the fit starts from, c = w_0, rather than towards c = 0."""
    damping: float = 1e-3
    """First mu, as a part of the mean of the diagonal of A."""
    block: int = 4096
    """Rows whose products are in memory at once; the result does not depend on it beyond rounding."""


class Fit(NamedTuple):
    """What :func:`levenberg_marquardt` found."""

    network: Network
    mse: Floats
    """Mean squared error before the first and after every epoch, shape (epochs + 1,), decay included."""
    epochs: int
    """Accepted steps, each with a Jacobian of its own."""
    converged: bool
    """Whether it stopped before ``LevenbergMarquardt.epochs``."""


class NormalEquations(NamedTuple):
    """What a step needs of the Jacobian and the residue."""

    curvature: Floats
    """A = J^T J / n, shape (weights, weights)."""
    gradient: Floats
    """g = J^T r / n, shape (weights,)."""
    error: float
    """E = |r|^2 / n."""


def levenberg_marquardt(
    x: ArrayLike,
    y: ArrayLike,
    start: Network,
    settings: LevenbergMarquardt | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit a network to the targets ``y`` (n, outputs) at the inputs ``x`` (n, inputs), both scaled to about 1.

    ``progress(epoch, mse)`` is called after every epoch. The result is a function of the arguments alone.

    Raises:
        ValueError: ``start`` has direct connections, or the shapes do not fit together.

    """
    settings = settings or LevenbergMarquardt()
    problem = Problem(x, y, start, settings.decay, settings.block, settings.anchored)
    weights = problem.pack(start)
    curve = [problem.error(weights)]
    damping, growth = None, 2.0
    slow = 0
    while len(curve) <= settings.epochs and slow < settings.patience:
        equations = problem.normal_equations(weights)
        if damping is None:
            damping = settings.damping * float(equations.curvature.diagonal().mean())
        accepted = False
        while not accepted and damping < _HOPELESS * float(equations.curvature.diagonal().max()):
            gain, step, error = _try_step(problem, equations, weights, damping)
            accepted = gain > 0
            damping, growth = next_damping(damping, growth, gain)
        if not accepted:
            break
        weights = weights + step
        slow = slow + 1 if curve[-1] - error < settings.tolerance * curve[-1] else 0
        curve.append(error)
        if progress is not None:
            progress(len(curve) - 1, error)
    epochs = len(curve) - 1
    return Fit(problem.unpack(weights), np.array(curve), epochs, epochs < settings.epochs)


_HOPELESS = 1e8
"""Damping, as a part of the largest curvature, at which steps are too short to lower the error."""


def _try_step(
    problem: "Problem", equations: NormalEquations, weights: Floats, damping: float
) -> tuple[float, Floats, float]:
    """Return the gain of a step (-1 if there is none), the step, and the error after it."""
    step = damped_step(equations, damping)
    if step is None:
        return -1.0, np.zeros_like(weights), np.inf
    promised = float(-step @ equations.gradient + damping * step @ step)
    error = problem.error(weights + step)
    gain = (equations.error - error) / promised if np.isfinite(error) and promised > 0 else -1.0
    return gain, step, error


def damped_step(equations: NormalEquations, damping: float) -> Floats | None:
    """Return d of (A + mu I) d = -g, or None where rounding has left that matrix indefinite."""
    matrix = equations.curvature.copy()
    matrix.flat[:: len(matrix) + 1] += damping
    step = -equations.gradient
    return step if solve_positive(matrix, step) else None


def next_damping(damping: float, growth: float, gain: float) -> tuple[float, float]:
    """Return the next mu and the factor by which it grows if that fails too (Nielsen's rule)."""
    if gain > 0:
        return damping * max(1 / 10, 1 - (2 * gain - 1) ** 3), 2.0
    return damping * growth, 2 * growth


class Problem:
    """The error of a network's weights on given data, and its normal equations, summed over blocks of rows.

    Weights are a vector: hidden weights with their bias as the last row, (inputs + 1, hidden), then output weights
    likewise, (hidden + 1, outputs).
    """

    def __init__(
        self,
        x: ArrayLike,
        y: ArrayLike,
        like: Network,
        decay: float = 0.0,
        block: int = 4096,
        anchored: bool = False,
    ) -> None:
        """Keep float32 copies of ``x`` (n, inputs) and float64 of ``y`` (n, outputs), for networks as ``like``.

        With ``anchored`` weights decay towards those of ``like``.
        """
        if like.direct is not None:
            raise ValueError("a network with direct connections cannot be fitted by Levenberg-Marquardt")
        inputs, self.hidden = like.hidden_weights.shape
        self.outputs = like.output_weights.shape[1]
        x, y = np.asarray(x), np.asarray(y)
        n = len(x)
        if x.shape != (n, inputs) or y.shape != (n, self.outputs) or n == 0:
            raise ValueError(f"expected x (n, {inputs}) and y (n, {self.outputs}), got {x.shape} and {y.shape}")
        # Rows stand side by side, so that every sum over them runs along memory; a block is one piece of it.
        whole = np.ones((inputs + 1, n), np.float32)
        whole[:-1] = x.T
        pieces = [slice(begin, begin + block) for begin in range(0, n, block)]
        self.x = [np.ascontiguousarray(whole[:, piece]) for piece in pieces]
        self.y = [np.ascontiguousarray(y[piece].T, np.float64) for piece in pieces]
        self.inputs, self.rows, self.decay = inputs + 1, n, decay
        self.centre = self.pack(like) if anchored else 0.0

    def pack(self, network: Network) -> Floats:
        """Return the weights of ``network`` as a vector."""
        parts = (network.hidden_weights, network.hidden_bias, network.output_weights, network.output_bias)
        return np.concatenate([np.ravel(part) for part in parts]).astype(np.float64)

    def unpack(self, weights: Floats) -> Network:
        """Return the network with these ``weights``."""
        v, w = self._layers(weights)
        return Network(v[:-1].copy(), v[-1].copy(), w[:-1].copy(), w[-1].copy())

    def error(self, weights: Floats) -> float:
        """Return E, with the decay."""
        total = sum(float(np.vdot(r, r)) for _, _, r in self._blocks(weights))
        return total / self.rows + self.decayed(weights)

    def decayed(self, weights: Floats) -> float:
        """Return what the decay adds to E."""
        away = weights - self.centre
        return self.decay * float(away @ away)

    def normal_equations(self, weights: Floats) -> NormalEquations:
        """Return A, g and E, with the decay."""
        n, inputs, hidden, outputs = self.rows, self.inputs, self.hidden, self.outputs
        w = self._layers(weights)[1][:-1]
        sums, total = Sums.zeros(inputs, hidden, outputs), 0.0
        for x, h, r in self._blocks(weights):
            total += float(np.vdot(r, r))
            add_block(x, h, r, w, sums)
        of_x, of_s = _pair_numbers(inputs), _pair_numbers(hidden)
        vv = sums.xx_ss[of_x[:, None, :, None], of_s[:, None, :]] * (w @ w.T)[:, None, :]
        x_sh = sums.x_sh[:inputs, : hidden * (hidden + 1)]
        vw = x_sh.reshape(inputs, hidden, hidden + 1, 1) * w[:, None, :]
        ww = sums.hh[:, None, :, None] * np.eye(outputs)[:, None, :]
        first, size = inputs * hidden, len(weights)
        curvature = np.empty((size, size))
        curvature[:first, :first] = vv.reshape(first, first)
        curvature[:first, first:] = vw.reshape(first, -1)
        curvature[first:, :first] = curvature[:first, first:].T
        curvature[first:, first:] = ww.reshape(size - first, -1)
        curvature /= n
        curvature.flat[:: size + 1] += self.decay
        gradient = np.concatenate([sums.x_se.ravel(), sums.h_r.ravel()]) / n + self.decay * (weights - self.centre)
        return NormalEquations(curvature, gradient, total / n + self.decayed(weights))

    def _layers(self, weights: Floats) -> tuple[Floats, Floats]:
        first = self.inputs * self.hidden
        return weights[:first].reshape(-1, self.hidden), weights[first:].reshape(-1, self.outputs)

    def _blocks(self, weights: Floats) -> Iterator[tuple[NDArray[np.float32], Floats, Floats]]:
        """Yield inputs, hidden units (both with the constant) and residues of blocks of rows, each (..., rows)."""
        v, w = self._layers(weights)
        for x, y in zip(self.x, self.y, strict=True):
            h = np.ones((self.hidden + 1, x.shape[1]))
            weighted_sums(v, x, h[:-1])
            np.tanh(h[:-1], out=h[:-1])
            r = np.empty(y.shape)
            weighted_sums(w, h, r)
            r -= y
            yield x, h, r


def _pair_numbers(m: int) -> NDArray[np.int64]:
    """Return the number of the pair (j, k) in the order of ``np.triu_indices``, shape (m, m), symmetric."""
    numbers = np.empty((m, m), np.int64)
    upper = np.triu_indices(m)
    numbers[upper] = numbers.T[upper] = np.arange(m * (m + 1) // 2)
    return numbers
