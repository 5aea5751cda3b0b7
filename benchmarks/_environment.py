"""Settings of benchmarks, from variables of the environment."""

import math
import os
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from pneumarm.errors import UnusableInput

Value = TypeVar("Value")


def text(name: str, usual: str) -> str:
    """Return the variable ``name`` as it is."""
    return os.environ.get(name, usual)


def words(name: str, usual: str) -> list[str]:
    """Return what stands between the commas of the variable ``name``."""
    return _read(name, usual, lambda value: [_filled(one) for one in value.split(",")], "words divided by commas")


def choice(name: str, choices: Collection[str]) -> str:
    """Return one of the ``choices``, by default the first."""
    return _read(name, next(iter(choices)), lambda value: _among(value, choices), f"one of {', '.join(choices)}")


def several(name: str, choices: Collection[str]) -> list[str]:
    """Return some of the ``choices``, divided by commas, in the order of the choices; by default all."""
    usual, expected = ",".join(choices), f"some of {', '.join(choices)}, divided by commas"
    found = _read(name, usual, lambda value: [_among(one, choices) for one in value.split(",")], expected)
    return [one for one in choices if one in found]


def whole(name: str, usual: int, least: int = 1) -> int:
    """Return a whole number that is ``least`` or more."""
    return _read(name, str(usual), lambda value: _at_least(int(value), least), f"a whole number, {least} or more")


def number(name: str, usual: float) -> float:
    """Return a number above 0."""
    return _read(name, str(usual), lambda value: _positive(float(value)), "a number above 0")


def numbers(name: str, usual: str) -> list[float]:
    """Return numbers above 0."""
    return _read(name, usual, _numbers, "numbers above 0 divided by commas")


def seeds(name: str, usual: str) -> list[int]:
    """Return the seeds of ``1,2,3`` or ``5000-5009``."""
    return _read(name, usual, seeds_in, "seeds such as 1,2,3 or 5000-5009")


def seeds_in(value: str) -> list[int]:
    """Return the seeds of ``value``; ValueError where there are none."""
    found = list[int]()
    for part in value.split(","):
        first, _, last = part.partition("-")
        found += range(int(first), _at_least(int(last or first), int(first)) + 1)
    return found


def folder(name: str, usual: str) -> Path:
    """Return a folder, which is made where there is none."""
    return _read(name, usual, _made, "a folder that can be made and written")


@contextmanager
def kept_folder(name: str) -> Iterator[Path]:
    """Give the folder that the variable ``name`` says, which is made where there is none, or else a temporary one."""
    with tempfile.TemporaryDirectory() as temporary:
        yield folder(name, temporary)


def _read(name: str, usual: str, meaning: Callable[[str], Value], expected: str) -> Value:
    value = text(name, usual)
    try:
        return meaning(value)
    except (ValueError, OSError) as error:
        raise UnusableInput(f"{name}: expected {expected}, got {value!r}") from error


def _filled(word: str) -> str:
    if not word:
        raise ValueError
    return word


def _among(value: str, choices: Collection[str]) -> str:
    if value not in choices:
        raise ValueError
    return value


def _at_least(value: int, least: int) -> int:
    if value < least:
        raise ValueError
    return value


def _numbers(value: str) -> list[float]:
    return [_positive(float(one)) for one in value.split(",")]


def _positive(value: float) -> float:
    if not 0 < value < math.inf:
        raise ValueError
    return value


def _made(value: str) -> Path:
    path = Path(value)
    path.mkdir(parents=True, exist_ok=True)
    return path
