"""Settings that a person chooses: every field says by its type which values are valid, in one way."""

import math
import re
from collections.abc import Iterator, Mapping
from functools import cache
from inspect import get_annotations
from reprlib import repr as shortened
from typing import Annotated, Any, Literal, TypeAlias, get_args, get_origin, get_type_hints

import msgspec
from cyclopts import Parameter
from msgspec import Meta

from pneumarm.errors import UnusableInput

PositiveFloat: TypeAlias = Annotated[float, Meta(gt=0)]
NonNegativeFloat: TypeAlias = Annotated[float, Meta(ge=0)]
PositiveInt: TypeAlias = Annotated[int, Meta(ge=1)]
NonNegativeInt: TypeAlias = Annotated[int, Meta(ge=0)]
Share: TypeAlias = Annotated[float, Meta(ge=0, le=1)]
Units: TypeAlias = Annotated[int, Meta(ge=1, le=1024)]
"""Hidden units of a layer."""
Layers: TypeAlias = Annotated[tuple[Units, ...], Meta(min_length=1, max_length=8)]
"""Hidden units of each layer of a network."""
PythonOnly = Parameter(parse=False)
"""Marks a field that is no option of commands, as ``Annotated[PositiveFloat, PythonOnly]``."""

Valid = Mapping[str, bool | str]
"""By field True where its value is valid; otherwise what is expected in its place, or False."""


class Settings:
    """Base of frozen dataclasses whose values are checked when they are made, in Python and on the command line.

    Which values a field can have is in its type, such as :data:`PositiveFloat`; all numbers are finite. What relates
    several fields a class says by ``_valid``. What the classes that it inherits from say is asked as well, so that
    none can be forgotten. Lists, and numbers and arrays of NumPy, become tuples and plain numbers first: they are
    written to files and compared with those of files.
    """

    def _valid(self) -> Valid:
        return {}

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            plain = _plain(value)
            if plain is not value:
                object.__setattr__(self, name, plain)
        validate(self)

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "__post_init__" in vars(cls):
            raise TypeError(f"{cls.__name__}: settings are checked by _valid(), not by a __post_init__ of their own")


def _plain(value: Any) -> Any:
    """Return ``value`` without lists and NumPy, the same object where there is none in it."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list) or (type(value) is tuple and any(_plain(one) is not one for one in value)):
        return tuple(map(_plain, value))
    return value


def validate(settings: object) -> None:
    """Raise UnusableInput for the first field of ``settings`` that its type, its class or a base finds invalid."""
    for name, found in _found(settings):
        if found is not True:
            expected = f"expected {found}" if found else "see its documentation"
            value = shortened(getattr(settings, name))
            raise UnusableInput(f"{type(settings).__name__}: {name} cannot be {value}; {expected}")


def _found(settings: Any) -> Iterator[tuple[str, bool | str]]:
    """Yield each field with True or what is expected: first by its type, then by ``_valid``, that of bases first."""
    for name, kind in _types(type(settings)):  # type: ignore[arg-type]
        yield name, _expected(getattr(settings, name), kind) or True
    for base in reversed(type(settings).__mro__):
        if "_valid" in vars(base):
            yield from vars(base)["_valid"](settings).items()


@cache
def _types(kind: type) -> list[tuple[str, Any]]:
    """Return the fields of ``kind`` with their types, those of its bases first, also where it names them again."""
    return [
        (name, get_type_hints(base, include_extras=True)[name])
        for base in reversed(kind.__mro__)
        for name in get_annotations(base)
    ]


def _expected(value: Any, kind: Any) -> str | None:
    """Return what the type ``kind`` expects in place of ``value``; None where it is valid, or not checked here."""
    try:
        msgspec.convert(value, kind, strict=True)
    except msgspec.ValidationError as error:
        return ", ".join(_choices(kind)) or in_words(error)
    except TypeError:  # a type that msgspec does not know
        return None
    return None if _is_finite(value) else "finite numbers"


_KINDS = {"int": "a whole number", "float": "a number", "str": "a text", "bool": "true or false", "object": "a table"}
_BOUNDS = {">=": "{} or more", "<=": "{} or less", ">": "more than {}", "<": "less than {}", None: "{}"}
_SAID = re.compile(
    r"Expected `(?P<kind>\w+)(?: \| null)?`(?: (?:of length )?(?P<sign>[<>]=?)? ?(?P<bound>[-+.\de]+))?"
    r"(?:, got [^$]+?)?(?: - at `\$(?P<place>.+)`)?"
)
_LISTED = re.compile(r"Invalid enum value .* - at `\$\.(\w+)`")


def in_words(error: msgspec.ValidationError, settings: type | None = None) -> str:
    """Return what was expected as ``error`` says it, in words: "a whole number, 1 or more".

    Of a field of ``settings`` that lists its values, which msgspec does not name, return these.
    """
    found, listed = _SAID.fullmatch(str(error)), _LISTED.fullmatch(str(error))
    if listed is not None and settings is not None:
        return f"{', '.join(_choices(get_type_hints(settings)[listed[1]]))}, at {listed[1]}"
    if found is None:
        return str(error).removeprefix("Expected ")
    kind, sign, bound, place = found.groups()
    least = "" if bound is None else _BOUNDS[sign].format(bound.removesuffix(".0"))
    if kind == "array":
        said = f"{least} values" if least else "a list of values"
    else:
        said = f"{_KINDS.get(kind, kind)}{least and ', '}{least}"
    return said + _place(place)


def _place(place: str | None) -> str:
    """Return where msgspec says that something is: ``[1]`` is the second value of several, ``.name`` a field."""
    if place is None:
        return ""
    if number := re.fullmatch(r"\[(\d+)\]", place):
        return f", as value {int(number[1]) + 1}"
    return f", at {place.removeprefix('.')}"


def _choices(kind: Any) -> Iterator[str]:
    """Yield the values that ``kind`` lists, which msgspec does not name."""
    for one in get_args(kind):
        yield from [str(one)] if get_origin(kind) is Literal else _choices(one)


def _is_finite(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)
