"""Kernels as C99: the same statements, so that Python and a board do the same.

What can be translated is the part of Python that reads the same in both languages: functions of numbers and arrays
of a fixed shape, assignments, ``if``, ``for`` over ``range``, arithmetic, comparisons, and calls of one another.
Anything else is refused by name and line. Arguments are known when a function is translated, or not:

- :class:`Constant` ones, named tuples of numbers and arrays, become literals and tables, which a board keeps in
  flash.
- :class:`Kept` ones, named tuples of arrays or single arrays, become static arrays: the state.
- An :class:`Array` or a kind of number is what the C function takes as an argument.

Whole numbers are C's ``int``, of 16 bits on a small board, unless ``np.int32`` says otherwise; double precision is
called ``real``, so that a board may do with single. A function is translated once for each kind of its arguments.
"""

import ast
import inspect
import operator
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NoReturn, TypeGuard

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import PneumarmError

_TYPES = {"int": "int", "int32": "int32_t", "float32": "float", "float64": "real", "bool": "bool"}
_STORED = {"int64": "int16_t", "int32": "int32_t", "int16": "int16_t", "int8": "int8_t", "bool": "bool"}
_STORED |= {"float32": "float", "float64": "real"}
_ORDER = ("bool", "int", "int32", "float32", "float64")
"""A number of two kinds takes the later; a float32 with a whole number is refused, as Numba makes it double."""
_OPERATORS: dict[type[ast.operator], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.FloorDiv: ("/", operator.floordiv),
    ast.Mod: ("%", operator.mod),
    ast.RShift: (">>", operator.rshift),
    ast.LShift: ("<<", operator.lshift),
}
"""What both languages have; the division and the rest of whole numbers are the same where these are not negative."""
_COMPARISONS: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], bool]]] = {
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}
_A_LINE = 12
"""Numbers in a line of a table."""


@dataclass(frozen=True)
class Constant:
    """An argument that does not change: a number, an array, or a named tuple of such."""

    value: Any
    name: str


@dataclass(frozen=True)
class Kept:
    """An argument that is kept from call to call: an array, or a named tuple of such, as it is at first."""

    value: Any
    name: str


@dataclass(frozen=True)
class Array:
    """Numbers in memory: a static array, a table in flash, or what a pointer leads to."""

    kind: str
    """NumPy's name of the kind of its numbers."""
    shape: tuple[int, ...]
    place: str = ""
    """How C says where it begins."""
    constant: bool = False
    passed: bool = True
    """Whether a function has to be told where it is."""


@dataclass(frozen=True)
class _Number:
    """A number in C."""

    text: str
    kind: str
    value: Any = None
    """What it is, where that is known."""


_Value = Constant | Kept | Array | _Number


class Translator:
    """Translates functions, and keeps what came of it in order."""

    def __init__(self) -> None:
        self.tables: dict[str, str] = {}
        """Declarations of tables and static arrays by name."""
        self.functions: list[str] = []
        self._made: dict[Any, tuple[str, str | None]] = {}
        self._names: set[str] = set()

    def function(self, function: Any, *arguments: Constant | Kept | Array | str) -> str:
        """Translate ``function`` and return its name; a kind of number ("float64") stands for an argument."""
        given = [_Number("", one) if isinstance(one, str) else one for one in arguments]
        return self.made_of(function, given)[0]

    def array(self, value: NDArray[Any], name: str, constant: bool) -> Array:
        """Return where ``value`` lies, declared once."""
        kind = _STORED[value.dtype.name]
        if constant and value.dtype.name == "int64" and not (np.abs(value) <= np.iinfo(np.int16).max).all():
            raise PneumarmError(f"{name}: whole numbers of 16 bits are wanted")
        if not value.size:  # C has no empty arrays; nobody reads this number
            value = np.zeros((1,) * value.ndim, value.dtype)
        if name not in self.tables:
            if not constant and not value.any():
                self.tables[name] = f"static {kind} {name}[{value.size}];"
            else:
                numbers = [literal(one, value.dtype.name) for one in value.ravel().tolist()]
                rows = [", ".join(numbers[i : i + _A_LINE]) for i in range(0, len(numbers), _A_LINE)]
                before, after = ("static const ", " IN_FLASH") if constant else ("static ", "")
                self.tables[name] = f"{before}{kind} {name}[{value.size}]{after} = {{\n\t" + ",\n\t".join(rows) + "};"
        return Array(value.dtype.name, value.shape, name, constant, False)

    def made_of(self, function: Any, arguments: list[Any]) -> tuple[str, str | None]:
        """Translate ``function`` for values of any sort; return its name and the kind of what it returns."""
        plain = getattr(function, "py_func", function)
        key = (plain, *(_key(one) for one in arguments))
        if key not in self._made:
            name, number = plain.__name__.lstrip("_"), 2
            while name in self._names:
                name, number = f"{plain.__name__.lstrip('_')}_{number}", number + 1
            self._names.add(name)
            self._made[key] = _Function(self, plain, name, arguments).written()
        return self._made[key]

    def text(self) -> str:
        """Return all of it as C."""
        return "\n".join(self.tables.values()) + "\n\n" + "\n\n".join(self.functions) + "\n"


def _key(one: _Value) -> Any:
    if isinstance(one, Constant | Kept):
        return type(one), one.name
    if isinstance(one, Array):
        return one.kind, one.shape, one.constant, "" if one.passed else one.place
    return one.kind


def literal(value: Any, kind: str) -> str:
    """Return a number as C writes it."""
    if kind in ("float32", "float64"):
        if np.isinf(value):
            return "INFINITY" if value > 0 else "-INFINITY"
        if kind == "float32":
            return f"{np.format_float_scientific(np.float32(value), unique=True, trim='0')}f"
        return f"REAL({float(value)!r})"
    return str(int(value))


class _Function:
    """One function on its way to C."""

    def __init__(self, whole: Translator, function: Callable[..., Any], name: str, arguments: list[_Value]) -> None:
        self._whole, self._function, self._name = whole, function, name
        lines, self._first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self._tree = tree
        self._result: str | None = None
        self._names: dict[str, _Value] = {}
        self._locals: dict[str, str] = {}
        self._takes: list[str] = []
        names = [one.arg for one in tree.args.args]
        if len(names) != len(arguments):
            raise PneumarmError(f"{function.__name__} takes {len(names)} arguments, got {len(arguments)}")
        for parameter, one in zip(names, arguments, strict=True):
            self._names[parameter] = self._parameter(parameter, one)

    def _parameter(self, name: str, one: _Value) -> _Value:
        if isinstance(one, Array) and one.passed:
            self._takes.append(f"{'const ' if one.constant else ''}{_STORED[one.kind]} *{name}")
            return Array(one.kind, one.shape, name, one.constant)
        if isinstance(one, _Number) and one.value is None:
            self._takes.append(f"{_TYPES[one.kind]} {name}")
            return _Number(name, one.kind)
        return one

    def written(self) -> tuple[str, str | None]:
        """Translate it, with what it calls before it; return its name and the kind of what it returns."""
        body = self._tree.body
        told = ast.get_docstring(self._tree)
        lines = list(self._block(body[1:] if told else body, 1))
        declared = [f"\t{_TYPES[kind]} {name};" for name, kind in self._locals.items()]
        result = "void" if self._result is None else _TYPES[self._result]
        head = f"static {result} {self._name}({', '.join(self._takes) or 'void'})"
        note = f"/* {told.splitlines()[0].replace('``', '')} */\n" if told else ""
        self._whole.functions.append("\n".join([f"{note}{head}", "{", *declared, *lines, "}"]))
        return self._name, self._result

    def _refuse(self, node: ast.AST, why: str) -> NoReturn:
        line = self._first + getattr(node, "lineno", 1) - 1
        raise PneumarmError(f"{self._function.__module__}, line {line}: {why}: {ast.unparse(node)}")

    def _block(self, statements: list[ast.stmt], depth: int) -> Iterator[str]:
        for statement in statements:
            for line in self._statement(statement, depth):
                yield line if line.startswith("\t") else "\t" * depth + line

    def _statement(self, node: ast.stmt, depth: int) -> Iterator[str]:
        match node:
            case ast.Assign(targets=[target], value=value):
                yield from self._assigned(node, target, value)
            case ast.AugAssign(target=target, op=op, value=value):
                reading = ast.parse(ast.unparse(target), mode="eval").body
                yield from self._put(target, self._binary(node, op, self._number(reading), self._number(value)))
            case ast.If(test=test, body=body, orelse=other):
                yield from self._branches(self._number(test), body, other, depth)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=bounds), orelse=[]):
                yield from self._loop(node, name, bounds, depth)
            case ast.Return(value=None):
                yield "return;"
            case ast.Return(value=value) if value is not None:
                found = self._number(value)
                self._result = found.kind if self._result in (None, found.kind) else self._refuse(node, "two kinds")
                yield f"return {found.text};"
            case ast.Expr(value=ast.Call() as call):
                yield self._call(call).text + ";"
            case ast.Continue() | ast.Break():
                yield "continue;" if isinstance(node, ast.Continue) else "break;"
            case _:
                self._refuse(node, "a statement that C has not")

    def _branches(self, test: _Number, body: list[ast.stmt], other: list[ast.stmt], depth: int) -> Iterator[str]:
        if test.value is not None:
            yield from self._block(body if test.value else other, depth)
            return
        yield f"if ({_bare(test.text)}) {{"
        yield from self._block(body, depth + 1)
        if other:
            yield "} else {"
            yield from self._block(other, depth + 1)
        yield "}"

    def _loop(self, node: ast.For, name: str, bounds: list[ast.expr], depth: int) -> Iterator[str]:
        limits = [self._number(one) for one in bounds]
        if len(limits) == 1:
            limits.insert(0, _Number("0", "int", 0))
        step = limits[2].value if len(limits) > 2 else 1
        changed = {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
        if step not in (1, -1) or changed & {
            one.id for b in bounds for one in ast.walk(b) if isinstance(one, ast.Name)
        }:
            self._refuse(node, "a loop in steps of 1 between bounds that stay is wanted")
        before, self._names[name] = self._names.get(name), _Number(name, "int")
        compare, move = ("<", "++") if step == 1 else (">", "--")
        yield f"for (int {name} = {limits[0].text}; {name} {compare} {limits[1].text}; {name}{move}) {{"
        yield from self._block(node.body, depth + 1)
        yield "}"
        self._names.pop(name)
        if before is not None:
            self._names[name] = before

    def _assigned(self, node: ast.Assign, target: ast.expr, value: ast.expr) -> Iterator[str]:
        if not isinstance(target, ast.Tuple):
            yield from self._put(target, self._value(value))
            return
        if not isinstance(value, ast.Tuple):
            self._refuse(node, "as many values as names are wanted")
        for number, (one, what) in enumerate(zip(target.elts, value.elts, strict=True)):
            later = {ast.unparse(node) for other in value.elts[number + 1 :] for node in ast.walk(other)}
            if ast.unparse(one) in later:
                self._refuse(node, "one value after the other is assigned in C")
            yield from self._put(one, self._value(what))

    def _put(self, target: ast.expr, value: _Value) -> Iterator[str]:
        if isinstance(target, ast.Name):
            yield from self._named(target, value)
        elif isinstance(target, ast.Subscript) and isinstance(value, _Number):
            place = self._element(target)
            if place.kind == "table":
                self._refuse(target, "a table cannot be changed")
            yield f"{place.text} = {value.text};"
        else:
            self._refuse(target, "numbers are assigned to names and elements")

    def _named(self, target: ast.Name, value: _Value) -> Iterator[str]:
        name = target.id
        if not isinstance(value, _Number):  # another name for an array or a tuple of them
            self._names[name] = value
            return
        known = self._names.get(name)
        kind = self._locals.get(name) or (known.kind if isinstance(known, _Number) and known.text == name else None)
        if kind is None:
            kind = self._locals[name] = value.kind
        elif kind != value.kind and not (kind == "float64" and value.kind in ("float32", "int")):
            self._refuse(target, f"was {kind} before and is {value.kind} now")
        self._names[name] = _Number(name, kind)
        yield f"{name} = {_bare(value.text)};"

    def _value(self, node: ast.expr) -> _Value:
        match node:
            case ast.Name(id=name):
                return self._names[name] if name in self._names else self._global(node, name)
            case ast.Attribute(value=ast.Name(id="np"), attr="inf"):
                return self._known(np.inf)
            case ast.Attribute(value=value, attr=attr):
                return self._field(node, self._value(value), attr)
            case ast.Subscript(value=ast.Attribute(attr="shape")) | ast.Subscript():
                return self._subscript(node)
            case ast.Constant(value=value) if isinstance(value, bool | int | float):
                return self._known(value)
            case ast.UnaryOp(op=op, operand=operand):
                return self._unary(node, op, self._number(operand))
            case ast.BinOp(left=left, op=op, right=right):
                return self._binary(node, op, self._number(left), self._number(right))
            case ast.BoolOp(op=op, values=values):
                sign = " && " if isinstance(op, ast.And) else " || "
                return _Number(f"({sign.join(self._number(one).text for one in values)})", "bool")
            case ast.Compare(left=left, ops=ops, comparators=others):
                return self._compared(node, [left, *others], ops)
            case ast.IfExp(test=test, body=body, orelse=other):
                return self._chosen(node, self._number(test), self._number(body), self._number(other))
            case ast.Call(func=ast.Attribute(value=value, attr="ravel"), args=[]):
                array = self._as_array(self._value(value))
                assert isinstance(array, Array)
                return replace(array, shape=(int(np.prod(array.shape)),))
            case ast.Call():
                return self._call(node)
            case _:
                self._refuse(node, "an expression that C has not")

    def _number(self, node: ast.expr) -> _Number:
        value = self._value(node)
        return value if isinstance(value, _Number) else self._refuse(node, "a number is wanted")

    def _known(self, value: Any) -> _Number:
        kind = {bool: "bool", np.bool_: "bool", int: "int", float: "float64"}.get(type(value)) or (
            value.dtype.name if value.dtype.name in _TYPES else "int"
        )
        return _Number(literal(value, kind), kind, value)

    def _global(self, node: ast.AST, name: str) -> _Value:
        value = self._function.__globals__.get(name)
        if isinstance(value, bool | int | float | np.generic):
            return self._known(value)
        if isinstance(value, np.ndarray):
            return self._whole.array(value, name.lower().lstrip("_"), True)
        self._refuse(node, "a name that is no number")

    def _field(self, node: ast.AST, owner: _Value, attr: str) -> _Value:
        if not isinstance(owner, Constant | Kept) or not hasattr(owner.value, attr):
            self._refuse(node, "a field of a named tuple is wanted")
        value, name = getattr(owner.value, attr), f"{owner.name}_{attr}"
        if isinstance(value, np.ndarray):
            return self._whole.array(value, name, isinstance(owner, Constant))
        if isinstance(value, tuple):
            return type(owner)(value, name)
        return self._known(value)

    def _subscript(self, node: ast.Subscript) -> _Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            array = self._value(node.value.value)
            array = self._as_array(array)
            which = self._number(node.slice).value
            if not isinstance(array, Array) or which is None:
                self._refuse(node, "the shape of an array is wanted")
            return self._known(array.shape[which])
        return self._element(node, reading=True)

    def _as_array(self, value: _Value) -> _Value:
        if isinstance(value, Constant | Kept) and isinstance(value.value, np.ndarray):
            return self._whole.array(value.value, value.name, isinstance(value, Constant))
        return value

    def _element(self, node: ast.Subscript, reading: bool = False) -> Any:
        array = self._as_array(self._value(node.value))
        if not isinstance(array, Array):
            self._refuse(node, "an element of an array is wanted")
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(indices) > len(array.shape):
            self._refuse(node, f"has {len(array.shape)} indices")
        place, known = "", True
        for number, index in enumerate(indices):
            found, wide = self._number(index), int(np.prod(array.shape[number + 1 :]))
            known = known and found.value is not None
            if found.value == 0 and len(indices) > 1:
                continue
            place += (" + " if place else "") + (f"{found.text} * {wide}" if wide != 1 else found.text)
        place = place or "0"
        if len(indices) < len(array.shape):
            return Array(array.kind, array.shape[len(indices) :], f"({array.place} + {place})", array.constant)
        if not reading:
            return _Number(f"{array.place}[{place}]", "table" if array.constant else array.kind)
        kind = array.kind if array.kind in _TYPES else "int"
        return _Number(
            f"FROM_FLASH_{array.kind.upper()}({array.place} + {place})"
            if array.constant
            else f"{array.place}[{place}]",
            kind,
        )

    def _unary(self, node: ast.AST, op: ast.unaryop, one: _Number) -> _Number:
        if isinstance(op, ast.Not):
            return _Number(f"!{one.text}", "bool", None if one.value is None else not one.value)
        if isinstance(op, ast.USub):
            return _Number(f"(-{one.text})", one.kind, None if one.value is None else -one.value)
        self._refuse(node, "a sign that C has not")

    def _binary(self, node: ast.AST, op: ast.operator, left: _Number, right: _Number) -> _Number:
        if type(op) not in _OPERATORS:
            self._refuse(node, "an operator that C has not")
        sign, of = _OPERATORS[type(op)]
        kinds = {left.kind, right.kind} - {"bool"}
        if "float32" in kinds and kinds & {"int", "int32"}:
            self._refuse(node, "a whole number with a float32: say np.float32(...) of it")
        kind = max(kinds, key=_ORDER.index, default="int")
        if isinstance(op, ast.Div) and kind in ("int", "int32"):
            self._refuse(node, "a division of whole numbers: say float(...) of one")
        if isinstance(op, ast.RShift | ast.LShift):
            kind = left.kind
        if left.value is not None and right.value is not None and kind == "int":
            return self._known(of(left.value, right.value))
        return _Number(f"({left.text} {sign} {right.text})", kind)

    def _compared(self, node: ast.AST, terms: list[ast.expr], ops: list[ast.cmpop]) -> _Number:
        numbers = [self._number(one) for one in terms]
        if any(type(op) not in _COMPARISONS for op in ops):
            self._refuse(node, "a comparison that C has not")
        signs = [_COMPARISONS[type(op)] for op in ops]
        if len(ops) == 1 and all(one.value is not None for one in numbers):
            return self._known(bool(signs[0][1](numbers[0].value, numbers[1].value)))
        pairs = zip(numbers[:-1], signs, numbers[1:], strict=True)
        said = [f"({a.text} {sign} {b.text})" for a, (sign, _), b in pairs]
        return _Number(said[0] if len(said) == 1 else f"({' && '.join(said)})", "bool")

    def _chosen(self, node: ast.AST, test: _Number, one: _Number, other: _Number) -> _Number:
        if one.kind != other.kind:
            self._refuse(node, f"is {one.kind} or {other.kind}")
        if test.value is not None:
            return one if test.value else other
        return _Number(f"({test.text} ? {one.text} : {other.text})", one.kind)

    def _call(self, node: ast.Call) -> _Number:
        name = ast.unparse(node.func)
        if node.keywords:
            self._refuse(node, "arguments without names are wanted")
        if name in ("float", "np.float32", "np.int32", "int"):
            one = self._number(node.args[0])
            kind = {"float": "float64", "int": "int"}.get(name) or name.removeprefix("np.")
            if one.value is not None:
                return _Number(literal(one.value, kind), kind, one.value)
            if kind == "int" and one.kind == "float32":
                return _Number(f"(int){one.text}", "int")
            return _Number(f"({_TYPES[kind]}){one.text}", kind)
        if name in ("min", "max", "abs", "np.floor", "np.round"):
            return self._built_in(node, name)
        function = self._function.__globals__.get(name)
        if function is None or not callable(function):
            self._refuse(node, "a function that C has not")
        given = [self._as_array(self._value(one)) for one in node.args]
        given = [_Number(one.text, one.kind) if isinstance(one, _Number) else one for one in given]
        made, result = self._whole.made_of(function, given)
        passed = [one.text if isinstance(one, _Number) else one.place for one in given if _is_passed(one)]
        return _Number(f"{made}({', '.join(_bare(one) for one in passed)})", result or "none")

    def _built_in(self, node: ast.Call, name: str) -> _Number:
        numbers = [self._number(one) for one in node.args]
        kinds = {one.kind for one in numbers}
        kind = max(kinds, key=_ORDER.index)
        if len(kinds) > 1 and kinds != {"int", "int32"} and kinds != {"int", "float64"}:
            self._refuse(node, f"numbers of one kind are wanted, not {' and '.join(sorted(kinds))}")
        called = f"{name.removeprefix('np.')}_{_TYPES[kind].removesuffix('_t')}"
        return _Number(f"{called}({', '.join(_bare(one.text) for one in numbers)})", kind)


def _is_passed(one: _Value) -> TypeGuard[Array | _Number]:
    """Return whether a function of C takes it: a number, or an array that may be another in another call."""
    return isinstance(one, _Number) or (isinstance(one, Array) and one.passed)


def _bare(text: str) -> str:
    """Return ``text`` without parentheses around the whole of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0 and place < len(text) - 1:
            return text
    return text[1:-1]
