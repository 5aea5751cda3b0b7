"""Settings that a person chooses: every class of them says which values are valid, in one way."""

from collections.abc import Mapping
from reprlib import repr as shortened
from typing import Any

from pneumarm.errors import UnusableInput

Valid = Mapping[str, bool | str]
"""By field True where its value is valid; otherwise what is expected in its place, or False."""


class Settings:
    """Base of frozen dataclasses whose values are checked when they are made, in Python and on the command line.

    A class says by ``_valid`` which of its own fields are. What the classes that it inherits from say is asked as
    well, so that none can be forgotten. Lists, and numbers and arrays of NumPy, become tuples and plain numbers
    first: they are written to files and compared with those of files.
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
    """Raise UnusableInput for the first field that the class of ``settings``, or one of its bases, finds invalid."""
    for kind in reversed(type(settings).__mro__):
        if "_valid" in vars(kind):
            for name, found in vars(kind)["_valid"](settings).items():
                if found is not True:
                    expected = f"expected {found}" if found else "see its documentation"
                    value = shortened(getattr(settings, name))
                    raise UnusableInput(f"{type(settings).__name__}: {name} cannot be {value}; {expected}")
