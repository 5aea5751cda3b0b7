"""Files that are written whole or not at all, and read with errors for people."""

import errno
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import PneumarmError, UnusableInput

_UMASK = os.umask(0)
os.umask(_UMASK)  # there is no other way to ask for it
_ENTRY = "pneumarm"
_LARGEST_HEADER = 1 << 20
_LARGEST_FILE = 64 << 20
_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors that have nothing to do with what was asked for."""


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a temporary path next to ``path``; on leaving, make it durable and put it in place of ``path``.

    Raises:
        UnusableInput: the parent folder is missing or may not be written to.
        PneumarmError: the disk is full or broken.

    """
    require_folder(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
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
    finally:
        temporary.unlink(missing_ok=True)


def _not_written(path: Path, error: OSError) -> PneumarmError:
    """Return what is said where ``path`` could not be written: the fault of the disk, or of what was asked for."""
    words = f"{path}: cannot be written ({error.strerror or error})"
    if error.errno in _OF_THE_DISK:
        return PneumarmError(f"{words}; free some space, then run the same command again")
    return UnusableInput(words)


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
    temporary = folder.absolute().with_name(f".{folder.name}.part")
    shutil.rmtree(temporary, ignore_errors=True)
    try:
        yield temporary
        temporary.rename(folder)
    except OSError as error:
        raise _not_written(folder, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


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
    expected = "expected a file written by pneumarm"
    with _opened(path, expected) as (kind, _, _):
        return kind


def read_arrays(path: Path, kind: str) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Return the settings and arrays of a file written by :func:`write_arrays`; all numbers are finite.

    Sizes are checked before memory is taken, and nothing in the file is executed.

    Raises:
        UnusableInput: no such file, not of this kind, too large, damaged, or with numbers that are not finite.

    """
    expected = f"expected a file of kind {kind!r} written by pneumarm"
    with _opened(path, expected) as (found, settings, file):
        if found != kind:
            raise UnusableInput(f"{path}: {expected}, its kind is {found!r}")
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    for name, array in arrays.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise UnusableInput(f"{path}: {name} holds numbers that are not finite")
    return settings, arrays


@contextmanager
def _opened(path: Path, expected: str) -> Iterator[tuple[str, Any, Any]]:
    """Give the kind, the settings and the opened file; whatever is wrong with it, inside too, is an UnusableInput."""
    from safetensors import SafetensorError, safe_open

    if path.exists() and not path.is_file():
        raise UnusableInput(f"{path}: {expected}, this is not a file")  # opening a pipe would wait forever
    try:
        size = path.stat().st_size
        with open(path, "rb") as file:
            header = int.from_bytes(file.read(8), "little")
    except OSError as error:
        raise UnusableInput(f"{path}: {expected}, but it cannot be read ({error.strerror})") from error
    if size > _LARGEST_FILE or not 2 <= header <= min(_LARGEST_HEADER, size - 8):
        raise UnusableInput(f"{path}: {expected}, this is something else")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = json.loads((file.metadata() or {})[_ENTRY], parse_constant=_refuse_constant)
            yield metadata["kind"], metadata["settings"], file
    except (SafetensorError, ValueError, KeyError, RecursionError, TypeError) as error:
        raise UnusableInput(f"{path}: {expected}, it is damaged ({error})") from error


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
