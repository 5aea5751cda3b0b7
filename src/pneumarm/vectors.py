"""The loops that networks spend their time in, as vector instructions.

A compiler turns a loop over a few hundred units into good vector instructions. Networks here have 5 to 50, and it
does not know how many: it adds up in memory, in pieces of different widths, and spends more instructions on finding
the way than on numbers. These functions are such loops written for the machine: ``LANES`` units at once (or twice as
many), their sums in registers over all inputs. Every sum is made in the order of its inputs, so what comes out does
not depend on how wide the machine's vectors are.

Each is an ordinary function, which says what it does and runs as plain Python, with a translation for kernels
(:mod:`pneumarm.kernels`). Arrays are float32 and C-contiguous, unless a function says otherwise.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array
from numpy import float32
from numpy.typing import NDArray

from pneumarm.kernels import PART

LANES = 8
"""Units are padded to a multiple of this."""
ROWS = 4
"""Inputs are padded to a multiple of this."""

_Floats = NDArray[float32]
_ALIGNED = 4  # bytes
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
        sums += x[i] * weights[i, first : first + sums.shape[0]]


def add_products(table: _Floats, first: int, x: _Floats, factors: _Floats) -> None:
    """Add ``x[i] factors[u]`` to ``table[i, first + u]``.

    Args:
        table: shape (at least inputs, at least first + units); not overlapping the others.
        first: where to begin in its rows.
        x: shape (inputs,), a multiple of ``ROWS``.
        factors: shape (units,), a multiple of ``LANES``.

    """
    for i in range(x.shape[0]):
        table[i, first : first + factors.shape[0]] += x[i] * factors


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
    table[:, first : first + units] += factor * traces[:, first : first + units]
    traces[:, first : first + units] *= decay


def add_sums(weights: _Floats, x: _Floats, out: _Floats) -> None:
    """Add W^T x to ``out``: to each row of it the rows of ``x``, weighted, in their order.

    Args:
        weights: shape (at least inputs, at least outputs), of any strides.
        x: shape (inputs, n), rows contiguous.
        out: shape (outputs, n), rows contiguous; not overlapping the others.

    """
    for o in range(out.shape[0]):
        for i in range(x.shape[0]):
            out[o] += weights[i, o] * x[i]


class _Table:
    """An array of a kernel while code for the kernel is made: what is at an index, in as many lanes as are wanted."""

    def __init__(self, context: Any, builder: Any, kind: types.Array, value: Any) -> None:
        array = make_array(kind)(context, builder, value)
        self._builder, self._data = builder, array.data
        self.shape = cgutils.unpack_tuple(builder, array.shape)
        self._strides = cgutils.unpack_tuple(builder, array.strides)  # bytes

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

    def place(self, row: Any, column: Any) -> Any:
        """Return the index of ``column`` in ``row`` of a matrix, whatever its strides are."""
        size = ir.Constant(row.type, 4)
        parts = [self._builder.mul(at, stride) for at, stride in zip((row, column), self._strides, strict=True)]
        return self._builder.sdiv(self._builder.add(*parts), size, flags=["exact"])


def _spread(builder: Any, number: Any, lanes: int) -> Any:
    """Return a vector with ``number`` in every lane."""
    kind, index = ir.VectorType(ir.FloatType(), lanes), ir.IntType(32)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), number, ir.Constant(index, 0))
    everywhere = ir.Constant(ir.VectorType(index, lanes), [0] * lanes)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), everywhere)


def _multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    return builder.fadd(builder.fmul(a, b, flags=_CONTRACT), c, flags=_CONTRACT)


def _blocks(builder: Any, count: Any, body: Callable[[list[Any], int], None], at_once: Sequence[int] = (1,)) -> None:
    """Call ``body(places, lanes)`` for all vectors of ``count`` units, so many ``at_once`` while there are so many.

    Vectors are wide ones where the count allows it.
    """
    kind = count.type
    is_wide = builder.icmp_unsigned("==", builder.urem(count, kind(2 * LANES)), kind(0))
    with builder.if_else(is_wide) as cases:
        for case, lanes in zip(cases, (2 * LANES, LANES), strict=True):
            with case:
                begin = kind(0)
                for vectors in at_once:
                    step = kind(vectors * lanes)
                    left = builder.sub(count, begin)
                    end = builder.add(begin, builder.sub(left, builder.urem(left, step)))
                    with cgutils.for_range_slice(builder, begin, end, step) as (first, _):
                        body([builder.add(first, kind(k * lanes)) for k in range(vectors)], lanes)
                    begin = end


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
def _weighted_sums(typing: Any, x: Any, weights: Any, first: Any, sums: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        x, weights, sums = _tables(context, builder, signature, args)

        def block(places: list[Any], lanes: int) -> None:
            zero = ir.Constant(ir.VectorType(ir.FloatType(), lanes), None)
            totals = [cgutils.alloca_once(builder, zero.type) for _ in places]
            for total in totals:
                builder.store(zero, total)

            def row(i: Any) -> None:
                begin, number = builder.add(builder.mul(i, weights.shape[1]), args[2]), x.spread(i, lanes)
                for total, place in zip(totals, places, strict=True):
                    weight = weights.load(builder.add(begin, place), lanes)
                    builder.store(_multiply_add(builder, number, weight, builder.load(total)), total)

            _rows(builder, x.shape[0], row)
            for total, place in zip(totals, places, strict=True):
                sums.store(builder.load(total), place, lanes)

        _blocks(builder, sums.shape[0], block, at_once=(4, 2, 1))
        return context.get_dummy_value()

    return types.void(x, weights, types.intp, sums), generate


@intrinsic
def _add_products(typing: Any, table: Any, first: Any, x: Any, factors: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        table, x, factors = _tables(context, builder, signature, args)

        def block(places: list[Any], lanes: int) -> None:
            (u,) = places
            factor = factors.load(u, lanes)

            def row(i: Any) -> None:
                place = builder.add(builder.add(builder.mul(i, table.shape[1]), args[1]), u)
                moved = _multiply_add(builder, x.spread(i, lanes), factor, table.load(place, lanes))
                table.store(moved, place, lanes)

            _rows(builder, x.shape[0], row)

        _blocks(builder, factors.shape[0], block)
        return context.get_dummy_value()

    return types.void(table, types.intp, x, factors), generate


@intrinsic
def _follow(typing: Any, table: Any, traces: Any, first: Any, units: Any, factor: Any, decay: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        table, traces = _tables(context, builder, signature, args)
        first, units, factor, decay = args[2:]

        def block(places: list[Any], lanes: int) -> None:
            factors, decays = (_spread(builder, number, lanes) for number in (factor, decay))
            with cgutils.for_range(builder, table.shape[0]) as loop:
                begin = builder.add(builder.mul(loop.index, table.shape[1]), first)
                place = builder.add(begin, places[0])
                trace = traces.load(place, lanes)
                table.store(_multiply_add(builder, factors, trace, table.load(place, lanes)), place, lanes)
                traces.store(builder.fmul(trace, decays), place, lanes)

        _blocks(builder, units, block)
        return context.get_dummy_value()

    return types.void(table, traces, types.intp, types.intp, types.float32, types.float32), generate


_TILES = (LANES, 3, (4, 1)), (LANES, 1, (8, 1)), (1, 1, (1,))
"""What is added up at once: lanes of a vector, vectors, rows of them; sixteen registers hold it with its factors."""


@intrinsic
def _add_sums(typing: Any, weights: Any, x: Any, out: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Sequence[Any]) -> Any:
        weights, x, out = _tables(context, builder, signature, args)
        kind = x.shape[0].type

        def tile(e: Any, lanes: int, vectors: int, first: Any, rows: int) -> None:
            """Add to so many ``rows`` of ``out``, from ``first`` on, at the samples from ``e`` on."""
            outputs = [builder.add(first, kind(r)) for r in range(rows)]
            samples = [builder.add(e, kind(v * lanes)) for v in range(vectors)]
            places = [out.place(o, at) for o in outputs for at in samples]
            totals = [cgutils.alloca_once_value(builder, out.load(place, lanes)) for place in places]
            with cgutils.for_range(builder, x.shape[0]) as loop:
                seen = [x.load(x.place(loop.index, at), lanes) for at in samples]
                factors = [weights.spread(weights.place(loop.index, o), lanes) for o in outputs]
                terms = [(factor, one) for factor in factors for one in seen]
                for total, (factor, one) in zip(totals, terms, strict=True):
                    builder.store(_multiply_add(builder, factor, one, builder.load(total)), total)
            for total, place in zip(totals, places, strict=True):
                out.store(builder.load(total), place, lanes)

        begin = kind(0)
        for lanes, vectors, heights in _TILES:
            with _steps(builder, begin, x.shape[1], lanes * vectors) as e:
                first = kind(0)
                for rows in heights:
                    with _steps(builder, first, out.shape[0], rows) as o:
                        tile(e, lanes, vectors, o, rows)
                    first = _last(builder, first, out.shape[0], rows)
            begin = _last(builder, begin, x.shape[1], lanes * vectors)
        return context.get_dummy_value()

    return types.void(weights, x, out), generate


def _last(builder: Any, begin: Any, end: Any, step: int) -> Any:
    """Return where whole steps from ``begin`` on, that do not go beyond ``end``, lead."""
    left = builder.sub(end, begin)
    return builder.sub(end, builder.urem(left, begin.type(step)))


@contextmanager
def _steps(builder: Any, begin: Any, end: Any, step: int) -> Iterator[Any]:
    """Give a number for each whole step from ``begin`` on, none of which goes beyond ``end``."""
    last = _last(builder, begin, end, step)
    with cgutils.for_range_slice(builder, begin, last, begin.type(step)) as (at, _):
        yield at


def _is_float32(*kinds: types.Array) -> bool:
    return all(kind.dtype == types.float32 for kind in kinds)


_CALLED: Any = {**PART, "forceinline": False}
"""What is long is in a kernel once, and called."""

# Translations for kernels.
overload(add_sums, jit_options=_CALLED)(
    lambda weights, x, out: _call_add_sums if _is_float32(weights, x, out) and x.layout == out.layout == "C" else None
)
overload(weighted_sums, jit_options=PART)(lambda x, weights, first, sums: _call_weighted_sums)
overload(add_products, jit_options=PART)(lambda table, first, x, factors: _call_add_products)
overload(follow, jit_options=PART)(lambda table, traces, first, units, factor, decay: _call_follow)


def _call_add_sums(weights, x, out):  # type: ignore[no-untyped-def]
    _add_sums(weights, x, out)  # type: ignore[call-arg]


def _call_weighted_sums(x, weights, first, sums):  # type: ignore[no-untyped-def]
    _weighted_sums(x, weights, first, sums)  # type: ignore[call-arg]


def _call_add_products(table, first, x, factors):  # type: ignore[no-untyped-def]
    _add_products(table, first, x, factors)  # type: ignore[call-arg]


def _call_follow(table, traces, first, units, factor, decay):  # type: ignore[no-untyped-def]
    _follow(table, traces, first, units, factor, decay)  # type: ignore[call-arg]
