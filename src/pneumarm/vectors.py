"""What networks spend their time on, in vector instructions: the loops that a compiler leaves slow where sizes are small.

A compiler turns a loop over a few hundred units into good vector instructions. Networks here have 5 to 50, of which the
compiler does not know how many; it adds up in memory, in pieces of different widths, and spends more instructions on
finding the way than on numbers. These functions are that loop written for the machine: ``LANES`` (or twice as many)
units at once, their sums in registers over all inputs. Every sum is made in the order of its inputs, so what comes out
does not depend on how wide the machine's vectors are.

Each is an ordinary function, which says what it does and runs as plain Python, with a translation for kernels
(:mod:`pneumarm.kernels`). Arrays are float32 and C-contiguous.
"""

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array
from numpy import float32
from numpy.typing import NDArray

LANES = 8
"""Units are padded to a multiple of this."""
ROWS = 4
"""Inputs are padded to a multiple of this."""

_Floats = NDArray[float32]
_INLINE = {"forceinline": True, "_nrt": False, "nogil": True, "error_model": "numpy"}
_ALIGNED = 4  # bytes
_CONTRACT = ("contract",)  # a product and a sum may become one instruction, which rounds once


def weighted_sums(x: _Floats, weights: _Floats, sums: _Floats, first: int) -> None:
    """Set ``sums[first + u]`` to the sum over i of ``x[i] weights[i, u]``, added up in the order of i.

    Args:
        x: shape (inputs,), a multiple of ``ROWS``.
        weights: shape (at least inputs, units), units a multiple of ``LANES``.
        sums: shape (at least first + units,); not overlapping the others.
        first: where to begin in ``sums``.

    """
    sums[first : first + weights.shape[1]] = 0
    for i in range(x.shape[0]):
        sums[first : first + weights.shape[1]] += x[i] * weights[i]


def add_products(table: _Floats, x: _Floats, factors: _Floats) -> None:
    """Add ``x[i] factors[u]`` to ``table[i, u]``.

    Args:
        table: shape (at least inputs, units), units a multiple of ``LANES``; not overlapping the others.
        x: shape (inputs,), a multiple of ``ROWS``.
        factors: shape (at least units,).

    """
    for i in range(x.shape[0]):
        table[i] += x[i] * factors[: table.shape[1]]


def follow(table: _Floats, traces: _Floats, factor: float32, decay: float32) -> None:
    """Add ``factor`` times ``traces`` to ``table``, both (rows, units), and multiply ``traces`` by ``decay``.

    Units are a multiple of ``LANES``; the two do not overlap.
    """
    table += factor * traces
    traces *= decay


class _Table:
    """An array of a kernel while code for the kernel is made: what is at an index, in as many lanes as are wanted."""

    def __init__(self, context: Any, builder: Any, kind: types.Array, value: Any) -> None:
        array = make_array(kind)(context, builder, value)
        self._builder, self._data = builder, array.data
        self.shape = cgutils.unpack_tuple(builder, array.shape)

    def _place(self, index: Any, lanes: int) -> Any:
        kind = ir.VectorType(ir.FloatType(), lanes).as_pointer()
        return self._builder.bitcast(self._builder.gep(self._data, [index]), kind)

    def load(self, index: Any, lanes: int) -> Any:
        return self._builder.load(self._place(index, lanes), align=_ALIGNED)

    def store(self, value: Any, index: Any, lanes: int) -> None:
        self._builder.store(value, self._place(index, lanes), align=_ALIGNED)

    def spread(self, index: Any, lanes: int) -> Any:
        """Return the number at ``index`` in every lane."""
        return _spread(self._builder, self._builder.load(self._builder.gep(self._data, [index])), lanes)


def _spread(builder: Any, number: Any, lanes: int) -> Any:
    """Return a vector with ``number`` in every lane."""
    kind, index = ir.VectorType(ir.FloatType(), lanes), ir.IntType(32)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), number, ir.Constant(index, 0))
    everywhere = ir.Constant(ir.VectorType(index, lanes), [0] * lanes)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), everywhere)


def _multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    return builder.fadd(builder.fmul(a, b, flags=_CONTRACT), c, flags=_CONTRACT)


def _blocks(builder: Any, count: Any, body: Callable[[Any, int], None]) -> None:
    """Call ``body(first, lanes)`` for vectors of ``count`` units; wide ones where the count allows it."""
    zero = ir.Constant(count.type, 0)
    wide = ir.Constant(count.type, 2 * LANES)
    is_wide = builder.icmp_unsigned("==", builder.urem(count, wide), zero)
    with builder.if_else(is_wide) as cases:
        for case, lanes in zip(cases, (2 * LANES, LANES), strict=True):
            with case, cgutils.for_range_slice(builder, zero, count, ir.Constant(count.type, lanes)) as (first, _):
                body(first, lanes)


def _rows(builder: Any, count: Any, body: Callable[[Any], None]) -> None:
    """Call ``body(row)`` for rows up to ``count``, a multiple of ``ROWS``, so many between two tests for the end."""
    zero, step = ir.Constant(count.type, 0), ir.Constant(count.type, ROWS)
    with cgutils.for_range_slice(builder, zero, count, step) as (first, _):
        for k in range(ROWS):
            body(builder.add(first, ir.Constant(count.type, k)))


def _tables(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> list[_Table]:
    return [
        _Table(context, builder, kind, value)
        for kind, value in zip(signature.args, args, strict=True)
        if isinstance(kind, types.Array)
    ]


@intrinsic
def _weighted_sums(typing: Any, x: Any, weights: Any, sums: Any, first: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        x, weights, sums = _tables(context, builder, signature, args)
        units = weights.shape[1]

        def block(u: Any, lanes: int) -> None:
            total = cgutils.alloca_once_value(builder, ir.Constant(ir.VectorType(ir.FloatType(), lanes), None))
            builder.store(ir.Constant(ir.VectorType(ir.FloatType(), lanes), None), total)

            def row(i: Any) -> None:
                weight = weights.load(builder.add(builder.mul(i, units), u), lanes)
                builder.store(_multiply_add(builder, x.spread(i, lanes), weight, builder.load(total)), total)

            _rows(builder, x.shape[0], row)
            sums.store(builder.load(total), builder.add(args[3], u), lanes)

        _blocks(builder, units, block)
        return context.get_dummy_value()

    return types.void(x, weights, sums, types.intp), generate


@intrinsic
def _add_products(typing: Any, table: Any, x: Any, factors: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        table, x, factors = _tables(context, builder, signature, args)
        units = table.shape[1]

        def block(u: Any, lanes: int) -> None:
            factor = factors.load(u, lanes)

            def row(i: Any) -> None:
                place = builder.add(builder.mul(i, units), u)
                moved = _multiply_add(builder, x.spread(i, lanes), factor, table.load(place, lanes))
                table.store(moved, place, lanes)

            _rows(builder, x.shape[0], row)

        _blocks(builder, units, block)
        return context.get_dummy_value()

    return types.void(table, x, factors), generate


@intrinsic
def _follow(typing: Any, table: Any, traces: Any, factor: Any, decay: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        table, traces = _tables(context, builder, signature, args)
        _, _, factor, decay = args

        def block(u: Any, lanes: int) -> None:
            trace = traces.load(u, lanes)
            moved = _multiply_add(builder, _spread(builder, factor, lanes), trace, table.load(u, lanes))
            table.store(moved, u, lanes)
            traces.store(builder.fmul(trace, _spread(builder, decay, lanes)), u, lanes)

        _blocks(builder, builder.mul(*table.shape), block)
        return context.get_dummy_value()

    return types.void(table, traces, types.float32, types.float32), generate


# Translations for kernels.
overload(weighted_sums, jit_options=_INLINE)(lambda x, weights, sums, first: _call_weighted_sums)
overload(add_products, jit_options=_INLINE)(lambda table, x, factors: _call_add_products)
overload(follow, jit_options=_INLINE)(lambda table, traces, factor, decay: _call_follow)


def _call_weighted_sums(x, weights, sums, first):  # type: ignore[no-untyped-def]
    _weighted_sums(x, weights, sums, first)


def _call_add_products(table, x, factors):  # type: ignore[no-untyped-def]
    _add_products(table, x, factors)


def _call_follow(table, traces, factor, decay):  # type: ignore[no-untyped-def]
    _follow(table, traces, factor, decay)
