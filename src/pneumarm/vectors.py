"""The loops that networks spend their time in, as vector instructions.

A compiler turns a loop over a few hundred units into good vector instructions. Networks here have 5 to 50, and it
does not know how many: it adds up in memory, in pieces of different widths, and spends more instructions on finding
the way than on numbers. So what is added up here stays in registers over all inputs, ``LANES`` units or samples at
once (:func:`_tile` and :func:`_product`, the code made by hand). Every sum is made in the order of its inputs, or of
its lanes, so what comes out does not depend on how wide the machine's vectors are.

Each is an ordinary function, which says what it does and runs as plain Python; kernels (:mod:`pneumarm.kernels`) have
loops of tiles in its place. Arrays are float32 and C-contiguous, unless a function says otherwise.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload
from numpy import float32
from numpy.typing import NDArray

from pneumarm.kernels import EXTENDED, INNER, PART, floats_of, inner, part

LANES = 8
"""Units are padded to a multiple of this."""
ROWS = 4
"""Inputs are padded to a multiple of this."""

_Floats = NDArray[float32]
_CONTRACT = ("contract",)  # a product and a sum may become one instruction, which rounds once


def weighted_sums(x: _Floats, weights: _Floats, first: int, sums: _Floats) -> None:
    """Set ``sums[u]`` to the sum over i of ``x[i] weights[i, first + u]``, added up in the order of i.

    Args:
        x: shape (inputs,), a multiple of ``ROWS``.
        weights: shape (at least inputs, at least first + units).
        first: where to begin in the rows of ``weights``.
        sums: shape (units,), a multiple of ``LANES``; not overlapping the others.

    """
    sums[:] = 0
    for i in range(x.shape[0]):
        for u in range(sums.shape[0]):
            sums[u] += x[i] * weights[i, first + u]


@part(fastmath={"contract"})
def add_products(table: _Floats, first: int, x: _Floats, factors: _Floats) -> None:
    """Add ``x[i] factors[u]`` to ``table[i, first + u]``.

    Args:
        table: shape (at least inputs, at least first + units); not overlapping the others.
        first: where to begin in its rows.
        x: shape (inputs,), a multiple of ``ROWS``.
        factors: shape (units,), a multiple of ``LANES``.

    """
    for i in range(x.shape[0]):
        for u in range(factors.shape[0]):
            table[i, np.uint64(first + u)] += x[i] * factors[u]  # an unsigned index needs no test for wrapping around


@part(fastmath={"contract"})
def follow(table: _Floats, traces: _Floats, first: int, units: int, factor: float32, decay: float32) -> None:
    """Add ``factor`` times ``traces`` to ``table`` and multiply ``traces`` by ``decay``, in some columns of both.

    Args:
        table: shape (rows, at least first + units).
        traces: same shape; not overlapping ``table``.
        first: where to begin in the rows.
        units: how many columns, a multiple of ``LANES``.
        factor: of the traces.
        decay: of the traces, afterwards.

    """
    for i in range(table.shape[0]):
        for u in range(first, first + units):
            trace = traces[i, np.uint64(u)]
            table[i, np.uint64(u)] += factor * trace
            traces[i, np.uint64(u)] = trace * decay


@inner
def put(to: _Floats, source: _Floats) -> None:
    """Copy ``source`` to ``to``, both (rows, n): in far less code than an assignment, which looks at the shapes."""
    for i in range(to.shape[0]):
        for e in range(to.shape[1]):
            to[i, e] = source[i, e]


def product(a: _Floats, b: _Floats) -> float32:
    """Return the sum of the products of ``a`` and ``b``, both (n,), a multiple of ``LANES``: a sum a lane."""
    return (a * b).reshape(-1, LANES).sum(axis=0).sum()


def add_sums(weights: Any, x: Any, out: Any) -> None:
    """Add W^T x to ``out``: to each row of it the rows of ``x``, weighted, in their order.

    Args:
        weights: shape (at least inputs, at least outputs), of any strides.
        x: shape (inputs, n), rows contiguous.
        out: shape (outputs, n), rows contiguous; not overlapping the others.

    """
    for o in range(out.shape[0]):
        for i in range(x.shape[0]):
            for e in range(x.shape[1]):
                out[o, e] += weights[i, o] * x[i, e]


def _tile(rows: int, vectors: int, lanes: int = LANES, anew: bool = False) -> Any:
    """Return, for kernels, a sum over inputs in ``rows`` times ``vectors`` of so many ``lanes``, held in registers.

    ``add(count, weights, w, w_input, w_row, x, e, x_input, out, o, o_row)`` adds to ``out``, for each row and each
    of the ``vectors * lanes`` columns, the sum over ``count`` inputs of weights times ``x``; ``anew``, it puts
    the sum there. After each array come the place of the first number in its memory and the steps from input
    to input, and from row to row.
    """

    @intrinsic
    def add(_: Any, count, weights, w, w_input, w_row, x, e, x_input, out, o, o_row):  # type: ignore[no-untyped-def]
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            count, weights, w, w_input, w_row, x, e, x_input, out, o, o_row = args
            weights, x, out = (floats_of(builder, array) for array in (weights, x, out))
            vector, place, index = ir.VectorType(ir.FloatType(), lanes), ir.IntType(64), ir.IntType(32)

            def vectors_at(array: Any, first: Any) -> list[Any]:
                at = [builder.add(first, place(v * lanes)) for v in range(vectors)]
                return [builder.bitcast(builder.gep(array, [one]), vector.as_pointer()) for one in at]

            def spread(number: Any) -> Any:
                undefined, everywhere = (
                    ir.Constant(vector, ir.Undefined),
                    ir.Constant(ir.VectorType(index, lanes), None),
                )
                return builder.shuffle_vector(
                    builder.insert_element(undefined, number, index(0)), undefined, everywhere
                )

            each = range(rows)
            places = [at for r in each for at in vectors_at(out, builder.add(o, builder.mul(o_row, place(r))))]
            begun = [ir.Constant(vector, None) if anew else builder.load(at, align=4) for at in places]
            before, loop, after = builder.block, builder.append_basic_block(), builder.append_basic_block()
            builder.cbranch(builder.icmp_signed(">", count, place(0)), loop, after)
            builder.position_at_end(loop)
            i, *totals = (builder.phi(kind) for kind in (place, *(vector for _ in places)))
            seen = [builder.load(at, align=4) for at in vectors_at(x, builder.add(e, builder.mul(i, x_input)))]
            first = builder.add(w, builder.mul(i, w_input))
            factors = [builder.gep(weights, [builder.add(first, builder.mul(w_row, place(r)))]) for r in each]
            terms = [builder.fmul(spread(builder.load(one)), of, flags=_CONTRACT) for one in factors for of in seen]
            summed = [builder.fadd(*both, flags=_CONTRACT) for both in zip(terms, totals, strict=True)]
            ahead = builder.add(i, place(1))
            builder.cbranch(builder.icmp_signed("<", ahead, count), loop, after)
            builder.position_at_end(after)
            for phi, begin, later in zip((i, *totals), (place(0), *begun), (ahead, *summed), strict=True):
                phi.add_incoming(begin, before)
                phi.add_incoming(later, loop)
            ends = [builder.phi(vector) for _ in places]
            for phi, at, begin, later in zip(ends, places, begun, summed, strict=True):
                phi.add_incoming(begin, before)
                phi.add_incoming(later, loop)
                builder.store(phi, at, align=4)
            return context.get_dummy_value()

        steps = types.intp, types.intp
        return types.void(types.intp, weights, *steps, types.intp, x, *steps, out, *steps), generate

    return add


_anew_1, _anew_2, _anew_4 = _tile(1, 1, anew=True), _tile(1, 2, anew=True), _tile(1, 4, anew=True)
_add_4_3, _add_1_3, _add_8_1, _add_1_1, _add_1 = _tile(4, 3), _tile(1, 3), _tile(8, 1), _tile(1, 1), _tile(1, 1, 1)
"""Rows, vectors, and where it is a single number and no vector: what sixteen registers hold with the factors."""


@intrinsic
def _product(_: Any, count, a, b):  # type: ignore[no-untyped-def]
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        count, *arrays = args
        vector, place, lane = ir.VectorType(ir.FloatType(), LANES), ir.IntType(64), ir.IntType(32)
        arrays = [floats_of(builder, array) for array in arrays]
        before, loop, after = builder.block, builder.append_basic_block(), builder.append_basic_block()
        builder.branch(loop)
        builder.position_at_end(loop)
        i, total = builder.phi(place), builder.phi(vector)
        places = [builder.bitcast(builder.gep(array, [i]), vector.as_pointer()) for array in arrays]
        term = builder.fmul(*(builder.load(at, align=4) for at in places), flags=_CONTRACT)
        summed, ahead = builder.fadd(term, total, flags=_CONTRACT), builder.add(i, place(LANES))
        builder.cbranch(builder.icmp_signed("<", ahead, count), loop, after)
        for phi, begin, later in ((i, place(0), ahead), (total, ir.Constant(vector, None), summed)):
            phi.add_incoming(begin, before)
            phi.add_incoming(later, loop)
        builder.position_at_end(after)
        sums = [builder.extract_element(summed, lane(k)) for k in range(LANES)]
        while len(sums) > 1:
            sums = [builder.fadd(*pair) for pair in zip(sums[::2], sums[1::2], strict=True)]
        return sums[0]

    return types.float32(types.intp, a, b), generate


@overload(product, jit_options=PART)
def _products(a: _Floats, b: _Floats) -> Any:
    return _product_in_lanes if EXTENDED else _plain_product


def _product_in_lanes(a: _Floats, b: _Floats) -> Any:
    return _product(a.shape[0], a, b) if a.shape[0] > 0 else float32(0.0)  # type: ignore[call-arg]


def _plain_product(a: _Floats, b: _Floats) -> Any:
    total = float32(0.0)
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@overload(weighted_sums, jit_options=PART)
def _weighted_sums(x: _Floats, weights: _Floats, first: int, sums: _Floats) -> Any:
    return _weighted_in_tiles if EXTENDED else weighted_sums


def _weighted_in_tiles(x: _Floats, weights: _Floats, first: int, sums: _Floats) -> Any:
    inputs, units, width = x.shape[0], sums.shape[0], weights.shape[1]
    u = 0
    while u + 4 * LANES <= units:
        _anew_4(inputs, x, 0, 1, 0, weights, first + u, width, sums, u, 0)
        u += 4 * LANES
    if u + 2 * LANES <= units:
        _anew_2(inputs, x, 0, 1, 0, weights, first + u, width, sums, u, 0)
        u += 2 * LANES
    if u < units:
        _anew_1(inputs, x, 0, 1, 0, weights, first + u, width, sums, u, 0)


@overload(add_sums, jit_options=INNER)
def _add_sums(weights: Any, x: Any, out: Any) -> Any:
    if not weights.dtype == x.dtype == out.dtype == types.float32 or not x.layout == out.layout == "C":
        return None
    return _added_in_tiles if EXTENDED else add_sums


def _added_in_tiles(weights: Any, x: Any, out: Any) -> Any:
    inputs, samples, outputs = x.shape[0], x.shape[1], out.shape[0]
    down, across = weights.strides[0] // 4, weights.strides[1] // 4
    e = 0
    while e + 3 * LANES <= samples:
        o = 0
        while o + 4 <= outputs:
            place = o * samples + e
            _add_4_3(inputs, weights, o * across, down, across, x, e, samples, out, place, samples)
            o += 4
        while o < outputs:
            _add_1_3(inputs, weights, o * across, down, 0, x, e, samples, out, o * samples + e, 0)
            o += 1
        e += 3 * LANES
    while e + LANES <= samples:
        o = 0
        while o + 8 <= outputs:
            place = o * samples + e
            _add_8_1(inputs, weights, o * across, down, across, x, e, samples, out, place, samples)
            o += 8
        while o < outputs:
            _add_1_1(inputs, weights, o * across, down, 0, x, e, samples, out, o * samples + e, 0)
            o += 1
        e += LANES
    while e < samples:
        for o in range(outputs):
            _add_1(inputs, weights, o * across, down, 0, x, e, samples, out, o * samples + e, 0)
        e += 1
