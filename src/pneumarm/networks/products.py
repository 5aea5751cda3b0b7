"""The sums over rows that a fit by Levenberg-Marquardt is made of, as kernels.

They are loops of our own rather than a library's matrix products: those start threads of their own, for which fits on
other threads would have to wait. What is added up at once lies side by side in memory, and each sum runs in the order
of its terms, so that results do not depend on how a compiler makes vectors of it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.networks.tansig import FASTMATH
from pneumarm.vectors import LANES, add_sums

_BLOCK = 30
"""Rows of a matrix that is solved that are worked on at a time: few enough for the cache, a multiple of 3."""
_ROWS = 128
"""Rows whose products are in memory at once: few enough for the cache."""


class Sums(NamedTuple):
    """Sums over rows for a network with ``m`` inputs, ``h`` hidden units, ``o`` outputs; the last of m + 1 inputs x
    and of h + 1 hidden units is a constant 1.

    Letters as in :mod:`pneumarm.networks.levenberg_marquardt`; tables are padded to whole vectors.
    """

    xx_ss: NDArray[np.float64]
    """(x_a x_b) (s_j s_k), a <= b and j <= k in the order of ``np.triu_indices``."""
    x_sh: NDArray[np.float64]
    """x_a (s_j h_k), shape (m + 1, h (h + 1)) and padding."""
    hh: NDArray[np.float64]
    """h_j h_k, shape (h + 1, h + 1)."""
    x_se: NDArray[np.float64]
    """x_a s_j e_j with e = W r, shape (m + 1, h)."""
    h_r: NDArray[np.float64]
    """h_j r_o, shape (h + 1, o)."""

    @classmethod
    def zeros(cls, inputs: int, hidden: int, outputs: int) -> "Sums":
        """Return sums of nothing, the constant counted among ``inputs``."""

        def padded(count: int) -> int:
            return -(-count // LANES) * LANES

        return cls(
            xx_ss=np.zeros((pairs(inputs), padded(pairs(hidden)))),
            x_sh=np.zeros((inputs, padded(hidden * (hidden + 1)))),
            hh=np.zeros((hidden + 1, hidden + 1)),
            x_se=np.zeros((inputs, hidden)),
            h_r=np.zeros((hidden + 1, outputs)),
        )


def pairs(count: int) -> int:
    """Return how many pairs j <= k < ``count`` there are."""
    return count * (count + 1) // 2


@kernel(fastmath=FASTMATH)
def weighted_sums(weights, a, total):  # type: ignore[no-untyped-def]
    """Write sum_j weights[j, k] a[j, i] into ``total`` (k, rows), for ``a`` (j, rows)."""
    for begin in range(0, a.shape[1], _ROWS):
        end = min(begin + _ROWS, a.shape[1])
        for k in range(weights.shape[1]):
            row = total[k, begin:end]
            row[:] = 0.0
            for j in range(weights.shape[0]):
                weight, of = weights[j, k], a[j, begin:end]
                for i in range(end - begin):
                    row[i] += weight * of[i]


@kernel
def add_block(x, h, r, w, sums):  # type: ignore[no-untyped-def]
    """Add the rows of inputs ``x``, hidden units ``h`` and residues ``r``, each (..., rows), to ``sums``.

    ``w`` (hidden, outputs) are the output weights.
    """
    inputs, hidden = x.shape[0], h.shape[0] - 1
    # Tiles of a fixed size, (rows, ...); where the last one is not full its inputs, units and residues are zero, and
    # so is every product.
    x_now, h_now = np.zeros((_ROWS, inputs), np.float32), np.empty((_ROWS, hidden + 1))
    r_now, slope, slope_error = np.empty((_ROWS, r.shape[0])), np.empty((_ROWS, hidden)), np.empty((_ROWS, hidden))
    xx = np.zeros((_ROWS, sums.xx_ss.shape[0]), np.float32)
    ss = np.zeros((_ROWS, sums.xx_ss.shape[1]), np.float32)
    sh = np.zeros((_ROWS, sums.x_sh.shape[1]), np.float32)
    for begin in range(0, x.shape[1], _ROWS):
        _turn_tile(x, begin, x_now)
        _turn_tile(h, begin, h_now)
        _turn_tile(r, begin, r_now)
        _slopes(h_now, r_now, w, slope, slope_error)
        _add_products(x_now, slope_error, sums.x_se)
        _add_products(h_now, r_now, sums.h_r)
        _add_products(h_now, h_now, sums.hh)
        _pair_products(x_now, xx)
        _pair_products(slope, ss)
        _all_products(slope, h_now, sh)
        _add_in_float32(xx, ss, sums.xx_ss)
        _add_in_float32(x_now, sh, sums.x_sh)


@inner
def _turn_tile(a, begin, tile):  # type: ignore[no-untyped-def]
    """Copy the rows of ``a`` (..., rows) from ``begin`` on into ``tile`` (rows, ...), zeros where they end."""
    rows = min(a.shape[1] - begin, tile.shape[0])
    for j in range(a.shape[0]):
        for i in range(rows):
            tile[i, j] = a[j, begin + i]
        for i in range(rows, tile.shape[0]):
            tile[i, j] = 0


@inner
def _slopes(h, r, w, slope, slope_error):  # type: ignore[no-untyped-def]
    """Write s_j and s_j e_j, e = W r, of every row."""
    for i in range(slope.shape[0]):
        for j in range(slope.shape[1]):
            slope[i, j] = 1 - h[i, j] * h[i, j]
            error = 0.0
            for o in range(r.shape[1]):
                error += w[j, o] * r[i, o]
            slope_error[i, j] = error * slope[i, j]


@inner
def _pair_products(a, products):  # type: ignore[no-untyped-def]
    """Write a_j a_k of every row into ``products``, j <= k."""
    for i in range(a.shape[0]):
        c = 0
        for j in range(a.shape[1]):
            for k in range(j, a.shape[1]):
                products[i, c + k - j] = a[i, j] * a[i, k]
            c += a.shape[1] - j


@inner
def _all_products(a, b, products):  # type: ignore[no-untyped-def]
    """Write a_j b_k of every row into ``products``."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(b.shape[1]):
                products[i, j * b.shape[1] + k] = a[i, j] * b[i, k]


@inner(fastmath=FASTMATH)
def _add_products(a, b, total):  # type: ignore[no-untyped-def]
    """Add sum_i a_ij b_ik to ``total`` (j, k), four rows at a time."""
    for i in range(0, a.shape[0], 4):
        p, q, r, s = b[i], b[i + 1], b[i + 2], b[i + 3]
        for j in range(a.shape[1]):
            pj, qj, rj, sj, row = a[i, j], a[i + 1, j], a[i + 2, j], a[i + 3, j], total[j]
            for k in range(row.shape[0]):
                row[k] += pj * p[k] + qj * q[k] + rj * r[k] + sj * s[k]


@inner
def _add_in_float32(a, b, total):  # type: ignore[no-untyped-def]
    """Do the same, with sums over the rows in float32; ``b`` is padded to whole vectors."""
    tile = np.zeros(total.shape, np.float32)
    add_sums(a, b, tile)
    for j in range(total.shape[0]):
        for k in range(total.shape[1]):
            total[j, k] += tile[j, k]


@kernel(fastmath=FASTMATH)
def solve_positive(matrix, right):  # type: ignore[no-untyped-def]
    """Replace ``right`` (n,) by the solution of ``matrix`` times it, and ``matrix`` (n, n) by its Cholesky factor.

    Returns whether the symmetric matrix, of which the upper half is read, is positive definite. Rows are worked on a
    few at a time, so that those that all others are subtracted from stay in the cache.
    """
    n = matrix.shape[0]
    for first in range(0, n, _BLOCK):
        last = min(first + _BLOCK, n)
        for i in range(first, last):
            _subtract_rows(matrix, first, i, i, 1)
            if not matrix[i, i] > 0:
                return False
            pivot = np.sqrt(matrix[i, i])
            for e in range(i, n):
                matrix[i, e] /= pivot
        for i in range(last, n, 2):
            _subtract_rows(matrix, first, last, i, min(2, n - i))
    for i in range(n):
        right[i] /= matrix[i, i]
        for e in range(i + 1, n):
            right[e] -= matrix[i, e] * right[i]
    for i in range(n - 1, -1, -1):
        total = right[i]
        for e in range(i + 1, n):
            total -= matrix[i, e] * right[e]
        right[i] = total / matrix[i, i]
    return True


@inner(fastmath=FASTMATH)
def _subtract_rows(matrix, begin, end, i, count):  # type: ignore[no-untyped-def]
    """Subtract from row ``i``, or two where ``count`` is 2, each row from ``begin`` to ``end`` times its entry there.

    Three rows at a time, from two: what is loaded is used several times.
    """
    n = matrix.shape[0]
    for first in range(i, n, _ROWS):
        last = min(first + _ROWS, n)
        a, b = matrix[i, first:last], matrix[i + count - 1, first:last]
        for k in range(begin, end - 2, 3):
            p, q, r = matrix[k, first:last], matrix[k + 1, first:last], matrix[k + 2, first:last]
            p0, q0, r0 = matrix[k, i], matrix[k + 1, i], matrix[k + 2, i]
            if count == 1:
                for e in range(a.shape[0]):
                    a[e] = a[e] - p0 * p[e] - q0 * q[e] - r0 * r[e]
            else:
                p1, q1, r1 = matrix[k, i + 1], matrix[k + 1, i + 1], matrix[k + 2, i + 1]
                for e in range(a.shape[0]):
                    a[e] = a[e] - p0 * p[e] - q0 * q[e] - r0 * r[e]
                    b[e] = b[e] - p1 * p[e] - q1 * q[e] - r1 * r[e]
        for k in range(end - (end - begin) % 3, end):
            p = matrix[k, first:last]
            for e in range(a.shape[0]):
                a[e] -= matrix[k, i] * p[e]
            if count == 2:
                for e in range(b.shape[0]):
                    b[e] -= matrix[k, i + 1] * p[e]
