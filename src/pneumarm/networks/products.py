"""The sums over rows that a fit by Levenberg-Marquardt is made of, as kernels.

Everything lies unit by unit, (units, rows), so that the sums run along memory. They are loops of our own rather than
a library's matrix products: those start threads of their own, for which fits on other threads would have to wait.
Sums may be split into the lanes of a vector (``reassoc``), in the same order in every run.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel

_TILE = 4
"""Sums along one side of the piece of a result that is held in registers; tables are padded to a multiple of it."""
_COLUMNS = 32
"""Columns of a matrix that is solved that are worked on at a time."""
_ROWS = 512
"""Rows whose products are in memory at once: few enough for the cache."""
_REORDERED = {"contract", "reassoc"}


class Sums(NamedTuple):
    """Sums over rows for a network with ``m`` inputs, ``h`` hidden units, ``o`` outputs; the last of m + 1 inputs x
    and of h + 1 hidden units is a constant 1.

    Letters as in :mod:`pneumarm.networks.levenberg_marquardt`; tables are padded at the end of both sides.
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
            return -(-count // _TILE) * _TILE

        return cls(
            xx_ss=np.zeros((padded(pairs(inputs)), padded(pairs(hidden)))),
            x_sh=np.zeros((padded(inputs), padded(hidden * (hidden + 1)))),
            hh=np.zeros((hidden + 1, hidden + 1)),
            x_se=np.zeros((inputs, hidden)),
            h_r=np.zeros((hidden + 1, outputs)),
        )


def pairs(count: int) -> int:
    """Return how many pairs j <= k < ``count`` there are."""
    return count * (count + 1) // 2


@kernel(fastmath=_REORDERED)
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
    # Tiles of a fixed size, so that they lie in one piece; where the last one is not full, its inputs, units and
    # residues are zero, and so is every product.
    x_now = np.zeros((sums.x_sh.shape[0], _ROWS), np.float32)
    h_now, r_now = np.empty((hidden + 1, _ROWS)), np.empty((r.shape[0], _ROWS))
    slope, slope_error = np.empty((hidden, _ROWS)), np.empty((hidden, _ROWS))
    xx = np.zeros((sums.xx_ss.shape[0], _ROWS), np.float32)
    ss = np.zeros((sums.xx_ss.shape[1], _ROWS), np.float32)
    sh = np.zeros((sums.x_sh.shape[1], _ROWS), np.float32)
    for begin in range(0, x.shape[1], _ROWS):
        _copy_tile(x, begin, x_now)
        _copy_tile(h, begin, h_now)
        _copy_tile(r, begin, r_now)
        _slopes(h_now, r_now, w, slope, slope_error)
        _add_dots(x_now, slope_error, sums.x_se)
        _add_dots(h_now, r_now, sums.h_r)
        _add_dots(h_now, h_now, sums.hh)
        _pair_products(x_now, inputs, xx)
        _pair_products(slope, hidden, ss)
        _all_products(slope, h_now, sh)
        _add_tiles(xx, ss, sums.xx_ss)
        _add_tiles(x_now, sh, sums.x_sh)


@inner
def _copy_tile(a, begin, tile):  # type: ignore[no-untyped-def]
    """Copy the rows of ``a`` (..., rows) from ``begin`` on into ``tile``, zeros where they end."""
    rows = min(a.shape[1] - begin, tile.shape[1])
    for j in range(a.shape[0]):
        for i in range(rows):
            tile[j, i] = a[j, begin + i]
        for i in range(rows, tile.shape[1]):
            tile[j, i] = 0


@inner
def _slopes(h, r, w, slope, slope_error):  # type: ignore[no-untyped-def]
    """Write s_j and s_j e_j, e = W r, of every row."""
    for j in range(slope.shape[0]):
        for i in range(slope.shape[1]):
            slope[j, i] = 1 - h[j, i] * h[j, i]
            slope_error[j, i] = 0.0
        for o in range(r.shape[0]):
            for i in range(slope.shape[1]):
                slope_error[j, i] += w[j, o] * r[o, i] * slope[j, i]


@inner
def _pair_products(a, units, products):  # type: ignore[no-untyped-def]
    """Write a_j a_k of the first ``units`` into ``products``, j <= k."""
    c = 0
    for j in range(units):
        for k in range(j, units):
            for i in range(a.shape[1]):
                products[c, i] = a[j, i] * a[k, i]
            c += 1


@inner
def _all_products(a, b, products):  # type: ignore[no-untyped-def]
    """Write a_j b_k of all units into ``products``."""
    for j in range(a.shape[0]):
        for k in range(b.shape[0]):
            for i in range(a.shape[1]):
                products[j * b.shape[0] + k, i] = a[j, i] * b[k, i]


@kernel(fastmath=_REORDERED)
def _add_dots(a, b, total):  # type: ignore[no-untyped-def]
    """Add sum_i a_ji b_ki to ``total`` (j, k)."""
    for j in range(total.shape[0]):
        for k in range(total.shape[1]):
            dot = 0.0
            for i in range(a.shape[1]):
                dot += a[j, i] * b[k, i]
            total[j, k] += dot


@kernel(fastmath=_REORDERED)
def _add_tiles(a, b, total):  # type: ignore[no-untyped-def]
    """Do the same for padded tables, two by four sums at a time: six loads for eight multiplications."""
    for j in range(0, a.shape[0], 2):
        a0, a1 = a[j], a[j + 1]
        for k in range(0, b.shape[0], _TILE):
            b0, b1, b2, b3 = b[k], b[k + 1], b[k + 2], b[k + 3]
            s00 = s01 = s02 = s03 = s10 = s11 = s12 = s13 = np.float32(0)
            for i in range(a.shape[1]):
                x, y = a0[i], a1[i]
                s00 += x * b0[i]
                s01 += x * b1[i]
                s02 += x * b2[i]
                s03 += x * b3[i]
                s10 += y * b0[i]
                s11 += y * b1[i]
                s12 += y * b2[i]
                s13 += y * b3[i]
            total[j, k] += s00
            total[j, k + 1] += s01
            total[j, k + 2] += s02
            total[j, k + 3] += s03
            total[j + 1, k] += s10
            total[j + 1, k + 1] += s11
            total[j + 1, k + 2] += s12
            total[j + 1, k + 3] += s13


@kernel(fastmath=_REORDERED)
def solve_positive(matrix, right):  # type: ignore[no-untyped-def]
    """Replace ``right`` (n,) by the solution of ``matrix`` times it, and ``matrix`` (n, n) by its Cholesky factor.

    Returns whether the symmetric matrix, of which the lower half is read, is positive definite. Columns are worked
    on a few at a time, so that the rows that all others are multiplied by stay in the cache.
    """
    n = matrix.shape[0]
    for first in range(0, n, _COLUMNS):
        last = min(first + _COLUMNS, n)
        _subtract_dots(matrix, first, last)
        for j in range(first, last):
            for i in range(j, n):
                dot = 0.0
                for k in range(first, j):
                    dot += matrix[i, k] * matrix[j, k]
                matrix[i, j] -= dot
            if not matrix[j, j] > 0:
                return False
            pivot = np.sqrt(matrix[j, j])
            for i in range(j, n):
                matrix[i, j] /= pivot
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        right[i] /= matrix[i, i]
        for k in range(i):
            right[k] -= matrix[i, k] * right[i]
    return True


@kernel(fastmath=_REORDERED)
def _subtract_dots(matrix, first, last):  # type: ignore[no-untyped-def]
    """Subtract from each entry in columns ``first`` to ``last`` the product of its two rows in the columns before.

    Two by four sums at a time, as in :func:`_add_tiles`.
    """
    n = matrix.shape[0]
    for i in range(first, n, 2):
        a0, a1 = matrix[i], matrix[min(i + 1, n - 1)]
        for j in range(first, min(last, i + 2), _TILE):
            b0, b1 = matrix[j], matrix[min(j + 1, n - 1)]
            b2, b3 = matrix[min(j + 2, n - 1)], matrix[min(j + 3, n - 1)]
            s00 = s01 = s02 = s03 = s10 = s11 = s12 = s13 = 0.0
            for k in range(first):
                x, y = a0[k], a1[k]
                s00 += x * b0[k]
                s01 += x * b1[k]
                s02 += x * b2[k]
                s03 += x * b3[k]
                s10 += y * b0[k]
                s11 += y * b1[k]
                s12 += y * b2[k]
                s13 += y * b3[k]
            for c, (upper, lower) in enumerate(((s00, s10), (s01, s11), (s02, s12), (s03, s13))):
                if j + c < last:
                    a0[j + c] -= upper
                    if i + 1 < n:
                        a1[j + c] -= lower
