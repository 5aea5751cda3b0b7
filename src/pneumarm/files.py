"""Files that are written whole or not at all, and read with errors for people.

What a user names may be anything: a pipe, a device, a file of any size, something else's. All that is small enough
to be read at once is read by :func:`read_bytes`; what is read piece by piece asks :func:`require_regular_file` first.
"""

import csv
import errno
import io
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import PneumarmError, UnusableInput

_UMASK = os.umask(0)
os.umask(_UMASK)  # there is no other way to ask for it
_ENTRY = "pneumarm"
_LARGEST_HEADER = 1 << 20
_LARGEST_FILE = 64 << 20
LARGEST_TEXT = 16 << 20
"""Bytes of a table or of JSON. Read, they take up to 25 times as much memory."""
_LARGEST_TOML = 1 << 20
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*"|'[^'\n]*')[ \t]*+\.[ \t]*+){16}""")
"""The beginning of a key of TOML of more parts than any of ours; memory for one grows with their square."""
_ZERO = re.compile(r"\\u0000|\\U00000000")  # no name of a file may hold it
_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors that have nothing to do with what was asked for."""


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a temporary path next to ``path``; on leaving, make it durable and put it in place of ``path``.

    It lies in a new folder that is this user's alone, so that nobody can have put a link in its place.

    Raises:
        UnusableInput: the parent folder is missing or may not be written to.
        PneumarmError: the disk is full or broken.

    """
    require_folder(path)
    try:
        with _own_folder(path) as own:
            temporary = Path(own) / path.name
            yield temporary
            os.chmod(temporary, 0o666 & ~_UMASK)  # some writers make files that only their owner may read
            with open(temporary, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(temporary, path)
        if os.name == "posix":  # elsewhere folders cannot be opened
            folder = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
    except OSError as error:
        raise _not_written(path, error) from error


def _own_folder(path: Path) -> TemporaryDirectory[str]:
    where = path.absolute().parent
    return TemporaryDirectory(".part", f".{path.name[:100]}.", where, ignore_cleanup_errors=True)


def _not_written(path: Path, error: OSError) -> PneumarmError:
    """Return what is said where ``path`` could not be written: the fault of the disk, or of what was asked for."""
    words = f"{path}: cannot be written ({error.strerror or error})"
    if error.errno in _OF_THE_DISK:
        return PneumarmError(f"{words}; free some space, then run the same command again")
    return UnusableInput(words)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Name ``path`` where writing to it fails: PneumarmError of a disk, UnusableInput of anything else."""
    try:
        yield
    except OSError as error:
        raise _not_written(path, error) from error


def require_folder(path: Path) -> None:
    """Raise UnusableInput where the folder that ``path`` lies in is missing, before hours go into its content."""
    if not path.parent.is_dir():
        raise UnusableInput(f"{path}: the folder {path.parent} does not exist; create it first")


def require_output(folder: Path) -> None:
    """Raise UnusableInput where ``folder`` is none and cannot be made, before hours go into its content."""
    nearest = next((one for one in (folder, *folder.parents) if one.exists()), folder)
    if not nearest.is_dir():
        raise UnusableInput(f"{folder}: {nearest} is a file; give a folder")
    if not os.access(nearest, os.W_OK):
        raise UnusableInput(f"{folder}: the folder {nearest} may not be written to; give another")


def make_folder(folder: Path) -> None:
    """Make ``folder``, which is itself what is written, with its parents; it may exist already."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _not_written(folder, error) from error


@contextmanager
def folder_written_whole(folder: Path) -> Iterator[Path]:
    """Give a folder to write into, which gets the name ``folder`` when all is in it, and is removed otherwise.

    Raises:
        UnusableInput: ``folder`` exists, or may not be written.
        PneumarmError: the disk is full or broken.

    """
    if folder.exists():
        raise UnusableInput(f"{folder}: exists already; give a folder that does not")
    make_folder(folder.parent)
    with writing(folder), _own_folder(folder) as own:
        yield Path(own) / folder.name
        (Path(own) / folder.name).rename(folder)


def refuse_link(path: Path) -> None:
    """Raise UnusableInput where ``path``, a file beside one that is to be written, is a link to anywhere else."""
    if path.is_symlink():
        raise UnusableInput(f"{path}: is a symbolic link, and would be written through; remove it")


def require_regular_file(path: Path | str, expected: str) -> None:
    """Raise UnusableInput where ``path`` is none: opening a pipe would wait, a device may never end.

    ``expected`` says in an error what it should have been, as in "a TOML file with options".
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:  # a ValueError of names that no file can have
        raise _not_read(path, expected, error) from error
    if not stat.S_ISREG(mode):
        raise UnusableInput(f"{path}: expected {expected}, this is not a file")


def _not_read(path: Path | str, expected: str, error: Exception) -> UnusableInput:
    reason = str(getattr(error, "strerror", None) or error)
    return UnusableInput(f"{path}: expected {expected}, but it cannot be read ({reason[:1].lower()}{reason[1:]})")


def read_bytes(path: Path | str, expected: str, most: int = LARGEST_TEXT) -> bytes:
    """Return the content of the file ``path``.

    Raises:
        UnusableInput: there is none, it is no regular file, is larger than ``most`` bytes, or cannot be read.

    """
    content = read_beginning(path, expected, most + 1)
    if len(content) > most:
        raise UnusableInput(f"{path}: expected {expected}, this is larger than {most:,} bytes")
    return content


def read_beginning(path: Path | str, expected: str, length: int) -> bytes:
    """Return the first ``length`` bytes of the file ``path``, or all; raises UnusableInput as :func:`read_bytes`."""
    require_regular_file(path, expected)
    try:
        with open(path, "rb") as file:
            return file.read(length)
    except OSError as error:
        raise _not_read(path, expected, error) from error


def read_text(path: Path | str, expected: str, most: int = LARGEST_TEXT) -> str:
    """Return the text in the file ``path``, in UTF-8; raises UnusableInput as :func:`read_bytes`."""
    try:
        return read_bytes(path, expected, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnusableInput(f"{path}: expected {expected}, this is no text in UTF-8 ({error})") from error


def read_rows(path: Path | str, expected: str) -> Iterator[list[str]]:
    """Yield the rows of comma-separated cells in the file ``path``, but for empty ones; raises UnusableInput."""
    try:
        yield from filter(None, csv.reader(io.StringIO(read_text(path, expected), newline="")))
    except csv.Error as error:
        raise UnusableInput(f"{path}: expected {expected}; {error}") from error


def read_toml(path: Path | str, expected: str, most: int = _LARGEST_TOML) -> dict[str, Any]:
    """Return the tables in the TOML file ``path``; raises UnusableInput."""
    text = read_text(path, expected, most)
    try:
        if _LONG_KEY.search(text) or _ZERO.search(text):
            raise ValueError("a key has too many dots, or a text a character 0")
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise UnusableInput(f"{path}: expected {expected}; {error}") from error


def read_json(path: Path | str, expected: str, most: int = LARGEST_TEXT) -> dict[str, Any]:
    """Return the object in the JSON file ``path``; raises UnusableInput."""
    return parse_json(read_bytes(path, expected, most), f"{path}: expected {expected}")


def parse_json(text: str | bytes, expected: str) -> dict[str, Any]:
    """Return the object that the JSON ``text`` is; raises UnusableInput, which begins with what was ``expected``."""
    try:
        value = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError, TypeError) as error:
        raise UnusableInput(f"{expected}; {error}") from error
    if not isinstance(value, dict):
        raise UnusableInput(f"{expected}, which is a JSON object; got {type(value).__name__}")
    return value


def write_text(path: Path, text: str) -> None:
    """Write ``text`` to ``path``, whole or not at all."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_bytes(path: Path, content: bytes) -> None:
    """Write ``content`` to ``path``, whole or not at all."""
    with written_whole(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` to ``path`` as JSON, whole or not at all."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def write_arrays(path: Path, kind: str, settings: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Write ``arrays`` and ``settings`` (JSON) to a safetensors file of the given ``kind``."""
    from safetensors.numpy import save

    contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    # One entry: the order of several would differ from file to file.
    metadata = {_ENTRY: json.dumps({"kind": kind, "settings": settings}, allow_nan=False)}
    write_bytes(path, save(contiguous, metadata=metadata))  # whose own errors of a disk are no OSError


def kind_of(path: Path) -> str:
    """Return the kind of a file written by :func:`write_arrays`.

    Raises:
        UnusableInput: no such file, or one that pneumarm did not write.

    """
    expected = "a file written by pneumarm"
    with _opened(path, expected) as (kind, _, _):
        return kind


def read_arrays(path: Path, kind: str) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Return the settings and arrays of a file written by :func:`write_arrays`; all numbers are finite.

    Sizes are checked before memory is taken, and nothing in the file is executed.

    Raises:
        UnusableInput: no such file, not of this kind, too large, damaged, or with numbers that are not finite.

    """
    expected = f"a file of kind {kind!r} written by pneumarm"
    with _opened(path, expected) as (found, settings, file):
        if found != kind:
            raise UnusableInput(f"{path}: expected {expected}, its kind is {found!r}")
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    for name, array in arrays.items():
        if array.dtype.kind == "f" and not (np.abs(array) <= np.finfo(np.float32).max).all():
            raise UnusableInput(f"{path}: {name} holds numbers that are not finite, or too large to compute with")
    return settings, arrays


@contextmanager
def _opened(path: Path, expected: str) -> Iterator[tuple[str, Any, Any]]:
    """Give the kind, the settings and the opened file; whatever is wrong with it, inside too, is an UnusableInput."""
    from safetensors import SafetensorError, safe_open

    header, size = int.from_bytes(read_beginning(path, expected, 8), "little"), path.stat().st_size
    if size > _LARGEST_FILE or not 2 <= header <= min(_LARGEST_HEADER, size - 8):
        raise UnusableInput(f"{path}: expected {expected}, this is something else")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = parse_json((file.metadata() or {})[_ENTRY], f"{path}: expected {expected}, it is damaged")
            kind, settings = metadata["kind"], metadata["settings"]
            if not isinstance(kind, str) or not isinstance(settings, dict):
                raise TypeError("its kind is no text, or its settings are no table")
            yield kind, settings, file
    except (SafetensorError, ValueError, KeyError, RecursionError, TypeError) as error:
        raise UnusableInput(f"{path}: expected {expected}, it is damaged ({error})") from error


def refuse_code(path: Path, option: str, name: str) -> NoReturn:
    """Raise UnusableInput where the file ``path`` names code: only a user, by an ``option``, can have it loaded."""
    raise UnusableInput(
        f"{path}: its {option} is {name}, whose code would run; a file cannot ask for that, only you can: give "
        f"--{option} {name} if you trust it"
    )


def _refuse_constant(name: str) -> Any:
    raise ValueError(f"{name} is not a number")


def as_toml(value: Any) -> str:
    """Return ``value`` as TOML; Python and TOML write numbers alike."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # A basic string of TOML is one of JSON, but for the characters that only TOML wants escaped.
        return msgspec.json.encode(value).decode().replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(as_toml, value))}]"
    if isinstance(value, dict):
        entries = [f"{key} = {as_toml(entry)}" for key, entry in value.items() if entry is not None]
        return f"{{{', '.join(entries)}}}"
    return repr(value)
